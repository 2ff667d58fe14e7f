//! Convolutions and fully connected layers in the layout of a file of weights, for every device.

use crate::weights::{Weights, WeightsError};

/// Side of FSRCNN's transposed convolution.
const TRANSPOSED_SIDE: usize = 9;

/// A convolution of square kernels.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Filter {
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
    /// Side of a kernel.
    pub(crate) side: usize,
    /// outputs x inputs x side x side.
    pub(crate) weights: Vec<f32>,
    /// One bias for each output.
    pub(crate) bias: Vec<f32>,
}

impl Filter {
    /// The convolution with this name.
    ///
    /// # Errors
    /// [`WeightsError`] if a tensor is missing or has another shape.
    pub(crate) fn convolution(weights: &Weights, name: &str) -> Result<Self, WeightsError> {
        let key = format!("{name}.weight");
        let [outputs, inputs, side, _] = weights.shape(&key)?;
        let kernels = weights.tensor(&key, &[outputs, inputs, side, side])?.values.clone();
        let bias = weights.tensor(&format!("{name}.bias"), &[outputs])?.values.clone();
        Ok(Self { inputs, outputs, side, weights: kernels, bias })
    }

    /// The fully connected layer with this name, as a convolution of 1 x 1.
    ///
    /// # Errors
    /// As [`Self::convolution`].
    pub(crate) fn linear(weights: &Weights, name: &str) -> Result<Self, WeightsError> {
        let key = format!("{name}.weight");
        let [outputs, inputs] = weights.shape(&key)?;
        let matrix = weights.tensor(&key, &[outputs, inputs])?.values.clone();
        let bias = weights.tensor(&format!("{name}.bias"), &[outputs])?.values.clone();
        Ok(Self { inputs, outputs, side: 1, weights: matrix, bias })
    }

    /// FSRCNN's transposed convolution (9 x 9, stride 2, padding 4) as a convolution of 5 x 5 with
    /// four outputs, one for each place in a block of 2 x 2: a pixel of the enlarged image uses
    /// only the taps of its own parity.
    ///
    /// # Errors
    /// As [`Self::convolution`].
    pub(crate) fn transposed(weights: &Weights, name: &str) -> Result<Self, WeightsError> {
        const SIDE: usize = 5;
        let key = format!("{name}.weight");
        let [inputs, _, _, _] = weights.shape(&key)?;
        let kernels = weights.tensor(&key, &[inputs, 1, TRANSPOSED_SIDE, TRANSPOSED_SIDE])?;
        let bias = weights.tensor(&format!("{name}.bias"), &[1])?.values[0];
        // Output 2 r + d uses input r + k - 2 through tap 2 (2 - k) + 4 + d of the kernel (padding
        // 4), k = 0..5.
        let tap =
            |k: usize, d: usize| (8 + d).checked_sub(2 * k).filter(|&tap| tap < TRANSPOSED_SIDE);
        let at = |o: usize, i: usize, ky: usize, kx: usize| match (tap(ky, o / 2), tap(kx, o % 2)) {
            (Some(y), Some(x)) => kernels.values[(i * TRANSPOSED_SIDE + y) * TRANSPOSED_SIDE + x],
            _ => 0.0,
        };
        let taps = |o, i| (0..SIDE).flat_map(move |ky| (0..SIDE).map(move |kx| (o, i, ky, kx)));
        let weights = (0..4)
            .flat_map(|o| (0..inputs).map(move |i| (o, i)))
            .flat_map(|(o, i)| taps(o, i))
            .map(|(o, i, ky, kx)| at(o, i, ky, kx))
            .collect();
        Ok(Self { inputs, outputs: 4, side: SIDE, weights, bias: vec![bias; 4] })
    }

    /// The weight of a tap.
    pub(crate) fn at(&self, output: usize, input: usize, ky: usize, kx: usize) -> f32 {
        self.weights[((output * self.inputs + input) * self.side + ky) * self.side + kx]
    }
}
