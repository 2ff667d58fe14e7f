//! The GAN's discriminator: judges patch by patch whether an image is the sharp image of a degraded
//! one (PatchGAN; Isola et al., CVPR 2017).

use burn::module::Module;
use burn::nn::conv::Conv2d;
use burn::tensor::Tensor;
use burn::tensor::activation::leaky_relu;
use burn::tensor::backend::Backend;

use super::convolution;
use crate::schema;
use crate::weights::{Weights, WeightsError};

/// Sizes of a [`Discriminator`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DiscriminatorConfig {
    /// Channels after each convolution except the last.
    pub channels: [usize; 3],
}

impl Default for DiscriminatorConfig {
    fn default() -> Self {
        Self { channels: [32, 64, 128] }
    }
}

impl DiscriminatorConfig {
    /// The sizes of the network with these weights.
    ///
    /// # Errors
    /// [`WeightsError`] if the weights belong to another network.
    pub fn of(weights: &Weights) -> Result<Self, WeightsError> {
        let widths = schema::discriminator(weights)?;
        Ok(Self { channels: [widths[0], widths[1], widths[2]] })
    }

    /// A network with PyTorch's initial weights.
    pub fn init<B: Backend>(&self, device: &B::Device) -> Discriminator<B> {
        let [c1, c2, c3] = self.channels;
        Discriminator {
            conv1: convolution([2, c1], 4, 2, 1, 1.0, device),
            conv2: convolution([c1, c2], 4, 2, 1, 1.0, device),
            conv3: convolution([c2, c3], 4, 2, 1, 1.0, device),
            conv4: convolution([c3, 1], 3, 1, 1, 1.0, device),
        }
    }
}

/// The network; see the module's documentation.
#[derive(Module, Debug)]
pub struct Discriminator<B: Backend> {
    conv1: Conv2d<B>,
    conv2: Conv2d<B>,
    conv3: Conv2d<B>,
    conv4: Conv2d<B>,
}

impl<B: Backend> Discriminator<B> {
    /// Logits (N, 1, H / 8, W / 8), one for each patch, of pairs of images (N, 1, H, W).
    pub fn forward(&self, degraded: Tensor<B, 4>, image: Tensor<B, 4>) -> Tensor<B, 4> {
        let h = [&self.conv1, &self.conv2, &self.conv3]
            .into_iter()
            .fold(Tensor::cat(vec![degraded, image], 1), |h, layer| {
                leaky_relu(layer.forward(h), 0.2)
            });
        self.conv4.forward(h)
    }
}
