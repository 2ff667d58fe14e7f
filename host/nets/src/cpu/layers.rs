//! Layers by their names in a file of weights.

use pulp::Arch;

use super::conv::Conv;
use super::planes::Planes;
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

/// A 2 x 2 convolution with stride 2, as a 1 x 1 convolution over [`Planes::blocks`].
pub(super) fn conv_blocks(weights: &Weights, name: &str) -> Result<Conv, WeightsError> {
    let (key, bias) = (format!("{name}.weight"), format!("{name}.bias"));
    let [outputs, inputs, _, _] = weights.shape(&key)?;
    let kernels = weights.tensor(&key, &[outputs, inputs, 2, 2])?;
    let bias = weights.tensor(&bias, &[outputs])?;
    let at = |o: usize, i: usize, _: usize, _: usize| kernels.values[o * 4 * inputs + i];
    Ok(Conv::new((outputs, 4 * inputs, 1, 0), at, |o| bias.values[o]))
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

    pub fn apply(&self, input: &[f32]) -> Vec<f32> {
        let dot = |row: &[f32]| row.iter().zip(input).map(|(w, x)| w * x).sum::<f32>();
        self.rows.iter().zip(&self.bias).map(|(row, bias)| bias + dot(row)).collect()
    }
}

/// The mean of each channel.
pub(super) fn means(planes: &Planes) -> Vec<f32> {
    let (height, width) = planes.size();
    let pixels = (height * width) as f32;
    // Margins and slack are zero, so they add nothing.
    planes.values().chunks_exact(planes.stride()).map(|c| c.iter().sum::<f32>() / pixels).collect()
}

/// One image as the input of a network whose convolutions reach one pixel.
pub(super) fn single(image: &[f32], (height, width): (usize, usize)) -> Planes {
    let mut planes = Planes::new(1, height, width, 1);
    for (row, line) in image.chunks_exact(width).enumerate() {
        planes.row_mut(0, row).copy_from_slice(line);
    }
    planes
}

/// ReLU.
pub(super) fn relu(arch: Arch, planes: &mut Planes) {
    super::activation::prelu(arch, planes.values_mut(), 0.0);
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
