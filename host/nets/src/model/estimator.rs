//! The estimator as a burn module: blur and noise of an image, from the image itself.

use burn::module::Module;
use burn::nn::Linear;
use burn::nn::conv::Conv2d;
use burn::tensor::Tensor;
use burn::tensor::activation::{relu, softplus};
use burn::tensor::backend::Backend;

use super::{convolution, linear, pooled};
use crate::cpu::estimator::{LOG_FLOOR, LOG_OFFSET};
use crate::schema;
use crate::weights::{Weights, WeightsError};

/// Sizes of an [`Estimator`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EstimatorConfig {
    /// Channels after each convolution.
    pub channels: [usize; 4],
    /// Width of the layer before the two outputs.
    pub hidden: usize,
}

impl Default for EstimatorConfig {
    fn default() -> Self {
        Self { channels: [16, 32, 48, 64], hidden: 64 }
    }
}

impl EstimatorConfig {
    /// The sizes of the network with these weights.
    ///
    /// # Errors
    /// [`WeightsError`] if the weights belong to another network.
    pub fn of(weights: &Weights) -> Result<Self, WeightsError> {
        let widths = schema::estimator(weights)?;
        Ok(Self { channels: [widths[0], widths[1], widths[2], widths[3]], hidden: widths[4] })
    }

    /// A network with PyTorch's initial weights.
    pub fn init<B: Backend>(&self, device: &B::Device) -> Estimator<B> {
        let [c1, c2, c3, c4] = self.channels;
        Estimator {
            conv1: convolution([1, c1], 3, 1, 1, 1.0, device),
            conv2: convolution([c1, c2], 3, 2, 1, 1.0, device),
            conv3: convolution([c2, c3], 3, 2, 1, 1.0, device),
            conv4: convolution([c3, c4], 3, 2, 1, 1.0, device),
            fc1: linear(c4, self.hidden, device),
            fc2: linear(self.hidden, 2, device),
        }
    }
}

/// The network; see the module's documentation.
#[derive(Module, Debug)]
pub struct Estimator<B: Backend> {
    conv1: Conv2d<B>,
    conv2: Conv2d<B>,
    conv3: Conv2d<B>,
    conv4: Conv2d<B>,
    fc1: Linear<B>,
    fc2: Linear<B>,
}

impl<B: Backend> Estimator<B> {
    /// The outputs (N, 2) for images (N, 1, H, W) in [0, 1]: a fourth of the blur's standard
    /// deviation in pixels of the images' grid, and ten times the noise's standard deviation.
    pub fn forward(&self, images: Tensor<B, 4>) -> Tensor<B, 2> {
        let h = [&self.conv1, &self.conv2, &self.conv3, &self.conv4]
            .into_iter()
            .fold(images, |h, convolution| relu(convolution.forward(h)));
        // Noise is a small signal among large ones; the logarithm makes both equally visible.
        let features = (pooled(h) + LOG_FLOOR).log() + LOG_OFFSET;
        softplus(self.fc2.forward(relu(self.fc1.forward(features))), 1.0)
    }
}
