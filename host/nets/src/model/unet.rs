//! The UNet of the deblurrer, of the 500-step baseline and of the GAN's generator, as a burn
//! module.
//!
//! Input: two images of 2 H x 2 W, the current image of the path and the degraded one. Output: one
//! image of that size. All work is done at H x W and below, after a space-to-depth step, which
//! reduces the cost to a fourth. Each residual block gets the conditions (time, blur, noise) as a
//! scale and a shift of its channels (FiLM, Perez et al., AAAI 2018).

use burn::module::Module;
use burn::nn::conv::Conv2d;
use burn::nn::{Initializer, Linear, LinearConfig};
use burn::tensor::Tensor;
use burn::tensor::activation::silu;
use burn::tensor::backend::Backend;

use super::{convolution, linear, shuffle, unshuffle};
use crate::network::CONDITIONS;
use crate::schema::{self, UNetSizes};
use crate::weights::{Weights, WeightsError};

/// Sizes of a [`UNet`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UNetConfig {
    /// Channels of each level, the finest first.
    pub channels: Vec<usize>,
    /// Number of residual blocks of a level, on the way down and on the way up.
    pub blocks: usize,
    /// Length of the embedding of the conditions.
    pub embedding: usize,
}

/// The sizes of the shipped diffusion network.
impl Default for UNetConfig {
    fn default() -> Self {
        Self { channels: Self::SHIPPED_CHANNELS.to_vec(), blocks: 2, embedding: 64 }
    }
}

impl UNetConfig {
    /// Channels of the shipped diffusion network.
    pub const SHIPPED_CHANNELS: [usize; 3] = [48, 96, 192];

    /// Channels of the shipped baselines: GAN, ancestral sampler and regression.
    pub const BASELINE_CHANNELS: [usize; 3] = [32, 64, 128];

    /// The sizes of the network with these weights.
    ///
    /// # Errors
    /// [`WeightsError`] if the weights belong to another network.
    pub fn of(weights: &Weights) -> Result<Self, WeightsError> {
        let UNetSizes { channels, blocks, embedding } = schema::unet(weights)?;
        Ok(Self { channels, blocks, embedding })
    }

    /// A network with PyTorch's initial weights, its blocks near the identity.
    pub fn init<B: Backend>(&self, device: &B::Device) -> UNet<B> {
        let c = &self.channels;
        let blocks = |channels: usize| {
            (0..self.blocks).map(|_| Block::new(channels, self.embedding, device)).collect()
        };
        let steps = || c.iter().zip(&c[1..]);
        UNet {
            embed1: linear(CONDITIONS, self.embedding, device),
            embed2: linear(self.embedding, self.embedding, device),
            input_conv: convolution([8, c[0]], 3, 1, 1, 1.0, device),
            encoder: c.iter().map(|&channels| blocks(channels)).collect(),
            reduce: steps()
                .map(|(&fine, &coarse)| convolution([fine, coarse], 2, 2, 0, 1.0, device))
                .collect(),
            expand: steps()
                .map(|(&fine, &coarse)| convolution([coarse, 4 * fine], 1, 1, 0, 1.0, device))
                .collect(),
            decoder: c[..c.len() - 1].iter().map(|&channels| blocks(channels)).collect(),
            output_conv: convolution([c[0], 4], 3, 1, 1, 0.1, device),
        }
    }
}

/// The network; see the module's documentation.
#[derive(Module, Debug)]
pub struct UNet<B: Backend> {
    embed1: Linear<B>,
    embed2: Linear<B>,
    input_conv: Conv2d<B>,
    encoder: Vec<Vec<Block<B>>>,
    reduce: Vec<Conv2d<B>>,
    expand: Vec<Conv2d<B>>,
    decoder: Vec<Vec<Block<B>>>,
    output_conv: Conv2d<B>,
}

impl<B: Backend> UNet<B> {
    /// The network's output (N, 1, H, W) for `current` and `degraded`, both (N, 1, H, W) with H and
    /// W divisible by 2^levels, under `conditions` (N, [`CONDITIONS`]).
    pub fn forward(
        &self,
        current: Tensor<B, 4>,
        degraded: Tensor<B, 4>,
        conditions: Tensor<B, 2>,
    ) -> Tensor<B, 4> {
        let embedding = silu(self.embed2.forward(silu(self.embed1.forward(conditions))));
        let input = Tensor::cat(vec![unshuffle(current), unshuffle(degraded)], 1);
        let mut h = self.input_conv.forward(input);
        let mut skips = Vec::with_capacity(self.reduce.len());
        for (level, blocks) in self.encoder.iter().enumerate() {
            for block in blocks {
                h = block.forward(h, embedding.clone());
            }
            if let Some(reduce) = self.reduce.get(level) {
                skips.push(h.clone());
                h = reduce.forward(h);
            }
        }
        for ((expand, blocks), skip) in self.expand.iter().zip(&self.decoder).zip(skips).rev() {
            h = shuffle(expand.forward(h)) + skip;
            for block in blocks {
                h = block.forward(h, embedding.clone());
            }
        }
        shuffle(self.output_conv.forward(h))
    }
}

/// A residual block: convolution, scale and shift by the conditions, convolution.
#[derive(Module, Debug)]
pub struct Block<B: Backend> {
    conv1: Conv2d<B>,
    film: Linear<B>,
    conv2: Conv2d<B>,
}

impl<B: Backend> Block<B> {
    fn new(channels: usize, embedding: usize, device: &B::Device) -> Self {
        Self {
            conv1: convolution([channels, channels], 3, 1, 1, 1.0, device),
            film: LinearConfig::new(embedding, 2 * channels)
                .with_initializer(Initializer::Zeros)
                .init(device),
            conv2: convolution([channels, channels], 3, 1, 1, 0.3, device),
        }
    }

    fn forward(&self, x: Tensor<B, 4>, embedding: Tensor<B, 2>) -> Tensor<B, 4> {
        let [n, c, _, _] = x.dims();
        let film = self.film.forward(embedding).reshape([n, 2 * c, 1, 1]);
        let scale = film.clone().narrow(1, 0, c);
        let shift = film.narrow(1, c, c);
        let h = self.conv1.forward(silu(x.clone()));
        let h = h * (scale + 1.0) + shift;
        x + self.conv2.forward(silu(h))
    }
}
