//! Estimates blur and noise of an image from the image itself.

use crate::device::Device;
use crate::estimate::Estimate;
use crate::images::Images;
use crate::network::RunEstimator;
use crate::weights::{Weights, WeightsError};

/// The estimator.
pub struct BlurEstimator {
    network: Box<dyn RunEstimator>,
    batch: usize,
}

impl BlurEstimator {
    /// The network with these weights (model `estimator`).
    ///
    /// # Errors
    /// [`WeightsError`] if the weights belong to another network.
    pub fn new(device: &Device, weights: &Weights) -> Result<Self, WeightsError> {
        weights.expect_model("estimator")?;
        Ok(Self { network: device.estimator(weights)?, batch: device.batch() })
    }

    /// Blur and noise of each image of 32 x 32 or 64 x 64.
    pub fn estimate<const SIDE: usize>(&self, images: Images<'_, SIDE>) -> Vec<Estimate> {
        images
            .values()
            .chunks(self.batch * SIDE * SIDE)
            .flat_map(|chunk| self.network.run(SIDE, chunk))
            .map(|outputs| Estimate::of_outputs(outputs, SIDE))
            .collect()
    }
}
