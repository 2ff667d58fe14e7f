//! Chooses weights: for each network the embedded weights or the user's, and the device that runs
//! all networks.
//!
//! # Invariant
//! A user's file is used for the network that the file names, or refused, so no network runs with
//! weights of another network (`tests::a_file_is_taken_for_the_network_that_it_names_or_refused`).

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::deblur::{Deblurrer, Method};
#[cfg(feature = "gpu")]
use crate::device::Backend;
use crate::device::Device;
#[cfg(feature = "gpu")]
use crate::enhance::{DeviceEnhancer, DeviceEnhancerError};
use crate::enhance::{Enhancer, Sharpener};
use crate::estimator::BlurEstimator;
use crate::fusion::Fusion;
use crate::weights::{MODEL, VERSION, Weights, WeightsError};

/// A device, and the weights that networks use on it.
#[derive(Debug, Clone)]
pub struct Networks {
    device: Device,
    own: Vec<Weights>,
    folder: Option<PathBuf>,
    used: Vec<UsedWeights>,
}

/// Identity of the weights that a network was made from, for a report.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct UsedWeights {
    /// The network.
    pub model: String,
    /// Version in the weights' metadata.
    pub version: String,
    /// The file's path, or a note that the weights are embedded.
    pub from: String,
}

impl Networks {
    /// The embedded weights.
    pub fn built_in(device: Device) -> Self {
        Self { device, own: Vec::new(), folder: None, used: Vec::new() }
    }

    /// The same choice, with the user's weights in `file` for the network that the file names. That
    /// network must be one of `models`.
    ///
    /// # Errors
    /// [`WeightsError`] if the file cannot be read, is damaged, or does not name one of `models`.
    pub fn with_file(mut self, file: &Path, models: &[&str]) -> Result<Self, WeightsError> {
        let weights = Weights::read(file)?;
        let (file, expected) = (weights.label().to_owned(), models.join(" or "));
        match weights.metadata(MODEL).map(str::to_owned) {
            None => Err(WeightsError::Unnamed { file, expected }),
            Some(found) if !models.contains(&found.as_str()) => {
                Err(WeightsError::Model { file, expected, found })
            }
            Some(_) => {
                self.own.push(weights);
                Ok(self)
            }
        }
    }

    /// The same choice, with the weights in `folder/NETWORK.safetensors` for each network with such
    /// a file.
    #[must_use]
    pub fn with_folder(self, folder: impl Into<PathBuf>) -> Self {
        Self { folder: Some(folder.into()), ..self }
    }

    /// The weights of a network: from the user's file, from the folder, or embedded, in this order.
    ///
    /// # Errors
    /// [`WeightsError`] if a file in the folder is not weights of the network, or the network is
    /// not embedded.
    pub fn weights(&mut self, model: &str) -> Result<Weights, WeightsError> {
        let weights = self.find(model)?;
        weights.expect_model(model)?;
        let used = UsedWeights {
            model: model.to_owned(),
            version: weights.metadata(VERSION).unwrap_or("unknown").to_owned(),
            from: weights.label().to_owned(),
        };
        if !self.used.contains(&used) {
            self.used.push(used);
        }
        Ok(weights)
    }

    fn find(&self, model: &str) -> Result<Weights, WeightsError> {
        if let Some(own) = self.own.iter().find(|own| own.metadata(MODEL) == Some(model)) {
            return Ok(own.clone());
        }
        let file = self.folder.as_ref().map(|folder| folder.join(format!("{model}.safetensors")));
        match file.filter(|file| file.is_file()) {
            Some(file) => Weights::read(&file),
            None => Weights::embedded(model),
        }
    }

    /// FSRCNN.
    ///
    /// # Errors
    /// As [`weights`](Self::weights).
    pub fn fusion(&mut self) -> Result<Fusion, WeightsError> {
        let weights = self.weights("fsrcnn")?;
        Fusion::new(&self.device, &weights)
    }

    /// The estimator of blur and noise.
    ///
    /// # Errors
    /// As [`weights`](Self::weights).
    pub fn estimator(&mut self) -> Result<BlurEstimator, WeightsError> {
        let weights = self.weights("estimator")?;
        BlurEstimator::new(&self.device, &weights)
    }

    /// Estimator and deblurrer: 64 x 64 in and out.
    ///
    /// # Errors
    /// As [`weights`](Self::weights).
    pub fn sharpener(&mut self, method: Method) -> Result<Sharpener, WeightsError> {
        let estimator = self.estimator()?;
        let weights = self.weights(method.model().name())?;
        Ok(Sharpener::new(estimator, Deblurrer::new(&self.device, &weights, method)?))
    }

    /// All three networks: input 32 x 32, output 64 x 64.
    ///
    /// # Errors
    /// As [`weights`](Self::weights).
    pub fn enhancer(&mut self, method: Method) -> Result<Enhancer, WeightsError> {
        let enhancer = Enhancer::new(self.fusion()?, self.sharpener(method)?);
        #[cfg(feature = "gpu")]
        if method == Method::default() && self.device.backend() != Backend::Cpu {
            match self.device_enhancer() {
                Ok(on_device) => return Ok(enhancer.with_device(on_device)),
                Err(DeviceEnhancerError::Weights(error)) => return Err(error),
                Err(why) => self.device.tell_through_host(why.to_string()),
            }
        }
        Ok(enhancer)
    }

    /// All three networks, with one step of the bridge, for images that OMP leaves on a GPU.
    ///
    /// # Errors
    /// [`DeviceEnhancerError`] if the device is not a GPU; otherwise as [`weights`](Self::weights).
    #[cfg(feature = "gpu")]
    pub fn device_enhancer(&mut self) -> Result<DeviceEnhancer, DeviceEnhancerError> {
        let [fsrcnn, estimator] = [self.weights("fsrcnn")?, self.weights("estimator")?];
        let bridge = self.weights("diffusion")?;
        DeviceEnhancer::new(&self.device, &fsrcnn, &estimator, &bridge)
    }

    /// The device that the networks run on.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// All weights used so far.
    pub fn used(&self) -> &[UsedWeights] {
        &self.used
    }
}

impl Enhancer {
    /// The embedded networks: FSRCNN, the estimator, and the diffusion bridge with one step.
    ///
    /// # Errors
    /// [`WeightsError::Checksum`] if the embedded weights are damaged.
    pub fn built_in(device: &Device) -> Result<Self, WeightsError> {
        Networks::built_in(device.clone()).enhancer(Method::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::weights::Precision;
    use std::fs;

    /// A folder for this test, removed at the end.
    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str) -> Self {
            let name = format!("nirspi-nets-{name}-{}", std::process::id());
            let folder = std::env::temp_dir().join(name);
            fs::create_dir_all(&folder).unwrap();
            Self(folder)
        }

        /// Writes the embedded estimator with another version, as weights of the network `model`.
        fn write(&self, file: &str, model: Option<&str>) -> PathBuf {
            let embedded = Weights::embedded("estimator").unwrap();
            let mut weights = Weights::new(file);
            for name in embedded.names() {
                weights.insert(name.to_owned(), embedded.get(name).unwrap().clone());
            }
            weights.set_metadata(VERSION, "own");
            if let Some(model) = model {
                weights.set_metadata(MODEL, model);
            }
            let path = self.0.join(file);
            fs::write(&path, weights.to_bytes(Precision::Half).unwrap()).unwrap();
            path
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    fn built_in() -> Networks {
        Networks::built_in(Device::cpu())
    }

    #[test]
    fn a_file_is_taken_for_the_network_that_it_names_or_refused() {
        let folder = Folder::new("file");
        let models = ["fsrcnn", "estimator"];
        let own = folder.write("own.safetensors", Some("estimator"));
        let mut networks = built_in().with_file(&own, &models).unwrap();
        networks.estimator().unwrap();
        networks.fusion().unwrap();
        networks.estimator().unwrap();
        let [estimator, fsrcnn] = networks.used() else { panic!("{:?}", networks.used()) };
        assert_eq!((&*estimator.version, &*estimator.from), ("own", own.to_str().unwrap()));
        assert_eq!(fsrcnn.from, "embedded weights of fsrcnn");

        let error = built_in().with_file(&own, &["fsrcnn", "gan"]).unwrap_err().to_string();
        assert!(error.ends_with("weights of network estimator, expected fsrcnn or gan"), "{error}");
        let unnamed = folder.write("unnamed.safetensors", None);
        let error = built_in().with_file(&unnamed, &models).unwrap_err().to_string();
        let expected = "does not say which network it is for, expected fsrcnn or estimator";
        assert!(error.ends_with(expected), "{error}");
    }

    #[test]
    fn a_folder_gives_the_networks_that_it_has_and_no_other() {
        let folder = Folder::new("folder");
        folder.write("estimator.safetensors", Some("estimator"));
        folder.write("fsrcnn.safetensors", Some("estimator"));
        let mut networks = built_in().with_folder(&folder.0);
        networks.estimator().unwrap();
        networks.weights("gan").unwrap();
        let versions: Vec<&str> = networks.used().iter().map(|used| &*used.version).collect();
        assert_eq!(versions[0], "own");
        assert_ne!(versions[1], "own");
        assert!(matches!(networks.fusion(), Err(WeightsError::Model { .. })));
    }
}
