//! The network of the learned prior, on the CPU: stages of residual blocks on 2 x 2 pixels as four
//! channels, each stage ending with a step towards the measurements.

use nirspi_recon::reconstruct::prior::Seen;
use pulp::Arch;

use super::activation::silu;
use super::layers::{Linear, winograd};
use super::pixels::Pixels;
use super::unet::Block;
use super::winograd::Winograd;
use crate::schema::{self, GRID_BITS, PriorSizes};
use crate::weights::{Weights, WeightsError};

/// Blocks between two steps towards the measurements.
#[derive(Debug, Clone)]
struct Stage {
    input: Winograd,
    blocks: Vec<Block>,
    output: Winograd,
    /// How far the step goes: a level, and its slope over the fineness of the patterns.
    step: Linear,
}

/// The network, with weights in the order of the loops.
#[derive(Debug, Clone)]
pub struct Prior {
    arch: Arch,
    embed1: Linear,
    embed2: Linear,
    stages: Vec<Stage>,
}

impl Prior {
    /// The network with these weights.
    ///
    /// # Errors
    /// [`WeightsError`] if a tensor is missing, of another shape, not finite, or unknown.
    pub fn new(weights: &Weights) -> Result<Self, WeightsError> {
        let PriorSizes { stages, blocks, .. } = schema::prior(weights)?;
        let stage = |stage: usize| {
            Ok(Stage {
                input: winograd(weights, &format!("input_conv.{stage}"))?,
                blocks: (0..blocks)
                    .map(|block| Block::new(weights, &format!("blocks.{stage}.{block}")))
                    .collect::<Result<_, WeightsError>>()?,
                output: winograd(weights, &format!("output_conv.{stage}"))?,
                step: Linear::new(weights, &format!("weight.{stage}"))?,
            })
        };
        Ok(Self {
            arch: Arch::new(),
            embed1: Linear::new(weights, "embed1")?,
            embed2: Linear::new(weights, "embed2")?,
            stages: (0..stages).map(stage).collect::<Result<_, WeightsError>>()?,
        })
    }

    /// Every coefficient, by natural Hadamard row, in the units of [`Seen::values`].
    #[must_use]
    pub fn forward(&self, seen: &Seen) -> Vec<f32> {
        let (arch, n) = (self.arch, seen.side().pixels());
        let mut embedding = self.embed1.apply(seen.conditions());
        silu(arch, &mut embedding);
        let mut embedding = self.embed2.apply(&embedding);
        silu(arch, &mut embedding);
        let zero_filled = seen.image(seen.values());
        let mut coefficients = seen.start().to_vec();
        let mut features: Option<Pixels> = None;
        for stage in &self.stages {
            let mut image = seen.image(&coefficients);
            let grid_bits = if features.is_none() { 2 * GRID_BITS } else { 0 };
            let mut input = Pixels::new(8 + grid_bits, n / 2, n / 2);
            input.unshuffle(0, &image);
            input.unshuffle(4, &zero_filled);
            if features.is_none() {
                add_grid(&mut input);
            }
            let mut h = features.take().unwrap_or_else(|| input.like(stage.input.outputs()));
            stage.input.add_to(arch, &input, &mut h);
            for block in &stage.blocks {
                block.add_to(arch, &mut h, &embedding);
            }
            let mut change = h.like(stage.output.outputs());
            stage.output.add_to(arch, &h, &mut change);
            image.iter_mut().zip(change.shuffled()).for_each(|(pixel, change)| *pixel += change);
            // The orthonormal transform is its own inverse.
            coefficients = seen.image(&image);
            step(&mut coefficients, seen, &stage.step.apply(&embedding));
            features = Some(h);
        }
        coefficients
    }
}

/// Stores where each pixel is in the blocks of the Walsh functions: bits of its row, then of its
/// column, as -1 and 1.
fn add_grid(input: &mut Pixels) {
    let ((height, _), pitch) = (input.size(), input.pitch());
    let sign = |index: usize, bit: usize| if index >> bit & 1 == 1 { 1.0 } else { -1.0 };
    for row in 0..height {
        for (column, pixel) in input.row_mut(row).chunks_exact_mut(pitch).enumerate() {
            for bit in 0..GRID_BITS {
                pixel[8 + bit] = sign(row, bit);
                pixel[8 + GRID_BITS + bit] = sign(column, bit);
            }
        }
    }
}

/// Moves measured coefficients towards their measurements.
fn step(coefficients: &mut [f32], seen: &Seen, weights: &[f32]) {
    let (level, slope) = (weights[0], weights[1]);
    let measured = seen.values().iter().zip(seen.mask()).zip(seen.fineness());
    for (coefficient, ((value, mask), fineness)) in coefficients.iter_mut().zip(measured) {
        let share = 1.0 / (1.0 + (-(level + slope * fineness)).exp());
        *coefficient += mask * share * (value - *coefficient);
    }
}
