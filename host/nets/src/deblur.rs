//! Deblurring by a network, three ways that share one interface: the bridge (to be used), the ancestral
//! sampler (the faithful baseline) and the GAN's generator (the paper's other baseline).
//!
//! Law: an image's result depends on itself, its options and its index, never on its neighbours in a batch.

mod ancestral;
mod bridge;
mod step;

use std::num::NonZeroU32;

use crate::consistency::MeasuredRows;
use crate::device::Device;
use crate::estimate::Estimate;
use crate::network::RunUNet;
use crate::weights::{Weights, WeightsError};

pub use ancestral::Schedule;
pub(crate) use step::Truth;

/// Side of the images.
pub const SIDE: usize = 64;

pub(crate) const AREA: usize = SIDE * SIDE;

/// Which network deblurs, and how it is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// The bridge from the degraded image to the sharp one (model `diffusion`), in so many steps.
    Diffusion {
        /// 1 to 4 are the useful range.
        steps: NonZeroU32,
    },
    /// The ancestral sampler (model `ancestral`), in so many of its 500 steps.
    Ancestral {
        /// 1 to 500.
        steps: NonZeroU32,
    },
    /// The GAN's generator (model `gan`), in one step.
    Gan,
}

impl Method {
    /// The name of its weights.
    pub fn model(self) -> &'static str {
        match self {
            Self::Diffusion { .. } => "diffusion",
            Self::Ancestral { .. } => "ancestral",
            Self::Gan => "gan",
        }
    }

    /// Calls of the network for one image.
    pub fn steps(self) -> u32 {
        match self {
            Self::Diffusion { steps } | Self::Ancestral { steps } => steps.get(),
            Self::Gan => 1,
        }
    }
}

/// A batch of images to deblur.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Job<'a> {
    /// (N, 64, 64): where the path starts; as blurred as the readings.
    pub(crate) start: &'a [f32],
    /// (N, 64, 64): the readings themselves, each pixel repeated where they are 32 x 32.
    pub(crate) seen: &'a [f32],
    /// (N, side, side): the readings.
    pub(crate) readings: &'a [f32],
    pub(crate) readings_side: usize,
    pub(crate) estimates: &'a [Estimate],
    /// Hadamard rows behind the readings, if not all; checked before.
    pub(crate) measured: Option<&'a MeasuredRows>,
    /// Shall each step agree with the readings?
    pub(crate) consistency: bool,
    pub(crate) seed: u64,
    /// Index of the first image.
    pub(crate) first: usize,
}

/// A network that deblurs.
pub struct Deblurrer {
    network: Box<dyn RunUNet>,
    path: Path,
    batch: usize,
}

enum Path {
    Bridge { steps: NonZeroU32 },
    Ancestral { schedule: Schedule, steps: NonZeroU32 },
}

impl Deblurrer {
    /// The network of these weights, used as `method` says.
    ///
    /// # Errors
    /// [`WeightsError`] if they are of another network.
    pub fn new(device: &Device, weights: &Weights, method: Method) -> Result<Self, WeightsError> {
        weights.expect_model(method.model())?;
        let path = match method {
            Method::Diffusion { steps } => Path::Bridge { steps },
            Method::Gan => Path::Bridge { steps: NonZeroU32::MIN },
            Method::Ancestral { steps } => {
                Path::Ancestral { schedule: Schedule::of(weights)?, steps }
            }
        };
        Ok(Self { network: device.unet(weights)?, path, batch: device.batch() })
    }

    /// How many images at once keep its device busy.
    pub(crate) fn batch(&self) -> usize {
        self.batch
    }

    /// The sharp images, (N, 64, 64) in [0, 1].
    pub(crate) fn run(&self, job: &Job<'_>) -> Vec<f32> {
        let truth = Truth::new(job);
        match &self.path {
            Path::Bridge { steps } => bridge::run(&*self.network, *steps, job, &truth),
            Path::Ancestral { schedule, steps } => {
                ancestral::run(&*self.network, schedule, *steps, job, &truth)
            }
        }
    }
}
