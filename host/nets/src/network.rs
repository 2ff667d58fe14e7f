//! Networks where they run, behind one face a network: plain slices in, plain vectors out.
//!
//! Law: every device gives the same numbers, to 1e-4; nothing above this module knows which one computed.

use burn::backend::Flex;
#[cfg(feature = "gpu")]
use burn::backend::{Cuda, Wgpu};
use burn::module::Module;
use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorData};

use crate::device::{Device, Kind};
use crate::model::{
    CONDITIONS, Estimator, EstimatorConfig, Fsrcnn, FsrcnnConfig, UNet, UNetConfig, fill,
};
use crate::weights::{Weights, WeightsError};

/// Time (2), blur (2), noise (2).
pub(crate) type Conditions = [f32; CONDITIONS];

/// A [`UNet`] on a device.
pub(crate) trait RunUNet: Send {
    /// What the network says of each pair of images (N, `side`, `side`) under its conditions.
    fn run(
        &self,
        side: usize,
        current: &[f32],
        degraded: &[f32],
        conditions: &[Conditions],
    ) -> Vec<f32>;
}

/// An [`Estimator`] on a device.
pub(crate) trait RunEstimator: Send {
    /// The two outputs for each image of (N, `side`, `side`).
    fn run(&self, side: usize, images: &[f32]) -> Vec<[f32; 2]>;
}

/// An [`Fsrcnn`] on a device.
pub(crate) trait RunFsrcnn: Send {
    /// (N, 2 `side`, 2 `side`) of (N, 3, `side`, `side`), not clamped.
    fn run(&self, side: usize, input: &[f32]) -> Vec<f32>;
}

impl Device {
    pub(crate) fn unet(&self, weights: &Weights) -> Result<Box<dyn RunUNet>, WeightsError> {
        let config = UNetConfig::of(weights)?;
        Ok(match &self.kind {
            Kind::Cpu => {
                let device = Default::default();
                Box::new(place::<Flex, UNet<_>>(config.init(&device), weights, &device)?)
            }
            #[cfg(feature = "gpu")]
            Kind::Wgpu(device) => {
                Box::new(place::<Wgpu, UNet<_>>(config.init(device), weights, device)?)
            }
            #[cfg(feature = "gpu")]
            Kind::Cuda(device) => {
                Box::new(place::<Cuda, UNet<_>>(config.init(device), weights, device)?)
            }
        })
    }

    pub(crate) fn estimator(
        &self,
        weights: &Weights,
    ) -> Result<Box<dyn RunEstimator>, WeightsError> {
        let config = EstimatorConfig::of(weights)?;
        Ok(match &self.kind {
            Kind::Cpu => {
                let device = Default::default();
                Box::new(place::<Flex, Estimator<_>>(config.init(&device), weights, &device)?)
            }
            #[cfg(feature = "gpu")]
            Kind::Wgpu(device) => {
                Box::new(place::<Wgpu, Estimator<_>>(config.init(device), weights, device)?)
            }
            #[cfg(feature = "gpu")]
            Kind::Cuda(device) => {
                Box::new(place::<Cuda, Estimator<_>>(config.init(device), weights, device)?)
            }
        })
    }

    pub(crate) fn fsrcnn(&self, weights: &Weights) -> Result<Box<dyn RunFsrcnn>, WeightsError> {
        let config = FsrcnnConfig::of(weights)?;
        Ok(match &self.kind {
            Kind::Cpu => {
                let device = Default::default();
                Box::new(place::<Flex, Fsrcnn<_>>(config.init(&device), weights, &device)?)
            }
            #[cfg(feature = "gpu")]
            Kind::Wgpu(device) => {
                Box::new(place::<Wgpu, Fsrcnn<_>>(config.init(device), weights, device)?)
            }
            #[cfg(feature = "gpu")]
            Kind::Cuda(device) => {
                Box::new(place::<Cuda, Fsrcnn<_>>(config.init(device), weights, device)?)
            }
        })
    }
}

/// A burn module and the device that its weights are on.
struct OnBurn<B: Backend, M> {
    module: M,
    device: B::Device,
}

fn place<B: Backend, M: Module<B>>(
    module: M,
    weights: &Weights,
    device: &B::Device,
) -> Result<OnBurn<B, M>, WeightsError> {
    Ok(OnBurn { module: fill(module, weights)?, device: device.clone() })
}

impl<B: Backend, M> OnBurn<B, M> {
    fn tensor<const D: usize>(&self, shape: [usize; D], values: &[f32]) -> Tensor<B, D> {
        Tensor::from_data(TensorData::new(values.to_vec(), shape), &self.device)
    }

    fn images(&self, channels: usize, side: usize, values: &[f32]) -> Tensor<B, 4> {
        let count = values.len() / (channels * side * side);
        self.tensor([count, channels, side, side], values)
    }
}

fn values<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> Vec<f32> {
    tensor.into_data().iter::<f32>().collect()
}

impl<B: Backend> RunUNet for OnBurn<B, UNet<B>> {
    fn run(
        &self,
        side: usize,
        current: &[f32],
        degraded: &[f32],
        conditions: &[Conditions],
    ) -> Vec<f32> {
        let conditions = self.tensor([conditions.len(), CONDITIONS], conditions.as_flattened());
        values(self.module.forward(
            self.images(1, side, current),
            self.images(1, side, degraded),
            conditions,
        ))
    }
}

impl<B: Backend> RunEstimator for OnBurn<B, Estimator<B>> {
    fn run(&self, side: usize, images: &[f32]) -> Vec<[f32; 2]> {
        values(self.module.forward(self.images(1, side, images))).as_chunks().0.to_vec()
    }
}

impl<B: Backend> RunFsrcnn for OnBurn<B, Fsrcnn<B>> {
    fn run(&self, side: usize, input: &[f32]) -> Vec<f32> {
        values(self.module.forward(self.images(3, side, input)))
    }
}
