//! The UNet of the deblurrer, of the 500-step baseline and of the GAN's generator, on the CPU.

use pulp::Arch;

use super::activation::{film_silu, silu, silu_into};
use super::conv::Conv;
use super::layers::{Linear, conv, conv_blocks};
use super::planes::Planes;
use crate::schema::{self, UNetSizes};
use crate::weights::{Weights, WeightsError};

/// A residual block: convolution, scale and shift by the conditions, convolution.
#[derive(Debug, Clone)]
pub(super) struct Block {
    conv1: Conv,
    film: Linear,
    conv2: Conv,
}

impl Block {
    pub fn new(weights: &Weights, name: &str) -> Result<Self, WeightsError> {
        Ok(Self {
            conv1: conv(weights, &format!("{name}.conv1"))?,
            film: Linear::new(weights, &format!("{name}.film"))?,
            conv2: conv(weights, &format!("{name}.conv2"))?,
        })
    }

    /// Adds the block's output to `x`.
    pub fn add_to(&self, arch: Arch, x: &mut Planes, embedding: &[f32]) {
        let mut h = x.like(x.channels());
        silu_into(arch, x.values(), h.values_mut());
        let mut h = self.conv1.apply(arch, &h);
        let film = self.film.apply(embedding);
        let (scales, shifts) = film.split_at(film.len() / 2);
        let stride = h.stride();
        for ((channel, scale), &shift) in
            h.values_mut().chunks_exact_mut(stride).zip(scales).zip(shifts)
        {
            film_silu(arch, channel, 1.0 + scale, shift);
        }
        h.clear_margins();
        x.add(&self.conv2.apply(arch, &h));
    }
}

/// The network, with weights in the order of the loops.
#[derive(Debug, Clone)]
pub struct UNet {
    arch: Arch,
    embed1: Linear,
    embed2: Linear,
    input: Conv,
    encoder: Vec<Vec<Block>>,
    reduce: Vec<Conv>,
    expand: Vec<Conv>,
    decoder: Vec<Vec<Block>>,
    output: Conv,
}

impl UNet {
    /// The network with these weights.
    ///
    /// # Errors
    /// [`WeightsError`] if a tensor is missing, of another shape, not finite, or unknown.
    pub fn new(weights: &Weights) -> Result<Self, WeightsError> {
        let UNetSizes { channels, blocks: count, .. } = schema::unet(weights)?;
        let levels = channels.len();
        let blocks = |side: &str, level: usize| {
            (0..count).map(|j| Block::new(weights, &format!("{side}.{level}.{j}"))).collect()
        };
        let below = || 0..levels - 1;
        Ok(Self {
            arch: Arch::new(),
            embed1: Linear::new(weights, "embed1")?,
            embed2: Linear::new(weights, "embed2")?,
            input: conv(weights, "input_conv")?,
            encoder: (0..levels).map(|level| blocks("encoder", level)).collect::<Result<_, _>>()?,
            reduce: below()
                .map(|i| conv_blocks(weights, &format!("reduce.{i}")))
                .collect::<Result<_, _>>()?,
            expand: below()
                .map(|i| conv(weights, &format!("expand.{i}")))
                .collect::<Result<_, _>>()?,
            decoder: below().map(|level| blocks("decoder", level)).collect::<Result<_, _>>()?,
            output: conv(weights, "output_conv")?,
        })
    }

    /// The network's output for `current` and `degraded`, images of `height` x `width` pixels, both
    /// divisible by 2^levels, under `conditions`. The output has the same size.
    pub fn forward(
        &self,
        current: &[f32],
        degraded: &[f32],
        (height, width): (usize, usize),
        conditions: &[f32],
    ) -> Vec<f32> {
        let arch = self.arch;
        let mut embedding = self.embed1.apply(conditions);
        silu(arch, &mut embedding);
        let mut embedding = self.embed2.apply(&embedding);
        silu(arch, &mut embedding);
        let mut input = Planes::new(8, height / 2, width / 2, 1);
        input.unshuffle(0, current);
        input.unshuffle(4, degraded);
        let mut h = self.input.apply(arch, &input);
        let mut skips = Vec::with_capacity(self.reduce.len());
        for (level, blocks) in self.encoder.iter().enumerate() {
            for block in blocks {
                block.add_to(arch, &mut h, &embedding);
            }
            if let Some(reduce) = self.reduce.get(level) {
                let coarse = reduce.apply(arch, &h.blocks());
                skips.push(std::mem::replace(&mut h, coarse));
            }
        }
        for ((expand, blocks), skip) in self.expand.iter().zip(&self.decoder).zip(skips).rev() {
            h = expand.apply(arch, &h).shuffle(1);
            h.add(&skip);
            for block in blocks {
                block.add_to(arch, &mut h, &embedding);
            }
        }
        self.output.apply(arch, &h).shuffle(0).pixels()
    }
}
