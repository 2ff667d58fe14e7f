//! A dictionary that remembers the columns of its Gram matrix, for many measurements.
//!
//! # Invariant
//! Columns are those of the dictionary, bit for bit
//! (`tests::a_column_is_computed_once_and_is_that_of_the_dictionary`).

use super::dictionary::{Atoms, Dictionary, padded};
use super::scalar::Scalar;
use std::sync::OnceLock;

/// A dictionary whose columns are computed when they are first asked for.
pub struct Remembered<T, D> {
    dictionary: D,
    columns: Vec<OnceLock<Box<[T]>>>,
}

impl<T: Scalar, D: Dictionary<T>> Remembered<T, D> {
    /// Remembers at most all columns, `atoms * padded(atoms)` numbers.
    #[must_use]
    pub fn new(dictionary: D) -> Self {
        let columns = (0..dictionary.atoms().count()).map(|_| OnceLock::new()).collect();
        Self { dictionary, columns }
    }

    /// The dictionary itself.
    pub fn dictionary(&self) -> &D {
        &self.dictionary
    }
}

impl<T: Scalar, D: Dictionary<T>> Dictionary<T> for Remembered<T, D> {
    fn measurements(&self) -> usize {
        self.dictionary.measurements()
    }

    fn atoms(&self) -> &Atoms<T> {
        self.dictionary.atoms()
    }

    fn project(&self, y: &[T], p0: &mut [T]) {
        self.dictionary.project(y, p0);
    }

    fn project_all(&self, y: &[T], p0: &mut [T]) {
        self.dictionary.project_all(y, p0);
    }

    fn gram_column(&self, atom: usize, out: &mut [T]) {
        self.dictionary.gram_column(atom, out);
    }

    fn stored_gram_column(&self, atom: usize) -> Option<&[T]> {
        let column = self.columns.get(atom)?.get_or_init(|| {
            let mut column = vec![T::default(); padded(self.columns.len())];
            self.dictionary.gram_column(atom, &mut column);
            column.into_boxed_slice()
        });
        Some(column)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampled::{Prior, SampledHadamard};
    use crate::testing::side;
    use nirspi_patterns::basis::{Basis, Transform};

    #[test]
    fn a_column_is_computed_once_and_is_that_of_the_dictionary() {
        let (transform, prior) = (Transform::new(Basis::Dct, side(8)), Prior::none(64));
        let rows: Vec<u32> = (0..64).filter(|row| row % 3 != 1).collect();
        let plain = SampledHadamard::new(&transform, &rows, &prior);
        let remembered = Remembered::new(plain.clone());
        let mut column = vec![0.0; 64];
        for atom in [0, 17, 63] {
            plain.gram_column(atom, &mut column);
            let first = remembered.stored_gram_column(atom).unwrap();
            assert_eq!(first, column);
            assert!(std::ptr::eq(first, remembered.stored_gram_column(atom).unwrap()));
        }
        assert!(remembered.stored_gram_column(64).is_none());
    }
}
