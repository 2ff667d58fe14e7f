//! The learner of each model, on the device that trains it.

use super::adversarial::Adversarial;
use super::solo::Solo;
use super::tasks::{Ancestral, Bridge, Classify, Fuse, Measure};
use super::trained::Learner;
use super::{Model, Settings, TrainError};
use crate::device::{Device, Kind};
use burn::backend::{Autodiff, Flex};
use burn::tensor::backend::AutodiffBackend;
#[cfg(all(feature = "gpu", not(test)))]
use nirspi_gpu::Gpu;

/// The learner of a model on a device, with its initial weights.
pub(super) fn new(settings: &Settings, device: &Device) -> Result<Box<dyn Learner>, TrainError> {
    match &device.kind {
        Kind::Cpu => on::<Autodiff<Flex>>(settings, Default::default()),
        #[cfg(all(feature = "wgpu", not(test)))]
        Kind::Gpu(Gpu::Wgpu(gpu)) => {
            on::<Autodiff<burn::backend::Wgpu>>(settings, gpu.device.clone())
        }
        #[cfg(all(feature = "gpu", not(test)))]
        Kind::Gpu(Gpu::Cuda(gpu)) => {
            on::<Autodiff<burn::backend::Cuda>>(settings, gpu.device.clone())
        }
        // Training on GPUs takes minutes to compile, so unit tests train on the CPU. A program may
        // have given the feature wgpu to nirspi-gpu alone.
        #[cfg(feature = "gpu")]
        Kind::Gpu(_) => Err(TrainError::Setting {
            name: "device",
            found: device.name().to_owned(),
            expected: "a device that this build can train on, such as the CPU",
        }),
    }
}

fn on<B: AutodiffBackend>(
    settings: &Settings,
    device: B::Device,
) -> Result<Box<dyn Learner>, TrainError> {
    Ok(match settings.model {
        Model::Fsrcnn => Box::new(Solo::<B, Fuse>::new(settings, device)?),
        Model::Diffusion => Box::new(Solo::<B, Bridge>::new(settings, device)?),
        Model::Ancestral => Box::new(Solo::<B, Ancestral>::new(settings, device)?),
        Model::Estimator => Box::new(Solo::<B, Measure>::new(settings, device)?),
        Model::Classifier => Box::new(Solo::<B, Classify>::new(settings, device)?),
        Model::Gan => Box::new(Adversarial::<B>::new(settings, device)?),
    })
}
