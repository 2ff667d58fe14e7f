//! The networks as burn modules, generic over the backend, for training.
//!
//! # Invariant
//! With the same weights each network gives the results of its PyTorch version
//! (`nirspi.train.networks`) to within 1e-4 (`tests::the_unet_gives_what_pytorch_gives`
//! and its neighbours). Names of parameters are PyTorch's, sizes are read from the weights, and
//! tensors are N, C, H, W.

mod classifier;
mod discriminator;
mod estimator;
mod fsrcnn;
mod transfer;
mod unet;

#[cfg(test)]
mod tests;

use burn::nn::PaddingConfig2d;
use burn::nn::conv::{Conv2d, Conv2dConfig};
use burn::nn::{Initializer, Linear, LinearConfig};
use burn::tensor::Tensor;
use burn::tensor::backend::Backend;

pub use crate::network::CONDITIONS;
pub use classifier::{Classifier, ClassifierConfig};
pub use discriminator::{Discriminator, DiscriminatorConfig};
pub use estimator::{Estimator, EstimatorConfig};
pub use fsrcnn::{Fsrcnn, FsrcnnConfig};
pub use transfer::{fill, weights_of};
pub use unet::{Block, UNet, UNetConfig};

/// PyTorch's initial weights: uniform within 1 / sqrt(fan-in), times `gain`.
fn uniform(gain: f64) -> Initializer {
    Initializer::KaimingUniform { gain: gain / 3.0_f64.sqrt(), fan_out_only: false }
}

/// A convolution with bias that keeps (stride 1) or halves (stride 2) the size of the image.
fn convolution<B: Backend>(
    channels: [usize; 2],
    kernel: usize,
    stride: usize,
    padding: usize,
    gain: f64,
    device: &B::Device,
) -> Conv2d<B> {
    Conv2dConfig::new(channels, [kernel, kernel])
        .with_stride([stride, stride])
        .with_padding(PaddingConfig2d::Explicit(padding, padding, padding, padding))
        .with_initializer(uniform(gain))
        .init(device)
}

fn linear<B: Backend>(inputs: usize, outputs: usize, device: &B::Device) -> Linear<B> {
    LinearConfig::new(inputs, outputs).with_initializer(uniform(1.0)).init(device)
}

/// Space to depth: (N, C, 2 H, 2 W) to (N, 4 C, H, W), channel 4 c + 2 dy + dx.
fn unshuffle<B: Backend>(image: Tensor<B, 4>) -> Tensor<B, 4> {
    let [n, c, h, w] = image.dims();
    image.reshape([n, c, h / 2, 2, w / 2, 2]).permute([0, 1, 3, 5, 2, 4]).reshape([
        n,
        4 * c,
        h / 2,
        w / 2,
    ])
}

/// Depth to space, the inverse: (N, 4 C, H, W) to (N, C, 2 H, 2 W).
fn shuffle<B: Backend>(features: Tensor<B, 4>) -> Tensor<B, 4> {
    let [n, c, h, w] = features.dims();
    features.reshape([n, c / 4, 2, 2, h, w]).permute([0, 1, 4, 2, 5, 3]).reshape([
        n,
        c / 4,
        2 * h,
        2 * w,
    ])
}

/// Each pixel repeated twice in both directions: (N, 1, H, W) to (N, 1, 2 H, 2 W).
pub(crate) fn nearest<B: Backend>(image: Tensor<B, 4>) -> Tensor<B, 4> {
    // Four copies of a channel shuffle into the enlarged image.
    shuffle(image.repeat_dim(1, 4))
}

/// Mean over the image: (N, C, H, W) to (N, C).
fn pooled<B: Backend>(features: Tensor<B, 4>) -> Tensor<B, 2> {
    let [n, c, h, w] = features.dims();
    features.reshape([n, c, h * w]).mean_dim(2).reshape([n, c])
}
