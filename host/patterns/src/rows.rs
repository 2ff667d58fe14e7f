//! Which rows of the Hadamard matrix were shown, and in which order.
//!
//! # Invariant
//! A [`Rows`] has at least one row, each row belongs to its side, and no row appears twice
//! (`tests::each_fault_is_named`, `tests::whatever_is_accepted_is_sound`). [`Rows::new`] checks
//! this once, and every later stage relies on it.

use crate::Side;
use std::ops::Deref;
use std::sync::Arc;
use thiserror::Error;

/// Rows of the natural-order (Sylvester) Hadamard matrix of order `side^2`, in the order in which
/// they are shown: a whole sweep or a part of one. A clone shares the memory.
///
/// ```
/// use nirspi_patterns::{Order, Rows, RowsError, Side};
///
/// let shown = Order::CakeCutting.rows(Side::INSTRUMENT)?.first(512);
/// assert_eq!((shown.len(), shown[0]), (512, 0));
/// assert!(matches!(Rows::new(Side::INSTRUMENT, [0, 1024]), Err(RowsError::OutOfRange { index: 1, .. })));
/// # Ok::<(), RowsError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Rows {
    side: Side,
    rows: Arc<[u32]>,
}

/// What is wrong with a list of Hadamard rows. The caller adds the name of the file or order.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum RowsError {
    /// No row at all.
    #[error("h_row is empty, expected at least one row")]
    Empty,
    /// The list has not as many rows as a whole sweep.
    #[error("h_row has {found} rows, expected all {expected}")]
    Length {
        /// Number of rows in the list.
        found: usize,
        /// Number of rows in a sweep, `n^2`.
        expected: usize,
    },
    /// A row that does not exist for this side.
    #[error("h_row[{index}] is {found}, expected 0 to {last}")]
    OutOfRange {
        /// Position in the list.
        index: usize,
        /// Number of the row.
        found: i64,
        /// Number of the last row.
        last: u32,
    },
    /// A row appears twice.
    #[error("h_row[{index}] repeats row {row}, first at h_row[{first}]")]
    Repeated {
        /// Position of the second occurrence.
        index: usize,
        /// Position of the first occurrence.
        first: usize,
        /// The row.
        row: u32,
    },
}

impl Rows {
    /// Checks rows in the order in which they are shown.
    ///
    /// # Errors
    /// [`RowsError`] names the first row that is out of range or repeated, or says that the list is
    /// empty.
    pub fn new<R: Into<i64>>(
        side: Side,
        rows: impl IntoIterator<Item = R>,
    ) -> Result<Self, RowsError> {
        let last = side.area() as u32 - 1;
        let mut first_at = vec![None; side.area()];
        let mut checked = Vec::new();
        for (index, found) in rows.into_iter().map(Into::into).enumerate() {
            let row = u32::try_from(found)
                .ok()
                .filter(|&row| row <= last)
                .ok_or(RowsError::OutOfRange { index, found, last })?;
            if let Some(first) = first_at[row as usize].replace(index) {
                return Err(RowsError::Repeated { index, first, row });
            }
            checked.push(row);
        }
        if checked.is_empty() {
            return Err(RowsError::Empty);
        }
        Ok(Self::trusted(side, checked))
    }

    /// Every row in natural order.
    #[must_use]
    pub fn natural(side: Side) -> Self {
        Self::trusted(side, (0..side.area() as u32).collect())
    }

    /// Rows that are known to satisfy the invariant.
    pub fn trusted(side: Side, rows: Vec<u32>) -> Self {
        Self { side, rows: rows.into() }
    }

    /// The rows, if they are a whole sweep.
    pub fn whole(self) -> Result<Self, RowsError> {
        let expected = self.side.area();
        if self.len() == expected {
            Ok(self)
        } else {
            Err(RowsError::Length { found: self.len(), expected })
        }
    }

    /// The side of the image that the rows belong to.
    #[must_use]
    pub fn side(&self) -> Side {
        self.side
    }

    /// The rows as numbers, 0 to `side^2 - 1`.
    #[must_use]
    pub fn as_slice(&self) -> &[u32] {
        &self.rows
    }

    /// The first `count` rows: at least one, at most all of them.
    #[must_use]
    pub fn first(&self, count: usize) -> Self {
        let count = count.clamp(1, self.len());
        if count == self.len() {
            return self.clone();
        }
        Self { side: self.side, rows: self.rows[..count].into() }
    }
}

impl Deref for Rows {
    type Target = [u32];

    fn deref(&self) -> &[u32] {
        &self.rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::side;
    use proptest::prelude::*;

    #[test]
    fn each_fault_is_named() {
        let refused = |rows: &[i64]| Rows::new(side(2), rows.iter().copied()).unwrap_err();
        assert_eq!(refused(&[]), RowsError::Empty);
        assert_eq!(refused(&[0, 4]), RowsError::OutOfRange { index: 1, found: 4, last: 3 });
        assert_eq!(refused(&[0, -1]), RowsError::OutOfRange { index: 1, found: -1, last: 3 });
        let beyond = 1 << 32;
        assert_eq!(refused(&[beyond]), RowsError::OutOfRange { index: 0, found: beyond, last: 3 });
        let repeated = refused(&[3, 0, 3]);
        assert_eq!(repeated, RowsError::Repeated { index: 2, first: 0, row: 3 });
        assert_eq!(repeated.to_string(), "h_row[2] repeats row 3, first at h_row[0]");
    }

    #[test]
    fn the_first_rows_are_at_least_one_and_at_most_all() {
        let all = Rows::new(side(2), [3_u16, 1, 0, 2]).unwrap();
        assert_eq!(*all.first(2), [3, 1]);
        assert_eq!(*all.first(0), [3]);
        assert_eq!(all.first(9), all);
        assert_eq!(*Rows::natural(side(2)), [0, 1, 2, 3]);
    }

    proptest! {
        #[test]
        fn whatever_is_accepted_is_sound(
            given in prop::collection::vec(-1_i64..5, 0..5)
        ) {
            let mut sorted = given.clone();
            sorted.sort_unstable();
            sorted.dedup();
            let sound = !given.is_empty()
                && sorted.len() == given.len()
                && given.iter().all(|row| (0..4).contains(row));
            let found = Rows::new(side(2), given.iter().copied());
            prop_assert_eq!(found.is_ok(), sound);
            if let Ok(rows) = found {
                prop_assert!(rows.iter().map(|&row| i64::from(row)).eq(given));
            }
        }
    }
}
