//! Both stages for images that OMP has left on a GPU.
//!
//! # Invariant
//! The results are those of [`Enhancer`](super::Enhancer) for the same images, to within the
//! rounding of single precision
//! (`tests::images_that_are_there_become_what_the_processor_makes_of_them`).

mod chain;

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use nirspi_gpu::GpuError;
use nirspi_gpu::agreement::BROKEN;
use nirspi_recon::omp::gpu::DeviceImages;
use thiserror::Error;

use super::{AREA, Enhanced, Options, constraint_on};
use crate::consistency::MeasuredRowsError;
use crate::device::{Backend, Device};
use crate::estimate::Estimate;
use crate::fusion::{self, DepthMaps, push_planes};
use crate::weights::{Weights, WeightsError};
use chain::{Chain, Room, Source};

/// Number of batches that are under way at a time, each on a thread and a stream of its own: while
/// the results of one are copied, another one is computed.
const AT_A_TIME: usize = 2;

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
        Ok(Self { chain, backend: device.backend(), batch: device.batch() })
    }

    /// Enhances images of 32 x 32 that are in the host's memory, values in [0, 1]; otherwise as
    /// [`enhance`](Self::enhance).
    pub(super) fn enhance_values(
        &self,
        values: &[f32],
        depth: Option<&DepthMaps>,
        options: &Options,
        progress: &mut dyn FnMut(usize),
    ) -> Result<Enhanced, DeviceEnhancerError> {
        self.enhance_all(Source::Here(values), 1.0, depth, options, progress)
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
        self.enhance_all(Source::There(images), white, depth, options, progress)
    }

    /// Enhances all images, [`AT_A_TIME`] batches at a time.
    ///
    /// Each result is copied once, from the driver's memory to its place among all results, by the
    /// thread of its batch: memory that was never written takes longer than the networks.
    fn enhance_all(
        &self,
        images: Source<'_>,
        white: f32,
        depth: Option<&DepthMaps>,
        options: &Options,
        progress: &mut dyn FnMut(usize),
    ) -> Result<Enhanced, DeviceEnhancerError> {
        let frames = images.frames();
        let unknown = Estimate { sigma_px: f32::NAN, noise: f32::NAN };
        let mut estimated = vec![unknown; frames];
        let [mut start, mut sharp] = [(); 2].map(|()| vec![0.0; frames * AREA]);
        let mut inconsistency = vec![0.0; frames];
        let room = Room {
            estimated: &mut estimated,
            start: &mut start,
            images: &mut sharp,
            inconsistency: &mut inconsistency,
        };
        let queue = Mutex::new(Queue { first: 0, room });
        let done = AtomicUsize::new(0);
        let work = |progress: &mut dyn FnMut(usize)| -> Result<(), DeviceEnhancerError> {
            loop {
                let next = lock(&queue).next(self.batch);
                let Some((first, room)) = next else { return Ok(()) };
                let frames = room.frames();
                self.batch(images, (first, white), depth, options, room)
                    .inspect_err(|_| lock(&queue).room = Room::default())?;
                progress(done.fetch_add(frames, Ordering::Relaxed) + frames);
            }
        };
        let mut others = [const { Ok(()) }; AT_A_TIME - 1];
        let mut mine = Ok(());
        // The caller's thread takes batches too, so that no pool is too small.
        rayon::in_place_scope(|scope| {
            for other in &mut others {
                scope.spawn(|_| *other = work(&mut |_| {}));
            }
            mine = work(progress);
        });
        mine?;
        others.into_iter().collect::<Result<(), _>>()?;
        progress(frames);
        Ok(Enhanced {
            images: sharp,
            upscaled: Some(start),
            estimates: super::known(options, &estimated),
            estimated: Some(estimated),
            inconsistency,
            spread: None,
        })
    }

    /// Computes the results for the images from number `first` on into `room`.
    fn batch(
        &self,
        images: Source<'_>,
        (first, white): (usize, f32),
        depth: Option<&DepthMaps>,
        options: &Options,
        mut room: Room<'_>,
    ) -> Result<(), DeviceEnhancerError> {
        let frames = room.frames();
        let mut planes = Vec::new();
        if depth.is_some() {
            planes.reserve(frames * 2 * fusion::SIDE * fusion::SIDE);
            (first..first + frames).for_each(|image| push_planes(depth, image, &mut planes));
        }
        let readings = self.chain.run(images, (first, white), &planes, options, room.reborrow())?;
        if !readings.is_empty() {
            // The agreement that a device without memory for its kernel leaves to the host.
            let estimates = super::known(options, room.estimated);
            let constraint = constraint_on(&readings, &estimates, options)?;
            constraint.correct(room.images);
            room.inconsistency.copy_from_slice(&constraint.residual_ratios(room.images));
        }
        let broken = |&ratio: &f32| ratio.is_nan() || ratio == BROKEN;
        match room.inconsistency.iter().position(broken) {
            Some(at) => Err(DeviceEnhancerError::NotANumber { image: first + at }),
            None => Ok(()),
        }
    }
}

fn lock<'a, 'b>(queue: &'a Mutex<Queue<'b>>) -> MutexGuard<'a, Queue<'b>> {
    queue.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The images that no thread has taken yet.
struct Queue<'a> {
    /// Number of the first of them.
    first: usize,
    room: Room<'a>,
}

impl<'a> Queue<'a> {
    /// Takes the next batch: the number of its first image, and where its results go.
    fn next(&mut self, batch: usize) -> Option<(usize, Room<'a>)> {
        let room = self.room.take(batch.min(self.room.frames()));
        let first = self.first;
        self.first += room.frames();
        (room.frames() > 0).then_some((first, room))
    }
}

#[cfg(test)]
mod tests;
