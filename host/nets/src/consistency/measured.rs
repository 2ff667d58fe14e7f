//! The Hadamard rows from which the readings were made. Only measured rows constrain the image.

use super::SIDE;
use crate::cosine::Cosine;
use crate::separable::Separable;
use std::sync::{Arc, LazyLock};
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

    /// Whether each row was measured.
    #[cfg(feature = "gpu")]
    pub(super) fn measured(&self) -> &[bool] {
        &self.measured
    }

    /// The measured part of readings; both are given by their cosine transform.
    pub(super) fn measured_part(&self, spectrum: &[f32]) -> Vec<f32> {
        let walsh = if self.side == SIDE { &*OF_IMAGE } else { &*OF_READINGS };
        let mut coefficients = walsh.forward(spectrum);
        for (value, &measured) in coefficients.iter_mut().zip(&*self.measured) {
            *value *= if measured { 1.0 } else { 0.0 };
        }
        walsh.adjoint(&coefficients)
    }
}

/// From the cosine transform of readings to their orthonormal Walsh-Hadamard transform in natural
/// order, for readings of either side.
static OF_IMAGE: LazyLock<Separable> = LazyLock::new(|| walsh_of_cosines(SIDE));
static OF_READINGS: LazyLock<Separable> = LazyLock::new(|| walsh_of_cosines(SIDE / 2));

/// The matrix of [`OF_READINGS`], row after row.
#[cfg(feature = "gpu")]
pub(super) fn walsh_of_readings() -> &'static [f32] {
    OF_READINGS.matrix()
}

fn walsh_of_cosines(side: usize) -> Separable {
    let cosine = Cosine::<f64>::new(side, side);
    let element = |row: usize, k: usize| {
        let sign = |x: usize| if (row & x).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
        let terms = cosine.wave(k).iter().enumerate().map(|(x, value)| sign(x) * value);
        (terms.sum::<f64>() / (side as f64).sqrt()) as f32
    };
    let elements = (0..side * side).map(|i| element(i / side, i % side));
    Separable::new(elements.collect(), side)
}
