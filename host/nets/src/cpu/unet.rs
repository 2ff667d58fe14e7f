//! The UNet of the deblurrer, of the 500-step baseline and of the GAN's generator, on the CPU.

use pulp::Arch;

use super::activation::{FilmSilu, silu, silu_into};
use super::layers::{Linear, winograd};
use super::pixels::Pixels;
use super::pointwise::Pointwise;
use super::winograd::Winograd;
use crate::schema::{self, UNetSizes};
use crate::weights::{Weights, WeightsError};

/// A residual block: convolution, scale and shift by the conditions, convolution.
#[derive(Debug, Clone)]
pub(super) struct Block {
    conv1: Winograd,
    film: Linear,
    conv2: Winograd,
}

impl Block {
    pub fn new(weights: &Weights, name: &str) -> Result<Self, WeightsError> {
        Ok(Self {
            conv1: winograd(weights, &format!("{name}.conv1"))?,
            film: Linear::new(weights, &format!("{name}.film"))?,
            conv2: winograd(weights, &format!("{name}.conv2"))?,
        })
    }

    /// Adds the block's output to `x`.
    pub fn add_to(&self, arch: Arch, x: &mut Pixels, embedding: &[f32]) {
        let mut active = x.like(x.channels());
        for row in 0..x.size().0 {
            silu_into(arch, x.row(row), active.row_mut(row));
        }
        let mut h = x.like(x.channels());
        self.conv1.add_to(arch, &active, &mut h);
        let film = self.film.apply(embedding);
        let (scales, shifts) = film.split_at(film.len() / 2);
        let mut gains: Vec<f32> = scales.iter().map(|scale| 1.0 + scale).collect();
        let mut offsets = shifts.to_vec();
        // The padding of a pixel stays zero.
        gains.resize(h.pitch(), 0.0);
        offsets.resize(h.pitch(), 0.0);
        for row in 0..h.size().0 {
            let pixels = h.row_mut(row);
            arch.dispatch(FilmSilu { pixels, gains: &gains, offsets: &offsets });
        }
        self.conv2.add_to(arch, &h, x);
    }
}

/// The network, with weights in the order of the loops.
#[derive(Debug, Clone)]
pub struct UNet {
    arch: Arch,
    embed1: Linear,
    embed2: Linear,
    input: Winograd,
    encoder: Vec<Vec<Block>>,
    reduce: Vec<Pointwise>,
    expand: Vec<Pointwise>,
    decoder: Vec<Vec<Block>>,
    output: Winograd,
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
            input: winograd(weights, "input_conv")?,
            encoder: (0..levels).map(|level| blocks("encoder", level)).collect::<Result<_, _>>()?,
            reduce: below()
                .map(|i| Pointwise::reducing(weights, &format!("reduce.{i}")))
                .collect::<Result<_, _>>()?,
            expand: below()
                .map(|i| Pointwise::expanding(weights, &format!("expand.{i}")))
                .collect::<Result<_, _>>()?,
            decoder: below().map(|level| blocks("decoder", level)).collect::<Result<_, _>>()?,
            output: winograd(weights, "output_conv")?,
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
        let mut input = Pixels::new(8, height / 2, width / 2);
        input.unshuffle(0, current);
        input.unshuffle(4, degraded);
        let mut h = input.like(self.input.outputs());
        self.input.add_to(arch, &input, &mut h);
        let mut skips = Vec::with_capacity(self.reduce.len());
        for (level, blocks) in self.encoder.iter().enumerate() {
            for block in blocks {
                block.add_to(arch, &mut h, &embedding);
            }
            if let Some(reduce) = self.reduce.get(level) {
                let mut coarse = reduce.output(&h);
                reduce.add_to(arch, &h, &mut coarse);
                skips.push(std::mem::replace(&mut h, coarse));
            }
        }
        for ((expand, blocks), skip) in self.expand.iter().zip(&self.decoder).zip(skips).rev() {
            let coarse = std::mem::replace(&mut h, skip);
            expand.add_to(arch, &coarse, &mut h);
            for block in blocks {
                block.add_to(arch, &mut h, &embedding);
            }
        }
        let mut output = h.like(self.output.outputs());
        self.output.add_to(arch, &h, &mut output);
        output.shuffled()
    }
}
