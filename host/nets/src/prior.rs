//! The shipped network of the reconstruction method `prior`, and a user's own weights for it.
//!
//! The method is in `nirspi_recon::reconstruct::prior`: this module gives it a [`Network`].

use std::path::Path;
use std::sync::OnceLock;

use nirspi_recon::Side;
use nirspi_recon::reconstruct::MethodSettings;
use nirspi_recon::reconstruct::prior::{Network, Seen, SharedNetwork};

use crate::cpu;
use crate::weights::{Weights, WeightsError};

/// Sides of the images of training.
const SIDES: [usize; 3] = [32, 64, 128];

/// The network on the processor.
struct OnCpu(cpu::Prior);

/// The shipped network, which is read when it is first used.
struct Shipped(OnceLock<Result<cpu::Prior, String>>);

/// Settings with which every method of `nirspi_recon` can be prepared, `prior` among them: the
/// defaults, and the [shipped] network.
///
/// ```
/// use nirspi_recon::reconstruct::Method;
/// use nirspi_recon::{Measurements, Order, Rows, Side};
///
/// let side = Side::new(32)?;
/// let mut scene: Vec<f64> = (0..1024).map(|p| f64::from(p / 32 > 13)).collect();
/// nirspi_recon::fwht(&mut scene)?;
/// let all = Measurements::from_differential(&Rows::natural(side), &scene)?;
/// let part = all.take(Some(&Order::ZigZag), 0.2)?;
/// for method in Method::ALL {
///     let ready = method.prepare(&nirspi_nets::prior::settings())?;
///     println!("{}", ready.reconstruct(&part)?.report);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn settings() -> MethodSettings {
    MethodSettings { network: Some(shipped()), ..MethodSettings::default() }
}

/// The shipped network, for `MethodSettings::network`. Every caller shares one; its weights are
/// read when the first image is made.
#[must_use]
pub fn shipped() -> SharedNetwork {
    static SHARED: OnceLock<SharedNetwork> = OnceLock::new();
    SHARED.get_or_init(|| SharedNetwork::new(Shipped(OnceLock::new()))).clone()
}

/// A network with the weights of a file.
///
/// # Errors
/// [`WeightsError`] if the file cannot be read, or is not a network of this kind.
pub fn from_file(file: &Path) -> Result<SharedNetwork, WeightsError> {
    let weights = Weights::read(file)?;
    weights.expect_model("prior")?;
    Ok(SharedNetwork::new(OnCpu(cpu::Prior::new(&weights)?)))
}

fn takes(side: Side) -> bool {
    SIDES.contains(&side.pixels())
}

impl Network for OnCpu {
    fn name(&self) -> &str {
        "prior"
    }

    fn takes(&self, side: Side) -> bool {
        takes(side)
    }

    fn complete(&self, seen: &Seen) -> Result<Vec<f32>, String> {
        Ok(self.0.forward(seen))
    }
}

impl Network for Shipped {
    fn name(&self) -> &str {
        "prior"
    }

    fn takes(&self, side: Side) -> bool {
        takes(side)
    }

    fn complete(&self, seen: &Seen) -> Result<Vec<f32>, String> {
        let read = || {
            let weights = Weights::embedded("prior").map_err(|error| error.to_string())?;
            cpu::Prior::new(&weights).map_err(|error| error.to_string())
        };
        match self.0.get_or_init(read) {
            Ok(network) => Ok(network.forward(seen)),
            Err(reason) => Err(reason.clone()),
        }
    }
}

#[cfg(test)]
mod tests;
