//! Networks as burn has them, on a GPU.

use burn::module::Module;
use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorData};

use super::{Conditions, RunEstimator, RunFsrcnn, RunUNet};
use crate::model::{CONDITIONS, Estimator, Fsrcnn, UNet, fill};
use crate::weights::{Weights, WeightsError};

/// A burn module and the device that its weights are on.
pub(super) struct OnBurn<B: Backend, M> {
    pub(super) module: M,
    pub(super) device: B::Device,
}

/// Puts weights into a module.
pub(super) fn place<B: Backend, M: Module<B>>(
    module: M,
    weights: &Weights,
    device: &B::Device,
) -> Result<OnBurn<B, M>, WeightsError> {
    Ok(OnBurn { module: fill(module, weights)?, device: device.clone() })
}

impl<B: Backend, M> OnBurn<B, M> {
    pub(super) fn tensor<const D: usize>(&self, shape: [usize; D], values: &[f32]) -> Tensor<B, D> {
        Tensor::from_data(TensorData::new(values.to_vec(), shape), &self.device)
    }

    pub(super) fn images(&self, channels: usize, side: usize, values: &[f32]) -> Tensor<B, 4> {
        let count = values.len() / (channels * side * side);
        self.tensor([count, channels, side, side], values)
    }
}

pub(super) fn values<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> Vec<f32> {
    tensor.into_data().into_vec().unwrap_or_else(|data| unreachable!("{data:?} of f32"))
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
