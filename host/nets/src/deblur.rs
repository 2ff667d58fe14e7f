//! Deblurs by a network in one of three ways: the bridge (recommended), the ancestral sampler (the
//! paper's diffusion) and the GAN's generator (the paper's other baseline). [`Sharpen`] puts
//! another network on the bridge.
//!
//! # Invariant
//! The result for an image depends on the image, its options and its index, and never on the other
//! images of a batch (`enhance::tests::an_image_is_enhanced_alike_alone_and_among_others`,
//! `ancestral::tests::a_sample_is_of_the_image_not_of_its_batch`).

mod ancestral;
mod bridge;
mod constraint;
mod model;
mod sharpen;

use std::num::NonZeroU32;

use crate::device::Device;
use crate::estimate::Estimate;
use crate::grid::{self, AREA};
use crate::network::RunUNet;
use crate::weights::{Weights, WeightsError};

pub use ancestral::Schedule;
pub(crate) use constraint::DataConstraint;
use model::PathKind;
pub use model::{Method, MethodError, Model};
use sharpen::Residual;
pub use sharpen::{Blurred, Sharpen, SharpenError};

/// Side of the images.
pub const SIDE: usize = grid::FINE;

/// A batch of images to deblur.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Job<'a> {
    /// (N, 64, 64): the start of the path, as blurred as the readings.
    pub(crate) start: &'a [f32],
    /// (N, 64, 64): the readings; each pixel of 32 x 32 readings is repeated.
    pub(crate) seen: &'a [f32],
    pub(crate) estimates: &'a [Estimate],
    pub(crate) seed: u64,
    /// Index of the first image.
    pub(crate) first: usize,
}

/// A network that deblurs.
pub struct Deblurrer {
    path: Path,
    batch: usize,
}

enum Path {
    Bridge { network: Box<dyn Sharpen>, steps: NonZeroU32 },
    Ancestral { network: Box<dyn RunUNet>, schedule: Schedule, steps: NonZeroU32 },
}

impl Deblurrer {
    /// The network with these weights, used by `method`.
    ///
    /// # Errors
    /// [`WeightsError`] if the weights belong to another network.
    pub fn new(device: &Device, weights: &Weights, method: Method) -> Result<Self, WeightsError> {
        weights.expect_model(method.model().name())?;
        let (unet, batch, steps) = (device.unet(weights)?, device.batch(), method.steps());
        Ok(match method.model().path() {
            PathKind::Bridge => Self::own(Box::new(Residual { unet, batch }), steps),
            PathKind::Ancestral => {
                let schedule = Schedule::of(weights)?;
                Self { path: Path::Ancestral { network: unet, schedule, steps }, batch }
            }
        })
    }

    /// Your own network on the bridge, with this number of steps.
    pub fn own(network: Box<dyn Sharpen>, steps: NonZeroU32) -> Self {
        let batch = network.batch().max(1);
        Self { path: Path::Bridge { network, steps }, batch }
    }

    /// Number of images that keep the network's device busy.
    pub(crate) fn batch(&self) -> usize {
        self.batch
    }

    /// The sharp images, (N, 64, 64) in [0, 1].
    ///
    /// # Errors
    /// [`SharpenError`] if the output of a network on the bridge is refused.
    pub(crate) fn run(
        &self,
        job: &Job<'_>,
        constraint: &DataConstraint<'_>,
    ) -> Result<Vec<f32>, SharpenError> {
        match &self.path {
            Path::Bridge { network, steps } => bridge::run(&**network, *steps, job, constraint),
            Path::Ancestral { network, schedule, steps } => {
                Ok(ancestral::run(&**network, schedule, *steps, job, constraint))
            }
        }
    }
}
