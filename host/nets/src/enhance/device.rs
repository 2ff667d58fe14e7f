//! Both stages for images that OMP has left on a GPU.
//!
//! # Invariant
//! The results are those of [`Enhancer`](super::Enhancer) for the same images, to within the
//! rounding of single precision
//! (`tests::images_that_are_there_become_what_the_processor_makes_of_them`).

mod chain;

use std::ops::Range;

use nirspi_gpu::GpuError;
use nirspi_gpu::agreement::BROKEN;
use nirspi_recon::omp::OmpError;
use nirspi_recon::omp::gpu::{self, DeviceImages};
use rayon::prelude::*;
use thiserror::Error;

use super::{Enhanced, Options, constraint_on};
use crate::consistency::MeasuredRowsError;
use crate::device::{Backend, Device};
use crate::fusion::{self, DepthMaps, push_planes};
use crate::weights::{Weights, WeightsError};
use chain::{Chain, Guess};

/// Number of batches that are under way at a time, each on a thread and a stream of its own: while
/// the results of one are copied, another one is computed.
const AT_A_TIME: usize = 2;

/// Number of images that are uploaded at a time, 32 MB: less than the largest buffer of every device.
const UPLOADED: usize = 8192;

/// Why images on a device cannot be enhanced there.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DeviceEnhancerError {
    /// The networks run on the processor.
    #[error("the networks are on the processor, expected a GPU")]
    NoGpu,
    /// Images and networks are on different devices.
    #[error("the images are on {images}, expected them on {networks}, where the networks are")]
    Elsewhere {
        /// Device of the images.
        images: Backend,
        /// Device of the networks.
        networks: Backend,
    },
    /// The images have another size.
    #[error("images of {found} pixels, expected {} x {}", fusion::SIDE, fusion::SIDE)]
    Size {
        /// Number of pixels of an image.
        found: usize,
    },
    /// The value for white is not positive and finite.
    #[error("white is {found}, expected more than 0")]
    White {
        /// The value.
        found: f32,
    },
    /// Copies were requested.
    #[error("the spread needs the CPU: ask for no copies on a GPU")]
    Copies,
    /// The measured rows do not belong to these readings.
    #[error(transparent)]
    Rows(#[from] MeasuredRowsError),
    /// The images could not be uploaded.
    #[error(transparent)]
    Upload(#[from] OmpError),
    /// A network gave NaN.
    #[error("the networks gave NaN for image {image}")]
    NotANumber {
        /// Index of the image.
        image: usize,
    },
    /// The GPU or its driver failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The weights belong to another network.
    #[error(transparent)]
    Weights(#[from] WeightsError),
}

/// Both stages for images on a GPU, input 32 x 32 and output 64 x 64, with one step of the bridge.
///
/// Nothing comes to the host between the images and the results. Where a device has too little
/// memory for the kernel of the last step, agreement with the readings, that step runs on the host
/// ([`Note::AgreementOnCpu`](crate::Note)).
pub struct DeviceEnhancer {
    chain: Chain,
    backend: Backend,
    /// The same device, for uploads.
    uploads: gpu::Device,
    batch: usize,
}

impl DeviceEnhancer {
    /// An enhancer with the weights of its three networks (models `fsrcnn`, `estimator`, and
    /// `diffusion` or `gan`).
    ///
    /// # Errors
    /// [`DeviceEnhancerError`] if `device` is not a GPU, or weights belong to another network.
    pub fn new(
        device: &Device,
        fsrcnn: &Weights,
        estimator: &Weights,
        bridge: &Weights,
    ) -> Result<Self, DeviceEnhancerError> {
        let engine = device.engine().ok_or(DeviceEnhancerError::NoGpu)?;
        let chain = Chain::new(device, &engine, [fsrcnn, estimator, bridge])?;
        let backend = device.backend();
        let uploads = device.uploads().ok_or(DeviceEnhancerError::NoGpu)?;
        Ok(Self { chain, backend, uploads, batch: device.batch() })
    }

    /// Uploads images of 32 x 32, values in [0, 1], and enhances them; otherwise as
    /// [`enhance`](Self::enhance). Images beyond the device's largest buffer are uploaded in parts.
    pub(super) fn enhance_values(
        &self,
        values: &[f32],
        depth: Option<&DepthMaps>,
        options: &Options,
        progress: &mut dyn FnMut(usize),
    ) -> Result<Enhanced, DeviceEnhancerError> {
        const AREA: usize = fusion::SIDE * fusion::SIDE;
        let mut all = Enhanced::default();
        for (index, part) in values.chunks(UPLOADED * AREA).enumerate() {
            let images = DeviceImages::upload(&self.uploads, part, AREA)?;
            let (first, count) = (index * UPLOADED, part.len() / AREA);
            let depth = depth.map(|depth| depth.of(first, count));
            let mut told = |done| progress(first + done);
            all.append(self.enhance(&images, 1.0, depth.as_ref(), options, &mut told)?);
        }
        Ok(all)
    }

    /// Enhances images on the networks' device, with their depth maps. Values are divided by
    /// `white` and clamped to [0, 1]; `progress` gets the number of finished images.
    ///
    /// # Errors
    /// [`DeviceEnhancerError`] if the images have another size or are on another device, `white` is
    /// not positive and finite, or copies are requested.
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
        options.measured.expect_side(fusion::SIDE)?;
        if options.copies > 0 {
            return Err(DeviceEnhancerError::Copies);
        }
        let batches: Vec<_> = (0..images.frames())
            .step_by(self.batch)
            .map(|first| first..images.frames().min(first + self.batch))
            .collect();
        let run = |part: &Range<usize>| {
            let mut planes = Vec::new();
            if depth.is_some() {
                planes.reserve(2 * part.len() * images.pixels());
                part.clone().for_each(|image| push_planes(depth, image, &mut planes));
            }
            let guess = self.chain.run(images, part.clone(), white, &planes, options)?;
            finished(guess, part.start, options)
        };
        let mut all = Enhanced::default();
        for together in batches.chunks(AT_A_TIME) {
            let done: Vec<_> = together.par_iter().map(run).collect();
            for enhanced in done {
                all.append(enhanced?);
                progress(all.estimates.len());
            }
        }
        Ok(all)
    }
}

/// The results, with the agreement that a device without room for its kernel leaves to the host.
/// `first` is the index of the first image.
fn finished(
    guess: Guess,
    first: usize,
    options: &Options,
) -> Result<Enhanced, DeviceEnhancerError> {
    let Guess { estimated, start, mut images, mut inconsistency, readings } = guess;
    let estimates = super::known(options, &estimated);
    if !readings.is_empty() {
        let constraint = constraint_on(&readings, &estimates, options)?;
        constraint.correct(&mut images);
        inconsistency = constraint.residual_ratios(&images);
    }
    if let Some(at) = inconsistency.iter().position(|&ratio| ratio.is_nan() || ratio == BROKEN) {
        return Err(DeviceEnhancerError::NotANumber { image: first + at });
    }
    Ok(Enhanced {
        images,
        upscaled: Some(start),
        estimates,
        estimated: Some(estimated),
        inconsistency,
        spread: None,
    })
}

#[cfg(test)]
mod tests;
