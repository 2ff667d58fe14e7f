//! Convolutions as one product of matrices, with a row for each window of the input: 1 x 1, 2 x 2
//! with stride 2, and 3 x 3 with stride 2.

use pulp::Arch;
use rayon::prelude::*;

use super::aligned::Aligned;
use super::conv::THREAD_WORK;
use super::pixels::{Pixels, Window, padded};
use super::product::Product;
use crate::filter::Filter;
use crate::weights::{Weights, WeightsError};

/// Rows of a product that one thread computes at least.
const ROWS: usize = 16;

/// Weights of a convolution from windows of pixels to squares of pixels.
#[derive(Debug, Clone)]
pub(super) struct Pointwise {
    window: Window,
    /// Side of the squares of the output.
    square: usize,
    inner: usize,
    /// Channels of the output's pixels.
    channels: usize,
    /// A row for each input of a window, a column for each output.
    matrix: Aligned,
    bias: Vec<f32>,
}

impl Pointwise {
    /// The convolution of 2 x 2 or 3 x 3 with stride 2 and this name.
    ///
    /// # Errors
    /// [`WeightsError`] if a tensor is missing or has another shape.
    pub fn reducing(weights: &Weights, name: &str) -> Result<Self, WeightsError> {
        let filter = Filter::convolution(weights, name)?;
        let (inputs, taps) = (filter.inputs, filter.side * filter.side);
        let window = Window { side: filter.side, stride: 2, margin: filter.side - 2 };
        Ok(Self::new(
            (window, 1),
            (taps * inputs, filter.outputs),
            |row, output| filter.weights[(output * inputs + row % inputs) * taps + row / inputs],
            |output| filter.bias[output],
        ))
    }

    /// The convolution of 1 x 1 with this name whose outputs 4c to 4c + 3 are channel c of 2 x 2
    /// pixels: from one pixel to 2 x 2.
    ///
    /// # Errors
    /// [`WeightsError`] if a tensor is missing or has another shape.
    pub fn expanding(weights: &Weights, name: &str) -> Result<Self, WeightsError> {
        let filter = Filter::convolution(weights, name)?;
        let (inputs, channels) = (filter.inputs, filter.outputs / 4);
        let output = |column: usize| column % channels * 4 + column / channels;
        Ok(Self::new(
            (Window { side: 1, stride: 1, margin: 0 }, 2),
            (inputs, channels),
            |input, column| filter.weights[output(column) * inputs + input],
            |column| filter.bias[output(column)],
        ))
    }

    fn new(
        (window, square): (Window, usize),
        (inner, channels): (usize, usize),
        weight: impl Fn(usize, usize) -> f32,
        bias: impl Fn(usize) -> f32,
    ) -> Self {
        let outputs = square * square * channels;
        let columns = padded(outputs);
        let mut matrix = Aligned::zeros(inner * columns);
        for (row, line) in matrix.chunks_exact_mut(columns).enumerate() {
            line[..outputs].iter_mut().enumerate().for_each(|(column, w)| *w = weight(row, column));
        }
        let mut bias: Vec<f32> = (0..outputs).map(bias).collect();
        bias.resize(columns, 0.0);
        Self { window, square, inner, channels, matrix, bias }
    }

    /// Zeros of the size of the output for `input`.
    pub fn output(&self, input: &Pixels) -> Pixels {
        let side = |input: usize| input.div_ceil(self.window.stride) * self.square;
        let (height, width) = input.size();
        Pixels::new(self.channels, side(height), side(width))
    }

    /// Adds the convolution of `input` to `out`.
    pub fn add_to(&self, arch: Arch, input: &Pixels, out: &mut Pixels) {
        let windows = input.windows(self.window);
        let (inner, columns) = (self.inner, self.bias.len());
        let mut product = Aligned::zeros(windows.len() / inner * columns);
        let grain = (THREAD_WORK / (ROWS * inner * columns)).max(1);
        let rows = product.par_chunks_mut(ROWS * columns).zip(windows.par_chunks(ROWS * inner));
        rows.with_min_len(grain).for_each(|(out, left)| {
            let (right, start) = (&self.matrix, &self.bias);
            Product { left, left_pitch: inner, inner, right, columns, start, out }.compute(arch);
        });
        out.add_squares(self.square, &product, columns);
    }
}
