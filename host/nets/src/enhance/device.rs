//! Both stages for images that OMP has left on a GPU.
//!
//! # Invariant
//! What comes out is what [`Enhancer`](super::Enhancer) makes of the same images, to what single precision rounds
//! (`tests::images_that_are_there_become_what_the_processor_makes_of_them`).

use nirspi_recon::omp::gpu::DeviceImages;
use thiserror::Error;

use super::{Enhanced, Options, agreeing, constraint_on};
use crate::consistency::MeasuredRowsError;
use crate::deblur::AREA;
use crate::device::{Backend, Device};
use crate::fusion::{self, DepthMaps, push_planes};
use crate::gate;
use crate::network::{Guess, RunChain};
use crate::weights::{Weights, WeightsError};

/// Why images on a device are not enhanced there.
#[derive(Debug, Error)]
pub enum DeviceEnhancerError {
    /// The networks are on the processor.
    #[error("the networks are on the processor, expected a GPU")]
    NoGpu,
    /// The images are not where the networks are.
    #[error("the images are on {images}, expected them on {networks}, where the networks are")]
    Elsewhere {
        /// Where the images are.
        images: Backend,
        /// Where the networks are.
        networks: Backend,
    },
    /// The images are of another size.
    #[error("images of {found} pixels, expected {} x {}", fusion::SIDE, fusion::SIDE)]
    Size {
        /// Pixels of an image.
        found: usize,
    },
    /// The image's value for white is no light.
    #[error("white is {found}, expected more than 0")]
    White {
        /// What it is.
        found: f32,
    },
    /// Copies were asked for.
    #[error("the spread over copies is not taken on a device, expected no copies")]
    Copies,
    /// The measured rows do not belong to these readings.
    #[error(transparent)]
    Rows(#[from] MeasuredRowsError),
    /// The weights are of another network.
    #[error(transparent)]
    Weights(#[from] WeightsError),
}

/// Both stages, 32 x 32 in and 64 x 64 out, for images on a GPU, along the bridge in one step.
///
/// Images, FSRCNN's output and the UNet's input stay there. Agreement with the readings and the gate are the host's: they
/// are the last thing that is done to an image before it is looked at.
pub struct DeviceEnhancer {
    chain: Box<dyn RunChain>,
    backend: Backend,
    batch: usize,
}

impl DeviceEnhancer {
    /// Of the weights of its three networks (models `fsrcnn`, `estimator` and `diffusion` or `gan`).
    ///
    /// # Errors
    /// [`DeviceEnhancerError`] if `device` is no GPU or weights are of another network.
    pub fn new(
        device: &Device,
        fsrcnn: &Weights,
        estimator: &Weights,
        bridge: &Weights,
    ) -> Result<Self, DeviceEnhancerError> {
        let chain = device.chain(fsrcnn, estimator, bridge)?.ok_or(DeviceEnhancerError::NoGpu)?;
        Ok(Self { chain, backend: device.backend(), batch: device.batch() })
    }

    /// Enhances images that are on the networks' device, with the depth maps that go with them. Values are divided by
    /// `white` and clamped to [0, 1]; `progress` is told how many images are done.
    ///
    /// # Errors
    /// [`DeviceEnhancerError`] if the images are of another size or elsewhere, `white` is no light, or copies are asked for.
    pub fn enhance(
        &self,
        images: &DeviceImages,
        white: f32,
        depth: Option<&DepthMaps>,
        options: &Options,
        progress: &mut dyn FnMut(usize),
    ) -> Result<Enhanced, DeviceEnhancerError> {
        let there = images.device().backend();
        if there != self.backend {
            return Err(DeviceEnhancerError::Elsewhere { images: there, networks: self.backend });
        }
        if images.pixels() != fusion::SIDE * fusion::SIDE {
            return Err(DeviceEnhancerError::Size { found: images.pixels() });
        }
        if !(white > 0.0 && white.is_finite()) {
            return Err(DeviceEnhancerError::White { found: white });
        }
        if options.copies > 0 {
            return Err(DeviceEnhancerError::Copies);
        }
        let mut all = Enhanced::default();
        for first in (0..images.frames()).step_by(self.batch) {
            let part = first..images.frames().min(first + self.batch);
            let mut planes = Vec::new();
            if depth.is_some() {
                planes.reserve(2 * part.len() * images.pixels());
                part.clone().for_each(|image| push_planes(depth, image, &mut planes));
            }
            let guess = self.chain.run(images, part, white, &planes, options.estimate);
            all.append(finished(guess, options)?);
            progress(all.estimates.len());
        }
        Ok(all)
    }
}

/// What [`Enhancer`](super::Enhancer) does after the networks.
fn finished(guess: Guess, options: &Options) -> Result<Enhanced, MeasuredRowsError> {
    let Guess { readings, estimates, start, mut sharp } = guess;
    let constraint = constraint_on(&readings, &estimates, options)?;
    constraint.correct(&mut sharp);
    if options.gate {
        gate::close(&estimates, AREA, &mut sharp, |index| agreeing(&start, index, &constraint));
    }
    let inconsistency = constraint.residual_ratios(&sharp);
    Ok(Enhanced {
        images: sharp,
        upscaled: Some(start),
        estimates,
        estimated: None,
        inconsistency,
        spread: None,
    })
}

#[cfg(test)]
mod tests;
