//! Deblurring by a network in one of three ways: the bridge (the one to use), the ancestral sampler (the faithful
//! baseline) and the GAN's generator (the paper's other baseline). [`Sharpen`] puts another network on the bridge.
//!
//! # Invariant
//! An image's result depends on the image, its options and its index, never on the other images of a batch
//! (`an_image_is_enhanced_alike_alone_and_among_others`, `a_sample_is_of_the_image_not_of_its_batch`).

mod ancestral;
mod bridge;
mod constraint;
mod sharpen;

use std::num::NonZeroU32;

use crate::device::Device;
use crate::estimate::Estimate;
use crate::network::RunUNet;
use crate::weights::{Weights, WeightsError};

pub use ancestral::Schedule;
pub(crate) use constraint::DataConstraint;
use sharpen::Residual;
pub use sharpen::{Blurred, Sharpen, SharpenError};

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
    /// The network of these weights, used as `method` says.
    ///
    /// # Errors
    /// [`WeightsError`] if they are of another network.
    pub fn new(device: &Device, weights: &Weights, method: Method) -> Result<Self, WeightsError> {
        weights.expect_model(method.model())?;
        let (unet, batch) = (device.unet(weights)?, device.batch());
        Ok(match method {
            Method::Diffusion { steps } => Self::own(Box::new(Residual { unet, batch }), steps),
            Method::Gan => Self::own(Box::new(Residual { unet, batch }), NonZeroU32::MIN),
            Method::Ancestral { steps } => {
                let schedule = Schedule::of(weights)?;
                Self { path: Path::Ancestral { network: unet, schedule, steps }, batch }
            }
        })
    }

    /// A network of your own on the bridge, in so many steps.
    pub fn own(network: Box<dyn Sharpen>, steps: NonZeroU32) -> Self {
        let batch = network.batch().max(1);
        Self { path: Path::Bridge { network, steps }, batch }
    }

    /// How many images at once keep its device busy.
    pub(crate) fn batch(&self) -> usize {
        self.batch
    }

    /// The sharp images, (N, 64, 64) in [0, 1].
    ///
    /// # Errors
    /// [`SharpenError`] if the network of a bridge gives no images.
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
