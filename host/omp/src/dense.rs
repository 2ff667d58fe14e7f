//! A dictionary that is a matrix.
//!
//! Everything that does not depend on a measurement is computed once, as far as the given memory
//! allows.

use super::dictionary::{Atoms, Dictionary};
use super::panels::Panels;
use super::scalar::Scalar;
use nalgebra::DMatrix;
use pulp::Arch;
use rayon::prelude::*;

/// A `measurements x atoms` matrix with any column norms, prepared for any number of measurements.
#[derive(Debug, Clone)]
pub struct DenseDictionary<T> {
    panels: Panels<T>,
    atoms: Atoms<T>,
    /// The whole Gram matrix, in rows of `padded(atoms)`; empty if columns are computed on demand.
    gram: Vec<T>,
    width: usize,
    arch: Arch,
}

impl<T: Scalar> DenseDictionary<T> {
    /// Default memory limit of the Gram matrix in bytes: 8192 atoms in `f32`.
    pub const GRAM_BYTES: usize = 256 << 20;

    /// Prepares `matrix`: copies it, and computes its Gram matrix if that fits
    /// [`GRAM_BYTES`](Self::GRAM_BYTES).
    #[must_use]
    pub fn new(matrix: &DMatrix<T>) -> Self {
        Self::with_gram_within(matrix, Self::GRAM_BYTES)
    }

    /// Prepares `matrix`. If the Gram matrix is larger than `bytes`, a column is computed when its
    /// atom is chosen, with `measurements * atoms` products.
    #[must_use]
    pub fn with_gram_within(matrix: &DMatrix<T>, bytes: usize) -> Self {
        Self::on(Arch::new(), matrix, bytes)
    }

    /// The same dictionary, with atoms chosen by their plain inner products with the residual, as
    /// in programs that expect atoms of unit norm.
    #[must_use]
    pub fn unnormalised(mut self) -> Self {
        self.atoms = self.atoms.unnormalised();
        self
    }

    pub(super) fn on(arch: Arch, matrix: &DMatrix<T>, bytes: usize) -> Self {
        let panels = Panels::new(matrix);
        let width = super::padded(matrix.ncols());
        let fits = width.saturating_mul(width).saturating_mul(size_of::<T>()) <= bytes;
        let mut gram = if fits { panels.gram(arch) } else { Vec::new() };
        let energies: Vec<T> = (0..matrix.ncols())
            .map(|atom| match gram.get(atom * width + atom) {
                Some(&energy) => energy,
                // The sum has the order of the Gram matrix's sums, so both give the same bits.
                None => matrix.column(atom).iter().fold(T::default(), |sum, &v| sum + v * v),
            })
            .collect();
        clear_rounding(&energies, &mut gram, width);
        let atoms = Atoms::new(energies);
        let doubles = doubles(&atoms, &gram, width);
        Self { panels, atoms: atoms.with_doubles(doubles), gram, width, arch }
    }

    /// Replaces the pairs of atoms that count as parallel.
    pub(super) fn with_doubles(mut self, doubles: Vec<(usize, usize)>) -> Self {
        self.atoms = self.atoms.with_doubles(doubles);
        self
    }
}

/// An inner product below this share of an epsilon, relative to the atoms' norms, is the rounding
/// of 0.
const NOTHING: f64 = 1e-3;

/// Sets inner products that are only rounding to zero. Orthogonal atoms (cosines measured by
/// Hadamard rows are orthogonal in blocks) otherwise have inner products of 1e-18 or 1e-35, whose
/// products fall below the normal range of `f32`, where arithmetic is many times slower.
fn clear_rounding<T: Scalar>(energies: &[T], gram: &mut [T], width: usize) {
    gram.par_chunks_exact_mut(width).zip(energies).for_each(|(row, &own)| {
        let least = own * T::from_f64((NOTHING * T::EPSILON).powi(2));
        for (value, &other) in row.iter_mut().zip(energies) {
            if *value * *value < least * other {
                *value = T::default();
            }
        }
    });
}

/// Pairs of parallel atoms, the lower first: one atom explains the other to within rounding.
fn doubles<T: Scalar>(atoms: &Atoms<T>, gram: &[T], width: usize) -> Vec<(usize, usize)> {
    let energies = atoms.energies();
    let seen = |k: usize| !atoms.unseen().contains(&k);
    let like = T::from_f64(1.0 - T::DEPENDENT);
    gram.par_chunks_exact(width)
        .take(energies.len())
        .enumerate()
        .flat_map_iter(|(i, row)| {
            let least = like * energies[i];
            let same = move |&j: &usize| row[j] * row[j] >= least * energies[j];
            (i + 1..energies.len())
                .filter(same)
                .filter(|&j| seen(i) && seen(j))
                .map(move |j| (i, j))
                .collect::<Vec<_>>()
        })
        .collect()
}

impl<T: Scalar> Dictionary<T> for DenseDictionary<T> {
    fn measurements(&self) -> usize {
        self.panels.measurements()
    }

    fn atoms(&self) -> &Atoms<T> {
        &self.atoms
    }

    fn project(&self, y: &[T], p0: &mut [T]) {
        self.panels.products(self.arch, y, p0);
    }

    fn project_all(&self, y: &[T], p0: &mut [T]) {
        self.panels.products(self.arch, y, p0);
    }

    fn gram_column(&self, atom: usize, out: &mut [T]) {
        self.panels.products(self.arch, &self.panels.column(atom), out);
    }

    fn stored_gram_column(&self, atom: usize) -> Option<&[T]> {
        self.gram.get(atom * self.width..(atom + 1) * self.width)
    }
}
