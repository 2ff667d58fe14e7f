//! The Hadamard rows from which the readings were made. Only measured rows constrain the image.

use super::SIDE;
use crate::cosine::Cosine;
use std::sync::Arc;
use thiserror::Error;

/// The measured rows of the natural-order Hadamard matrix.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum MeasuredRows {
    /// Every row.
    #[default]
    All,
    /// Some rows, at least one, and not every row.
    Rows(SampledRows),
}

/// Some Hadamard rows of images of one size: at least one, but not all.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SampledRows {
    side: usize,
    measured: Arc<[bool]>,
    count: usize,
}

/// Why a list of measured rows is refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum MeasuredRowsError {
    /// The readings have a size without a camera model.
    #[error("readings of {found} x {found}, expected 32 x 32 or 64 x 64")]
    Side {
        /// Side of the readings.
        found: usize,
    },
    /// The list is empty.
    #[error("the list of measured Hadamard rows is empty, expected at least one row")]
    Empty,
    /// A row is beyond the matrix.
    #[error("Hadamard row {row} of readings of {side} x {side}, expected 0 to {}", side * side - 1)]
    Row {
        /// Number of the row.
        row: u32,
        /// Side of the readings.
        side: usize,
    },
    /// The rows belong to readings of another size.
    #[error(
        "the measured Hadamard rows are of {rows} x {rows} readings, but the readings are {readings} x {readings}"
    )]
    OtherSide {
        /// Side of the readings that the rows belong to.
        rows: usize,
        /// Side of the readings.
        readings: usize,
    },
}

impl MeasuredRows {
    /// The rows of readings of `side` x `side`, 32 or 64, in any order; [`All`](Self::All) if the
    /// list has every row.
    ///
    /// # Errors
    /// [`MeasuredRowsError`] if the side is not 32 or 64, the list is empty, or a row is beyond the
    /// matrix.
    pub fn new(side: usize, rows: &[u32]) -> Result<Self, MeasuredRowsError> {
        if side != SIDE && side != SIDE / 2 {
            return Err(MeasuredRowsError::Side { found: side });
        }
        if rows.is_empty() {
            return Err(MeasuredRowsError::Empty);
        }
        let mut measured = vec![false; side * side];
        for &row in rows {
            let place = measured.get_mut(row as usize);
            *place.ok_or(MeasuredRowsError::Row { row, side })? = true;
        }
        let count = measured.iter().filter(|&&m| m).count();
        Ok(match count == side * side {
            true => Self::All,
            false => Self::Rows(SampledRows { side, measured: measured.into(), count }),
        })
    }

    /// Checks that the rows belong to readings of `side` x `side`.
    ///
    /// # Errors
    /// [`MeasuredRowsError::OtherSide`] if they do not.
    pub(crate) fn expect_side(&self, side: usize) -> Result<(), MeasuredRowsError> {
        match self {
            Self::Rows(rows) if rows.side != side => {
                Err(MeasuredRowsError::OtherSide { rows: rows.side, readings: side })
            }
            _ => Ok(()),
        }
    }
}

impl SampledRows {
    /// Number of measured rows.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Removes the unmeasured part from readings given by their cosine transform.
    pub(super) fn keep_measured(&self, cosine: &Cosine<f32>, spectrum: &mut [f32]) {
        let mut readings = cosine.inverse(spectrum);
        walsh_hadamard(&mut readings);
        let scale = 1.0 / readings.len() as f32;
        for (value, &measured) in readings.iter_mut().zip(&*self.measured) {
            *value *= if measured { scale } else { 0.0 };
        }
        walsh_hadamard(&mut readings);
        spectrum.copy_from_slice(&cosine.forward(&readings));
    }
}

/// The Walsh-Hadamard transform in place, in natural order, unnormalised.
fn walsh_hadamard(values: &mut [f32]) {
    let mut half = 1;
    while half < values.len() {
        for pair in values.chunks_exact_mut(2 * half) {
            let (low, high) = pair.split_at_mut(half);
            for (a, b) in low.iter_mut().zip(high) {
                (*a, *b) = (*a + *b, *a - *b);
            }
        }
        half *= 2;
    }
}
