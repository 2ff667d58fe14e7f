//! Locates the readings of one measurement in an array of several measurements.

use super::FileError;
use std::path::Path;

/// How measurements of `length` readings lie in an array in C order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Layout {
    /// Number of measurements in the array, at least 1.
    pub(super) count: usize,
    length: usize,
    /// Whether the readings of one measurement are `count` apart instead of adjacent.
    patterns_first: bool,
}

impl Layout {
    /// The layout of an array of this shape, if the array holds measurements of `length` readings
    /// along the last axis or along the first. Axes of length 1 do not count.
    pub(super) fn of(shape: &[u64], length: usize, patterns_first: bool) -> Option<Self> {
        if shape.is_empty() || shape.contains(&0) {
            return None;
        }
        let axes: Vec<u64> = shape.iter().copied().filter(|&axis| axis != 1).collect();
        let (along, others) = match (&axes[..], patterns_first) {
            // With one reading a measurement, the other axes count the measurements.
            (others, _) if length == 1 => (1, others),
            ([], _) => return None,
            ([first, others @ ..], true) => (*first, others),
            ([others @ .., last], false) => (*last, others),
        };
        if along != length as u64 {
            return None;
        }
        let count = others.iter().try_fold(1_u64, |product, &axis| product.checked_mul(axis))?;
        Some(Self { count: usize::try_from(count).ok()?, length, patterns_first })
    }

    /// The index of the measurement to read. A file with a single measurement needs no choice. `is_square`: the
    /// measurements may be one spectrum.
    pub(super) fn choose(
        &self,
        path: &Path,
        field: &str,
        asked: Option<usize>,
        is_square: bool,
    ) -> Result<usize, FileError> {
        let chosen = asked.or((self.count == 1).then_some(0));
        chosen.filter(|&index| index < self.count).ok_or_else(|| FileError::Choice {
            path: path.to_owned(),
            field: field.to_owned().into(),
            count: self.count,
            asked,
            is_square,
        })
    }

    /// Whether the readings of each measurement are adjacent, in the order of the measurements.
    pub(super) fn is_adjacent(&self) -> bool {
        !self.patterns_first || self.count == 1 || self.length == 1
    }

    /// The readings of one measurement.
    pub(super) fn series(&self, values: &[f64], index: usize) -> Vec<f64> {
        match self.patterns_first {
            true => values.iter().skip(index).step_by(self.count).copied().collect(),
            false => values[index * self.length..(index + 1) * self.length].to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measurements_lie_along_either_end_behind_any_axes() {
        let values: Vec<f64> = (0..24).map(f64::from).collect();
        let last = Layout::of(&[2, 3, 4], 4, false).unwrap();
        assert_eq!((last.count, last.series(&values, 5)), (6, vec![20.0, 21.0, 22.0, 23.0]));
        let first = Layout::of(&[4, 2, 3], 4, true).unwrap();
        assert_eq!((first.count, first.series(&values, 5)), (6, vec![5.0, 11.0, 17.0, 23.0]));
        for column in [&[24, 1][..], &[1, 24], &[24], &[1, 24, 1]] {
            let one = Layout::of(column, 24, false).unwrap();
            assert_eq!((one.count, one.series(&values, 0).len()), (1, 24));
        }
        assert_eq!(Layout::of(&[4, 6], 4, false), None);
        assert_eq!(Layout::of(&[0, 4], 4, false), None);
        assert_eq!(Layout::of(&[], 4, false), None);
    }
}
