//! The interface for your own network: anything that estimates sharp images.

use thiserror::Error;

use super::{AREA, SIDE};
use crate::estimate::Estimate;
use crate::network::RunUNet;

/// A network, or any other code, that estimates sharp images.
///
/// The library does the rest: the bridge calls [`guess`](Self::guess) once for each step, moves
/// each guess into agreement with the readings, and leaves sharp, clean images unchanged.
pub trait Sharpen: Send {
    /// Estimates the sharp image of each image of a batch: (N, 64, 64), white being 1. Values
    /// outside [0, 1] are clamped. A value that is not finite, or another number of values, is
    /// refused.
    fn guess(&self, batch: Blurred<'_>) -> Vec<f32>;

    /// Number of images that keep the network's device busy.
    fn batch(&self) -> usize {
        32
    }
}

/// Images to sharpen, row-major, one after another.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct Blurred<'a> {
    /// (N, 64, 64) in [0, 1]: the start of the path, as blurred as the readings.
    pub start: &'a [f32],
    /// (N, 64, 64) in [0, 1]: the current point of the path, equal to `start` in the first step.
    pub current: &'a [f32],
    /// (N, 64, 64) in [0, 1]: the readings; each pixel of 32 x 32 readings is repeated.
    pub readings: &'a [f32],
    /// Blur and noise of each image's readings.
    pub estimates: &'a [Estimate],
    /// Share of `start` left in `current`: 1 in the first step, 1 / steps in the last.
    pub time: f32,
}

/// Why a guess is refused.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SharpenError {
    /// The guess is not one image of 64 x 64 for each image of the batch.
    #[error(
        "the sharpening network gave {found} pixels, expected {images} images of {SIDE} x {SIDE}"
    )]
    Pixels {
        /// Number of values.
        found: usize,
        /// Number of images of the batch.
        images: usize,
    },
    /// A value is not finite.
    #[error("the sharpening network gave {value}, expected finite numbers")]
    NotFinite {
        /// The value.
        value: f32,
    },
}

/// The guess of `network`, after checks.
pub(super) fn checked(network: &dyn Sharpen, batch: Blurred<'_>) -> Result<Vec<f32>, SharpenError> {
    let (guess, images) = (network.guess(batch), batch.estimates.len());
    if guess.len() != images * AREA {
        return Err(SharpenError::Pixels { found: guess.len(), images });
    }
    match guess.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(SharpenError::NotFinite { value }),
        None => Ok(guess),
    }
}

/// The UNet of the bridge and of the GAN. It estimates the difference between the sharp image and
/// the start.
pub(super) struct Residual {
    pub(super) unet: Box<dyn RunUNet>,
    pub(super) batch: usize,
}

impl Sharpen for Residual {
    fn guess(&self, batch: Blurred<'_>) -> Vec<f32> {
        let t = batch.time;
        let conditions: Vec<_> = batch.estimates.iter().map(|e| e.conditions([t, t * t])).collect();
        let mut guess = self.unet.run(SIDE, batch.current, batch.readings, &conditions);
        guess.iter_mut().zip(batch.start).for_each(|(guess, start)| *guess += start);
        guess
    }

    fn batch(&self) -> usize {
        self.batch
    }
}
