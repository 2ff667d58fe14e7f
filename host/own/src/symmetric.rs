//! A symmetric matrix in single precision, as which [`gram`](super::gram) computes it: half the memory through which each
//! product with a vector has to pass.

use nalgebra::{DMatrix, DVector};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::ops::Range;

/// A symmetric matrix.
pub(super) struct Symmetric {
    entries: DMatrix<f32>,
    /// By which the entries are multiplied, so that they are in the range of `f32` whatever their units.
    unit: f64,
}

impl Symmetric {
    /// These entries times `unit`.
    pub(super) fn new(entries: DMatrix<f64>, unit: f64) -> Self {
        Self { entries: entries.map(|entry| entry as f32), unit }
    }

    /// The rows and columns at these places, which follow each other.
    pub(super) fn of_some(&self, places: Range<usize>) -> Self {
        let (first, count) = (places.start, places.len());
        let entries = self.entries.view((first, first), (count, count)).into_owned();
        Self { entries, unit: self.unit }
    }

    pub(super) fn diagonal(&self) -> DVector<f64> {
        self.entries.diagonal().map(|entry| f64::from(entry) * self.unit)
    }

    /// The product with a vector.
    pub(super) fn times(&self, vector: &DVector<f64>) -> DVector<f64> {
        self.times_each(&[vector]).remove(0)
    }

    /// The products with some vectors, in one pass.
    pub(super) fn times_each(&self, vectors: &[&DVector<f64>]) -> Vec<DVector<f64>> {
        let size = self.entries.nrows();
        let vectors: Vec<&[f64]> = vectors.iter().map(|vector| vector.as_slice()).collect();
        let dots = |row| Arch::new().dispatch(Dots { row, vectors: &vectors });
        let rows: Vec<Vec<f64>> =
            self.entries.as_slice().par_chunks_exact(size).map(dots).collect();
        let of =
            |at: usize| DVector::from_iterator(size, rows.iter().map(|row| row[at] * self.unit));
        (0..vectors.len()).map(of).collect()
    }
}

/// The inner products of a row with some vectors, as a type, because `pulp` compiles a type's method
/// for each vector width.
struct Dots<'a> {
    row: &'a [f32],
    vectors: &'a [&'a [f64]],
}

impl WithSimd for Dots<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Vec<f64> {
        // A closure would be compiled by itself, without the vectors.
        let mut found = Vec::with_capacity(self.vectors.len());
        for vector in self.vectors {
            found.push(dot(self.row, vector));
        }
        found
    }
}

/// Sums side by side, because the order of one sum would allow no vectors.
#[inline(always)]
fn dot(row: &[f32], vector: &[f64]) -> f64 {
    let mut sums = [0.0; 32];
    let ((rows, last), (vectors, end)) = (row.as_chunks::<32>(), vector.as_chunks::<32>());
    for (row, vector) in rows.iter().zip(vectors) {
        for ((sum, a), b) in sums.iter_mut().zip(row).zip(vector) {
            *sum += f64::from(*a) * b;
        }
    }
    let rest: f64 = last.iter().zip(end).map(|(a, b)| f64::from(*a) * b).sum();
    sums.iter().sum::<f64>() + rest
}
