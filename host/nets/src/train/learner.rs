//! The learner of each model, on the device that trains it.

use super::adversarial::Adversarial;
use super::solo::Solo;
use super::tasks::{Ancestral, Bridge, Classify, Fuse, Measure};
use super::trained::Learner;
use super::{Model, Settings, TrainError};
use crate::device::{Device, Kind};
use burn::backend::{Autodiff, Flex};
use burn::tensor::backend::AutodiffBackend;

/// The learner of a model on a device, with its initial weights.
pub(super) fn new(settings: &Settings, device: &Device) -> Result<Box<dyn Learner>, TrainError> {
    match &device.kind {
        Kind::Cpu => on::<Autodiff<Flex>>(settings, Default::default()),
        #[cfg(all(feature = "wgpu", not(test)))]
        Kind::Wgpu(device) => on::<Autodiff<burn::backend::Wgpu>>(settings, device.clone()),
        #[cfg(all(feature = "gpu", not(test)))]
        Kind::Cuda(device) => on::<Autodiff<burn::backend::Cuda>>(settings, device.clone()),
        // Training on GPUs takes minutes to compile, so unit tests train on the CPU.
        #[cfg(all(feature = "gpu", test))]
        _ => Err(TrainError::Setting {
            name: "device",
            found: device.name().to_owned(),
            expected: "the CPU, in the library's own tests",
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
