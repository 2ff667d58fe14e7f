//! A field of a measurement file, of whatever format.

use super::array::to_c_order;

/// Share of the mean step by which the steps of evenly spaced numbers may differ: times are often
/// written with few digits.
const UNEVEN: f64 = 0.3;

/// Whether numbers grow in even steps, as times and counters do.
pub(super) fn is_counter(numbers: &[f64]) -> bool {
    let (Some(first), Some(last)) = (numbers.first(), numbers.last()) else { return false };
    let step = (last - first) / (numbers.len() - 1).max(1) as f64;
    let even = |pair: &[f64]| (pair[1] - pair[0] - step).abs() <= UNEVEN * step;
    numbers.len() > 2 && step > 0.0 && numbers.windows(2).all(even)
}

/// Numbers in C order, real or complex.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    pub(super) shape: Vec<usize>,
    pub(super) real: Vec<f64>,
    /// The imaginary parts, as many as `real`; `None` for real numbers.
    pub(super) imaginary: Option<Vec<f64>>,
}

impl Field {
    /// The columns of a table of this width, each with its number from 1 on.
    pub(super) fn columns(&self, width: usize) -> Vec<(String, Self)> {
        let column = |at: usize| {
            let real: Vec<f64> = self.real.iter().copied().skip(at).step_by(width).collect();
            ((at + 1).to_string(), Self { shape: vec![real.len()], real, imaginary: None })
        };
        (0..width).map(column).collect()
    }

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
