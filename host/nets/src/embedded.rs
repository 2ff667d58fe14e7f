//! The embedded weights (`host/nets/weights`, made as `docs/log/training.md` describes).

use crate::weights::{CHECKSUM, VERSION, Weights, WeightsError, header};
use serde::Serialize;

/// Names of the networks whose weights come with the crate `nirspi-weights-baselines`.
const BASELINES: [&str; 3] = ["gan", "ancestral", "regression"];

#[cfg(any(test, feature = "baselines"))]
const BASELINE_FILES: &[(&str, &[u8])] = &nirspi_weights_baselines::FILES;
#[cfg(not(any(test, feature = "baselines")))]
const BASELINE_FILES: &[(&str, &[u8])] = &[];

/// Name of each network, and the bytes of its weights.
fn files() -> impl Iterator<Item = (&'static str, &'static [u8])> {
    nirspi_weights::FILES.iter().chain(BASELINE_FILES).copied()
}

/// Weights that this build contains, as their file's metadata names them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ShippedWeights {
    /// The network.
    pub model: &'static str,
    /// The version of the weights.
    pub version: String,
    /// SHA-256 of the tensors, in hexadecimal. The checksum is verified when the weights are loaded.
    pub sha256: String,
}

impl ShippedWeights {
    /// All weights of this build. Reads the metadata alone.
    ///
    /// # Errors
    /// [`WeightsError::Format`] if an embedded file is damaged.
    pub fn all() -> Result<Vec<Self>, WeightsError> {
        let shipped = files().map(|(model, bytes)| {
            let (_, metadata) = header(&label(model), bytes)?;
            let text = |key| metadata.get(key).cloned().unwrap_or_else(|| "unknown".to_owned());
            Ok(Self { model, version: text(VERSION), sha256: text(CHECKSUM) })
        });
        shipped.collect()
    }
}

fn label(model: &str) -> String {
    format!("embedded weights of {model}")
}

impl Weights {
    /// The embedded weights of a network: `estimator`, `fsrcnn`, `diffusion`, `prior` or
    /// `classifier`; with the feature `baselines` also `gan`, `ancestral` or `regression`.
    ///
    /// # Errors
    /// [`WeightsError::LeftOut`] for a baseline in a build without the feature;
    /// [`WeightsError::NotEmbedded`] for any other name; [`WeightsError::Checksum`] if the embedded
    /// file is damaged.
    pub fn embedded(model: &str) -> Result<Self, WeightsError> {
        let model = model.to_owned();
        match files().find(|(name, _)| *name == model) {
            Some((_, bytes)) => Self::parse(&label(&model), bytes),
            None if BASELINES.contains(&model.as_str()) => Err(WeightsError::LeftOut { model }),
            None => Err(WeightsError::NotEmbedded { model }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::weights::{MODEL, RECIPE};

    #[test]
    fn each_file_says_whose_it_is_and_how_it_was_made_and_has_its_checksum() {
        for (model, _) in files() {
            let weights = Weights::embedded(model).unwrap();
            assert_eq!(weights.metadata(MODEL), Some(model));
            for key in [VERSION, RECIPE] {
                assert!(
                    weights.metadata(key).is_some_and(|text| !text.is_empty()),
                    "{model} {key}"
                );
            }
            let listed = ShippedWeights::all().unwrap();
            let listed = listed.iter().find(|weights| weights.model == model).unwrap();
            assert_eq!(Some(listed.version.as_str()), weights.metadata(VERSION));
            assert_eq!(listed.sha256.len(), 64, "{model}");
        }
        assert!(Weights::embedded("oracle").is_err());
    }
}
