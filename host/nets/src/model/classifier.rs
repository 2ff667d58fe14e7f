//! The classifier as a burn module: which of the 62 characters an image shows.

use burn::module::Module;
use burn::nn::Linear;
use burn::nn::conv::Conv2d;
use burn::tensor::Tensor;
use burn::tensor::activation::relu;
use burn::tensor::backend::Backend;

use super::{convolution, linear, pooled};
use crate::schema;
use crate::weights::{Weights, WeightsError};

/// Sizes of a [`Classifier`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClassifierConfig {
    /// Channels of each pair of convolutions.
    pub channels: [usize; 3],
    /// Number of classes.
    pub classes: usize,
}

impl Default for ClassifierConfig {
    fn default() -> Self {
        Self { channels: [32, 64, 128], classes: schema::CLASSES }
    }
}

impl ClassifierConfig {
    /// The sizes of the network with these weights.
    ///
    /// # Errors
    /// [`WeightsError`] if the weights belong to another network.
    pub fn of(weights: &Weights) -> Result<Self, WeightsError> {
        let widths = schema::classifier(weights)?;
        Ok(Self { channels: [widths[0], widths[1], widths[2]], classes: schema::CLASSES })
    }

    /// A network with PyTorch's initial weights.
    pub fn init<B: Backend>(&self, device: &B::Device) -> Classifier<B> {
        let [c1, c2, c3] = self.channels;
        Classifier {
            conv1: convolution([1, c1], 3, 2, 1, 1.0, device),
            conv2: convolution([c1, c1], 3, 1, 1, 1.0, device),
            conv3: convolution([c1, c2], 3, 2, 1, 1.0, device),
            conv4: convolution([c2, c2], 3, 1, 1, 1.0, device),
            conv5: convolution([c2, c3], 3, 2, 1, 1.0, device),
            conv6: convolution([c3, c3], 3, 1, 1, 1.0, device),
            fc: linear(c3, self.classes, device),
        }
    }
}

/// The network; see the module's documentation.
#[derive(Module, Debug)]
pub struct Classifier<B: Backend> {
    conv1: Conv2d<B>,
    conv2: Conv2d<B>,
    conv3: Conv2d<B>,
    conv4: Conv2d<B>,
    conv5: Conv2d<B>,
    conv6: Conv2d<B>,
    fc: Linear<B>,
}

impl<B: Backend> Classifier<B> {
    /// Features of images (N, 1, 64, 64) in [0, 1]: (N, number of features).
    pub fn features(&self, images: Tensor<B, 4>) -> Tensor<B, 2> {
        let layers = [&self.conv1, &self.conv2, &self.conv3, &self.conv4, &self.conv5, &self.conv6];
        pooled(layers.into_iter().fold(images, |h, layer| relu(layer.forward(h))))
    }

    /// Logits of the classes, (N, classes), for [`Self::features`].
    pub fn logits(&self, features: Tensor<B, 2>) -> Tensor<B, 2> {
        self.fc.forward(features)
    }

    /// Logits of the classes of images (N, 1, 64, 64): (N, classes).
    pub fn forward(&self, images: Tensor<B, 4>) -> Tensor<B, 2> {
        self.logits(self.features(images))
    }
}
