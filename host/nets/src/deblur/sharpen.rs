//! Where a network of your own goes in: anything that guesses sharp images.

use thiserror::Error;

use super::{AREA, SIDE};
use crate::estimate::Estimate;
use crate::network::RunUNet;

/// A network, or anything else, that guesses sharp images.
///
/// The rest stays the library's: the bridge calls [`guess`](Self::guess) once a step, each guess is moved into agreement
/// with the readings, and sharp, clean images are left as they are.
pub trait Sharpen: Send {
    /// Guesses the sharp image of each image of a batch: (N, 64, 64), white being 1. A value outside [0, 1] is clamped; a
    /// value that is not finite, and another number of values, is refused.
    fn guess(&self, batch: Blurred<'_>) -> Vec<f32>;

    /// How many images at once keep the network's device busy.
    fn batch(&self) -> usize {
        32
    }
}

/// Images to sharpen, row-major, one after another.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct Blurred<'a> {
    /// (N, 64, 64) in [0, 1]: where the path starts, as blurred as the readings.
    pub start: &'a [f32],
    /// (N, 64, 64) in [0, 1]: where the path is now; equal to `start` in the first step.
    pub current: &'a [f32],
    /// (N, 64, 64) in [0, 1]: the readings, each pixel repeated where they are 32 x 32.
    pub readings: &'a [f32],
    /// Blur and noise of each image's readings.
    pub estimates: &'a [Estimate],
    /// How much of `start` is left in `current`: 1 in the first step, 1 / steps in the last.
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
        /// Values given.
        found: usize,
        /// Images of the batch.
        images: usize,
    },
    /// A value is not a finite number.
    #[error("the sharpening network gave {value}, expected finite numbers")]
    NotFinite {
        /// The value.
        value: f32,
    },
}

/// The guess of `network`, checked.
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

/// The UNet of the bridge and of the GAN: it says what the sharp image has more than the start.
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
