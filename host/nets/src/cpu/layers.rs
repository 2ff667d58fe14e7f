//! Layers by their names in a file of weights.

use pulp::Arch;

use super::conv::Conv;
use super::pixels::Pixels;
use super::planes::Planes;
use super::pointwise::Pointwise;
use super::winograd::Winograd;
use crate::filter::Filter;
use crate::weights::{Weights, WeightsError};

/// A convolution with stride 1 that keeps the size of its input; taps beyond the edge read zeros.
pub(super) fn conv(weights: &Weights, name: &str) -> Result<Conv, WeightsError> {
    Ok(keeping(&Filter::convolution(weights, name)?))
}

/// The same convolution from weights that are already read.
pub(super) fn keeping(filter: &Filter) -> Conv {
    let sizes = (filter.outputs, filter.inputs, filter.side, filter.side / 2);
    Conv::new(sizes, |o, i, ky, kx| filter.at(o, i, ky, kx), |o| filter.bias[o])
}

/// A convolution of 3 x 3 on [`Pixels`].
pub(super) fn winograd(weights: &Weights, name: &str) -> Result<Winograd, WeightsError> {
    Ok(Winograd::new(&Filter::convolution(weights, name)?))
}

/// A fully connected layer.
#[derive(Debug, Clone)]
pub(super) struct Linear {
    /// One row for each output.
    rows: Vec<Vec<f32>>,
    bias: Vec<f32>,
}

impl Linear {
    pub fn new(weights: &Weights, name: &str) -> Result<Self, WeightsError> {
        let Filter { inputs, weights, bias, .. } = Filter::linear(weights, name)?;
        let rows = weights.chunks(inputs.max(1)).map(<[f32]>::to_vec).collect();
        Ok(Self { rows, bias })
    }

    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.rows.first().map_or(0, Vec::len)
    }

    pub fn apply(&self, input: &[f32]) -> Vec<f32> {
        let dot = |row: &[f32]| row.iter().zip(input).map(|(w, x)| w * x).sum::<f32>();
        self.rows.iter().zip(&self.bias).map(|(row, bias)| bias + dot(row)).collect()
    }
}

/// A convolution of 3 x 3 on [`Pixels`], with a ReLU after it.
#[derive(Debug, Clone)]
pub(super) enum Rectified {
    /// With stride 1.
    Same(Winograd),
    /// With stride 2.
    Halving(Pointwise),
}

impl Rectified {
    pub fn new(weights: &Weights, name: &str, stride: usize) -> Result<Self, WeightsError> {
        Ok(match stride {
            1 => Self::Same(winograd(weights, name)?),
            _ => Self::Halving(Pointwise::reducing(weights, name)?),
        })
    }

    pub fn apply(&self, arch: Arch, input: &Pixels) -> Pixels {
        let mut out;
        match self {
            Self::Same(conv) => {
                out = input.like(conv.outputs());
                conv.add_to(arch, input, &mut out);
            }
            Self::Halving(conv) => {
                out = conv.output(input);
                conv.add_to(arch, input, &mut out);
            }
        }
        super::activation::prelu(arch, out.values_mut(), 0.0);
        out
    }
}

/// The mean of each channel.
pub(super) fn means(pixels: &Pixels) -> Vec<f32> {
    let (height, width) = pixels.size();
    pixels.sums().into_iter().map(|sum| sum / (height * width) as f32).collect()
}

/// One image as the input of a network.
pub(super) fn single(image: &[f32], (height, width): (usize, usize)) -> Pixels {
    let mut pixels = Pixels::new(1, height, width);
    let pitch = pixels.pitch();
    for (row, line) in image.chunks_exact(width).enumerate() {
        let to = pixels.row_mut(row).chunks_exact_mut(pitch);
        to.zip(line).for_each(|(pixel, value)| pixel[0] = *value);
    }
    pixels
}

/// Slope of each channel's PReLU, by the layer's name.
pub(super) fn slopes(
    weights: &Weights,
    name: &str,
    channels: usize,
) -> Result<Vec<f32>, WeightsError> {
    Ok(weights.tensor(&format!("{name}.weight"), &[channels])?.values.clone())
}

/// PReLU with one slope for each channel.
pub(super) fn prelu(arch: Arch, planes: &mut Planes, slopes: &[f32]) {
    let stride = planes.stride();
    for (channel, &slope) in planes.values_mut().chunks_exact_mut(stride).zip(slopes) {
        super::activation::prelu(arch, channel, slope);
    }
}
