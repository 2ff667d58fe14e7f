//! A field of a measurement file, of whatever format.

use super::array::to_c_order;

/// The kind of file that a path should lead to, for error messages.
pub(super) const EXPECTED: &str =
    "measurements: .npz, .npy, .mat, .h5, .csv, .txt or .wav, or a recording (.mcap)";

/// Numbers in C order, real or complex.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    pub(super) shape: Vec<usize>,
    pub(super) real: Vec<f64>,
    /// The imaginary parts, as many as `real`; `None` for real numbers.
    pub(super) imaginary: Option<Vec<f64>>,
}

impl Field {
    /// A field of numbers that are stored with the first axis fastest. The axes are reversed and
    /// the numbers keep their order.
    pub(super) fn from_column_major(
        shape: Vec<usize>,
        real: &[f64],
        imaginary: Option<&[f64]>,
    ) -> Self {
        let turn = |values: &[f64]| to_c_order(values, &shape);
        let (real, imaginary) = (turn(real), imaginary.map(turn));
        Self { shape, real, imaginary }
    }
}
