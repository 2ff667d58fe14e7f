//! Estimator, FSRCNN and UNet one after another on a GPU, for images that are already there.

use std::ops::Range;

use nirspi_gpu::GpuError;
use nirspi_recon::omp::gpu::DeviceImages;

use crate::device::Device;
use crate::enhance::Options;
use crate::estimate::Estimate;
use crate::gpu;
use crate::weights::{Weights, WeightsError};

/// The results for some images, on the host.
#[derive(Default)]
pub(crate) struct Guess {
    /// As the estimator found them.
    pub(crate) estimated: Vec<Estimate>,
    /// (N, 64, 64) in [0, 1]: FSRCNN's output.
    pub(crate) start: Vec<f32>,
    /// (N, 64, 64): the bridge's output after one step from `start`; not clamped if there are
    /// `readings`, else in agreement with them.
    pub(crate) images: Vec<f32>,
    /// The inconsistency of each image; none if there are `readings`.
    pub(crate) inconsistency: Vec<f32>,
    /// (N, 32, 32) in [0, 1], if the device could not compute the agreement with them.
    pub(crate) readings: Vec<f32>,
}

impl Guess {
    /// No results yet, and room for images with this number of pixels in all.
    pub(crate) fn with_capacity(pixels: usize) -> Self {
        let [start, images] = [(); 2].map(|()| Vec::with_capacity(pixels));
        Self { start, images, ..Self::default() }
    }
}

/// The three networks and the agreement with the readings on one GPU.
pub(crate) trait RunChain: Send + Sync {
    /// The results for some of the images, with `white` scaled to 1. Fails if the GPU or its driver
    /// fails. `depth` is (N, 2, 32, 32), see
    /// [`push_planes`](crate::fusion::push_planes); `None` without depth.
    fn run(
        &self,
        images: &DeviceImages,
        part: Range<usize>,
        white: f32,
        depth: &[f32],
        options: &Options,
    ) -> Result<Guess, GpuError>;
}

impl Device {
    /// The networks with these weights on this device's GPU; `None` on the processor.
    pub(crate) fn chain(
        &self,
        fsrcnn: &Weights,
        estimator: &Weights,
        bridge: &Weights,
    ) -> Result<Option<Box<dyn RunChain>>, WeightsError> {
        let Some(engine) = self.engine() else { return Ok(None) };
        Ok(Some(Box::new(gpu::Chain::new(self, &engine, [fsrcnn, estimator, bridge])?)))
    }
}
