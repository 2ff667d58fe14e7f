//! Checks the weights of each network: the name and the shape of every tensor.
//!
//! Widths may differ between files: a file of a narrower or a deeper network of the same kind is
//! valid. Each width occurs in several tensors, and the length that most of these tensors have is
//! the network's width. So an error names the one wrong tensor, and not its neighbours.
//!
//! # Invariant
//! A network runs only with complete weights: each tensor exists and has the one shape that fits
//! its neighbours, all numbers are finite, and there are no other tensors
//! (`tests::a_damaged_tensor_is_named_with_what_was_found_and_expected`). Every backend checks with
//! this module first (`device::networks::tests::every_device_refuses_the_same_weights_in_the_same_words`).

use crate::weights::{Weights, WeightsError};
use nirspi_recon::reconstruct::prior::Seen;

/// Number of conditions of the UNet: time (2), blur (2), noise (2).
pub(crate) const CONDITIONS: usize = 6;

/// The conditions of one image.
pub(crate) type Conditions = [f32; CONDITIONS];

/// The most levels of a UNet. Its images of 64 x 64 are halved before the first level and after
/// each level except the last.
const LEVELS: usize = 6;

/// The most tensors of a numbered list: blocks of a level, or layers between FSRCNN's shrinking and
/// expanding.
const LISTED: usize = 64;

/// Number of characters that the classifier distinguishes.
pub(crate) const CLASSES: usize = 62;

/// Channels of the UNet's input: two images, four pixels of a block each.
const PAIRED: usize = 8;

/// The length of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Axis {
    /// The same length in every file.
    Fixed(usize),
    /// A multiple of the width with this number.
    Width { times: usize, number: usize },
}

/// A width of the network, by its number.
const fn width(number: usize) -> Axis {
    Axis::Width { times: 1, number }
}

impl Axis {
    fn length(self, widths: &[usize]) -> usize {
        match self {
            Self::Fixed(length) => length,
            Self::Width { times, number } => times * widths[number],
        }
    }

    fn times(self, factor: usize) -> Self {
        match self {
            Self::Fixed(length) => Self::Fixed(factor * length),
            Self::Width { times, number } => Self::Width { times: factor * times, number },
        }
    }
}

/// All tensors of a network.
#[derive(Debug, Default)]
struct Schema {
    tensors: Vec<(String, Vec<Axis>)>,
}

impl Schema {
    fn tensor(&mut self, name: String, axes: &[Axis]) {
        self.tensors.push((name, axes.to_vec()));
    }

    /// Kernels of `side` x `side`, and a bias for each output.
    fn convolution(&mut self, name: &str, outputs: Axis, inputs: Axis, side: usize) {
        let side = Axis::Fixed(side);
        self.tensor(format!("{name}.weight"), &[outputs, inputs, side, side]);
        self.tensor(format!("{name}.bias"), &[outputs]);
    }

    fn linear(&mut self, name: &str, outputs: Axis, inputs: Axis) {
        self.tensor(format!("{name}.weight"), &[outputs, inputs]);
        self.tensor(format!("{name}.bias"), &[outputs]);
    }

    /// A residual block with scale and shift by the conditions.
    fn block(&mut self, name: &str, channels: Axis, embedding: Axis) {
        self.convolution(&format!("{name}.conv1"), channels, channels, 3);
        self.linear(&format!("{name}.film"), channels.times(2), embedding);
        self.convolution(&format!("{name}.conv2"), channels, channels, 3);
    }

    /// Checks the weights against the schema. Returns the `count` widths of the network.
    fn check(&self, weights: &Weights, count: usize) -> Result<Vec<usize>, WeightsError> {
        let widths: Vec<usize> = (0..count).map(|number| self.width(weights, number)).collect();
        let unknown =
            weights.names().find(|name| self.tensors.iter().all(|(known, _)| known != name));
        for (name, axes) in &self.tensors {
            let shape: Vec<usize> = axes.iter().map(|axis| axis.length(&widths)).collect();
            weights.place(name, &shape, unknown)?;
        }
        match unknown {
            Some(unknown) => Err(weights.unknown(unknown)),
            None => Ok(widths),
        }
    }

    /// The width that most tensors have. Of two equally frequent widths the smaller is taken; 1 if
    /// no tensor shows the width.
    fn width(&self, weights: &Weights, wanted: usize) -> usize {
        let mut votes: Vec<(usize, usize)> = Vec::new();
        for (name, axes) in &self.tensors {
            let Ok(array) = weights.get(name) else { continue };
            if array.shape.len() != axes.len() || array.values.is_empty() {
                continue;
            }
            for (axis, &length) in axes.iter().zip(&array.shape) {
                let Axis::Width { times, number } = *axis else { continue };
                if number != wanted || length % times != 0 {
                    continue;
                }
                let width = length / times;
                match votes.iter_mut().find(|(voted, _)| *voted == width) {
                    Some((_, votes)) => *votes += 1,
                    None => votes.push((width, 1)),
                }
            }
        }
        votes.sort_unstable();
        votes.into_iter().rev().max_by_key(|(_, votes)| *votes).map_or(1, |(width, _)| width)
    }
}

/// Number of entries of a numbered list, whose tensors' names begin with `list`, a number and a
/// dot. The result is one more than the largest number, so that a gap shows as a missing tensor.
fn listed(weights: &Weights, list: &str, most: usize) -> Result<usize, WeightsError> {
    let mut count = 0;
    for name in weights.names() {
        let number = name.strip_prefix(list).and_then(|rest| rest.split_once('.'));
        // `+1` and `01` are numbers in Rust but not in PyTorch, so the schema does not accept them.
        let plain = |digits: &str| digits == "0" || !digits.starts_with(['0', '+']);
        let number = number.map(|(digits, _)| digits).filter(|digits| plain(digits));
        match number.and_then(|digits| digits.parse::<usize>().ok()) {
            Some(number) if number >= most => {
                return Err(weights.too_many(name, most));
            }
            Some(number) => count = count.max(number + 1),
            None => {}
        }
    }
    Ok(count)
}

/// Widths of the estimator: channels after each of its four convolutions, then the hidden layer.
///
/// # Errors
/// [`WeightsError`] naming the first tensor that is missing, has another shape, is not finite, or
/// is not part of the network.
pub(crate) fn estimator(weights: &Weights) -> Result<Vec<usize>, WeightsError> {
    let mut schema = Schema::default();
    let mut inputs = Axis::Fixed(1);
    for layer in 0..4 {
        schema.convolution(&format!("conv{}", layer + 1), width(layer), inputs, 3);
        inputs = width(layer);
    }
    schema.linear("fc1", width(4), inputs);
    schema.linear("fc2", Axis::Fixed(2), width(4));
    schema.check(weights, 5)
}

/// Widths of the classifier: channels of each of its three pairs of convolutions.
///
/// # Errors
/// As [`estimator`].
pub(crate) fn classifier(weights: &Weights) -> Result<Vec<usize>, WeightsError> {
    let mut schema = Schema::default();
    let mut inputs = Axis::Fixed(1);
    for pair in 0..3 {
        schema.convolution(&format!("conv{}", 2 * pair + 1), width(pair), inputs, 3);
        inputs = width(pair);
        schema.convolution(&format!("conv{}", 2 * pair + 2), inputs, inputs, 3);
    }
    schema.linear("fc", Axis::Fixed(CLASSES), inputs);
    schema.check(weights, 3)
}

/// Features, shrunk channels and mapping layers of FSRCNN.
///
/// # Errors
/// As [`estimator`].
pub(crate) fn fsrcnn(weights: &Weights) -> Result<[usize; 3], WeightsError> {
    let (features, shrunk) = (width(0), width(1));
    let maps = listed(weights, "map.", LISTED)?.max(listed(weights, "map_act.", LISTED)?);
    let mut schema = Schema::default();
    schema.convolution("feature", features, Axis::Fixed(3), 5);
    schema.tensor("feature_act.weight".to_owned(), &[features]);
    schema.convolution("shrink", shrunk, features, 1);
    schema.tensor("shrink_act.weight".to_owned(), &[shrunk]);
    for map in 0..maps {
        schema.convolution(&format!("map.{map}"), shrunk, shrunk, 3);
        schema.tensor(format!("map_act.{map}.weight"), &[shrunk]);
    }
    schema.convolution("expand", features, shrunk, 1);
    schema.tensor("expand_act.weight".to_owned(), &[features]);
    let side = Axis::Fixed(9);
    schema.tensor("deconv.weight".to_owned(), &[features, Axis::Fixed(1), side, side]);
    schema.tensor("deconv.bias".to_owned(), &[Axis::Fixed(1)]);
    let widths = schema.check(weights, 2)?;
    Ok([widths[0], widths[1], maps])
}

/// Bits of a pixel's place that the learned prior's first stage is given, down and across each.
pub(crate) const GRID_BITS: usize = 3;

/// Sizes of the learned prior's network.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct PriorSizes {
    /// Steps towards the measurements.
    pub(crate) stages: usize,
    /// Residual blocks before each step.
    pub(crate) blocks: usize,
    /// Channels, and the length of the vector of the conditions.
    pub(crate) widths: [usize; 2],
}

/// Sizes of the learned prior's network.
///
/// # Errors
/// As [`estimator`].
pub(crate) fn prior(weights: &Weights) -> Result<PriorSizes, WeightsError> {
    let (mut stages, mut blocks) = (1, 1);
    for list in ["input_conv.", "blocks.", "output_conv.", "weight."] {
        stages = stages.max(listed(weights, list, LISTED)?);
    }
    for stage in 0..stages {
        blocks = blocks.max(listed(weights, &format!("blocks.{stage}."), LISTED)?);
    }
    let (channels, embedding) = (width(0), width(1));
    let mut schema = Schema::default();
    schema.linear("embed1", embedding, Axis::Fixed(Seen::CONDITIONS));
    schema.linear("embed2", embedding, embedding);
    for stage in 0..stages {
        let grid_bits = if stage == 0 { 2 * GRID_BITS } else { 0 };
        let inputs = Axis::Fixed(PAIRED + grid_bits);
        schema.convolution(&format!("input_conv.{stage}"), channels, inputs, 3);
        for index in 0..blocks {
            schema.block(&format!("blocks.{stage}.{index}"), channels, embedding);
        }
        schema.convolution(&format!("output_conv.{stage}"), Axis::Fixed(4), channels, 3);
        schema.linear(&format!("weight.{stage}"), Axis::Fixed(2), embedding);
    }
    let widths = schema.check(weights, 2)?;
    Ok(PriorSizes { stages, blocks, widths: [widths[0], widths[1]] })
}

/// Sizes of a UNet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct UNetSizes {
    /// Channels of each level, the finest first.
    pub(crate) channels: Vec<usize>,
    /// Residual blocks of a level, both downwards and upwards.
    pub(crate) blocks: usize,
    /// Length of the vector of the conditions.
    pub(crate) embedding: usize,
}

/// Sizes of the UNet of the bridge, of the 500-step baseline and of the GAN's generator.
///
/// # Errors
/// As [`estimator`].
pub(crate) fn unet(weights: &Weights) -> Result<UNetSizes, WeightsError> {
    let below = listed(weights, "decoder.", LEVELS - 1)?
        .max(listed(weights, "reduce.", LEVELS - 1)?)
        .max(listed(weights, "expand.", LEVELS - 1)?);
    let levels = listed(weights, "encoder.", LEVELS)?.max(below + 1);
    let mut blocks = 1;
    for level in 0..levels {
        for side in ["encoder", "decoder"] {
            blocks = blocks.max(listed(weights, &format!("{side}.{level}."), LISTED)?);
        }
    }
    let embedding = width(levels);
    let mut schema = Schema::default();
    schema.linear("embed1", embedding, Axis::Fixed(CONDITIONS));
    schema.linear("embed2", embedding, embedding);
    schema.convolution("input_conv", width(0), Axis::Fixed(PAIRED), 3);
    for level in 0..levels {
        for index in 0..blocks {
            schema.block(&format!("encoder.{level}.{index}"), width(level), embedding);
        }
    }
    for fine in 0..levels - 1 {
        let coarse = width(fine + 1);
        schema.convolution(&format!("reduce.{fine}"), coarse, width(fine), 2);
        schema.convolution(&format!("expand.{fine}"), width(fine).times(4), coarse, 1);
        for index in 0..blocks {
            schema.block(&format!("decoder.{fine}.{index}"), width(fine), embedding);
        }
    }
    schema.convolution("output_conv", Axis::Fixed(4), width(0), 3);
    let mut channels = schema.check(weights, levels + 1)?;
    // The embedding's width is the last.
    let embedding = channels.pop().unwrap_or(1);
    Ok(UNetSizes { channels, blocks, embedding })
}

#[cfg(test)]
mod tests;
