//! A network on some device, as the loop sees it.

use super::adversarial::Adversarial;
use super::examples::Batch;
use super::solo::Solo;
use super::tasks::{Ancestral, Bridge, Classify, Fuse, Measure};
use super::{Model, Settings, TrainError};
use crate::device::{Device, Kind};
use crate::weights::Weights;
use burn::backend::{Autodiff, Flex};
use burn::tensor::backend::AutodiffBackend;

/// A network with its optimiser and the running average of its weights.
pub(super) trait Learner {
    /// Learns from a batch; the loss.
    fn step(&mut self, batch: &Batch, step: u64, rate: f64) -> Result<f64, TrainError>;
    /// Sum of the scores of these examples, by the averaged weights.
    fn judge(&self, batch: &Batch) -> f64;
    /// The averaged weights.
    fn weights(&self) -> Weights;
    /// All that it is, `step` steps into its run.
    fn states(&self, step: u64) -> Result<Vec<Vec<u8>>, TrainError>;
    /// Becomes what `states` were taken of.
    fn restore(&mut self, states: &[Vec<u8>]) -> Result<(), TrainError>;
}

/// The learner of a model on a device, with its first weights.
pub(super) fn new(settings: &Settings, device: &Device) -> Result<Box<dyn Learner>, TrainError> {
    match &device.kind {
        Kind::Cpu => on::<Autodiff<Flex>>(settings, Default::default()),
        #[cfg(all(feature = "gpu", not(test)))]
        Kind::Wgpu(device) => on::<Autodiff<burn::backend::Wgpu>>(settings, device.clone()),
        #[cfg(all(feature = "gpu", not(test)))]
        Kind::Cuda(device) => on::<Autodiff<burn::backend::Cuda>>(settings, device.clone()),
        // Training on GPUs takes minutes to compile, and unit tests train on the CPU.
        #[cfg(all(feature = "gpu", test))]
        Kind::Wgpu(_) | Kind::Cuda(_) => Err(TrainError::Setting {
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
