//! FSRCNN (Dong, Loy, Tang, ECCV 2016) as a burn module, with the depth map as second input: twice
//! the side.

use burn::module::Module;
use burn::nn::conv::{Conv2d, ConvTranspose2d, ConvTranspose2dConfig};
use burn::nn::{PRelu, PReluConfig};
use burn::tensor::Tensor;
use burn::tensor::backend::Backend;

use super::{convolution, nearest, uniform};
use crate::schema;
use crate::weights::{Weights, WeightsError};

/// Input channels: intensity, depth, validity of the depth.
const INPUTS: usize = 3;

/// Sizes of an [`Fsrcnn`]: d, s and m of its paper.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FsrcnnConfig {
    /// Channels of the features.
    pub features: usize,
    /// Channels after shrinking.
    pub shrunk: usize,
    /// Layers between shrinking and expanding.
    pub mappings: usize,
}

impl Default for FsrcnnConfig {
    fn default() -> Self {
        Self { features: 48, shrunk: 12, mappings: 4 }
    }
}

impl FsrcnnConfig {
    /// The sizes of the network with these weights.
    ///
    /// # Errors
    /// [`WeightsError`] if the weights belong to another network.
    pub fn of(weights: &Weights) -> Result<Self, WeightsError> {
        let [features, shrunk, mappings] = schema::fsrcnn(weights)?;
        Ok(Self { features, shrunk, mappings })
    }

    /// A network with PyTorch's initial weights.
    pub fn init<B: Backend>(&self, device: &B::Device) -> Fsrcnn<B> {
        let Self { features, shrunk, mappings } = *self;
        let slopes = |channels| PReluConfig::new().with_num_parameters(channels).init(device);
        Fsrcnn {
            feature: convolution([INPUTS, features], 5, 1, 2, 1.0, device),
            feature_act: slopes(features),
            shrink: convolution([features, shrunk], 1, 1, 0, 1.0, device),
            shrink_act: slopes(shrunk),
            map: (0..mappings)
                .map(|_| convolution([shrunk, shrunk], 3, 1, 1, 1.0, device))
                .collect(),
            map_act: (0..mappings).map(|_| slopes(shrunk)).collect(),
            expand: convolution([shrunk, features], 1, 1, 0, 1.0, device),
            expand_act: slopes(features),
            deconv: ConvTranspose2dConfig::new([features, 1], [9, 9])
                .with_stride([2, 2])
                .with_padding([4, 4])
                .with_padding_out([1, 1])
                .with_initializer(uniform(0.05))
                .init(device),
        }
    }
}

/// The network; see the module's documentation.
#[derive(Module, Debug)]
pub struct Fsrcnn<B: Backend> {
    feature: Conv2d<B>,
    feature_act: PRelu<B>,
    shrink: Conv2d<B>,
    shrink_act: PRelu<B>,
    map: Vec<Conv2d<B>>,
    map_act: Vec<PRelu<B>>,
    expand: Conv2d<B>,
    expand_act: PRelu<B>,
    deconv: ConvTranspose2d<B>,
}

impl<B: Backend> Fsrcnn<B> {
    /// The image (N, 1, 2 H, 2 W), not clamped, from (N, 3, H, W): intensity in [0, 1], depth over
    /// 3 m, and validity of the depth.
    pub fn forward(&self, input: Tensor<B, 4>) -> Tensor<B, 4> {
        let nearest = nearest(input.clone().narrow(1, 0, 1));
        let mut h = self.feature_act.forward(self.feature.forward(input));
        h = self.shrink_act.forward(self.shrink.forward(h));
        for (layer, act) in self.map.iter().zip(&self.map_act) {
            h = act.forward(layer.forward(h));
        }
        h = self.expand_act.forward(self.expand.forward(h));
        nearest + self.deconv.forward(h)
    }
}
