//! Blur and noise of an image: as estimated, as the caller knows them, and as the networks take
//! them.

mod known;

use crate::grid::FINE;
use crate::schema::Conditions;

pub use known::{Known, KnownEstimate};

/// The blur in pixels that is 1 on the networks' scale.
pub(crate) const SIGMA_SCALE_PX: f32 = 4.0;

/// Factor of the networks' scale of noise: a noise of 1 / 10 is 1.
pub(crate) const NOISE_SCALE: f32 = 10.0;

/// The largest condition used in training.
pub(crate) const CONDITION_MAX: f32 = 1.5;

/// Blur and noise of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Standard deviation of a Gaussian blur, in pixels of the 64 x 64 output grid.
    pub sigma_px: f32,
    /// Standard deviation of the noise of a pixel of the image as measured, of a full scale of 1.
    pub noise: f32,
}

impl Estimate {
    /// The estimate from the estimator's two outputs for an image of `side` x `side`. The outputs
    /// count blur in pixels of the image's own grid.
    pub(crate) fn of_outputs([sigma, noise]: [f32; 2], side: usize) -> Self {
        let px = SIGMA_SCALE_PX * (FINE / side) as f32;
        Self { sigma_px: px * sigma, noise: noise / NOISE_SCALE }
    }

    /// The UNet's conditions: two numbers for the position on the path, then blur and noise.
    pub(crate) fn conditions(&self, path: [f32; 2]) -> Conditions {
        let s = (self.sigma_px / SIGMA_SCALE_PX).clamp(0.0, CONDITION_MAX);
        let n = (self.noise * NOISE_SCALE).clamp(0.0, CONDITION_MAX);
        [path[0], path[1], s, s * s, n, n * n]
    }
}
