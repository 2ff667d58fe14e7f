//! The interface of a dictionary for a pursuit.
//!
//! A pursuit needs only inner products: the projection of a measurement onto all atoms, and columns
//! of the Gram matrix on demand. A dictionary may compute them from a matrix or by fast transforms.
//! A backend that keeps the whole Gram matrix on a device asks for each column once.

use super::kernel::PANEL;
use super::scalar::Scalar;

/// An atom is not seen if its squared norm is below this share of the strongest atom's.
pub(super) const UNSEEN: f64 = 1e-9;

/// The norms of all atoms, in the form that the choice needs.
#[derive(Debug, Clone)]
pub struct Atoms<T> {
    energies: Vec<T>,
    /// One over each norm, padded to whole panels. An atom with a zero here is never chosen.
    inverse_norms: Vec<T>,
    unseen: Vec<usize>,
    doubles: Vec<(usize, usize)>,
    normalised: bool,
}

impl<T: Scalar> Atoms<T> {
    /// Atoms with these squared norms, the diagonal of the Gram matrix.
    #[must_use]
    pub fn new(energies: Vec<T>) -> Self {
        let strongest = energies.iter().fold(0.0, |most, &e| f64::max(most, e.into()));
        let hidden = |&k: &usize| energies[k].into() <= UNSEEN * strongest;
        let unseen = (0..energies.len()).filter(hidden).collect();
        let (inverse_norms, doubles) = (Vec::new(), Vec::new());
        Self { energies, inverse_norms, unseen, doubles, normalised: true }.weighed()
    }

    /// The same atoms, chosen by their plain inner products with the residual. A longer atom then
    /// wins, if only by a rounding, so every one of several equal atoms stays eligible.
    #[must_use]
    pub fn unnormalised(self) -> Self {
        Self { normalised: false, doubles: Vec::new(), ..self }.weighed()
    }

    /// The same atoms, of which these pairs (the lower atom first) are parallel. Only the lower
    /// atom of a pair can be chosen, because rounding alone would decide between the two.
    #[must_use]
    pub(super) fn with_doubles(self, doubles: Vec<(usize, usize)>) -> Self {
        Self { doubles, ..self }.weighed()
    }

    /// Pairs of atoms that the measurement cannot distinguish.
    #[must_use]
    pub fn doubles(&self) -> &[(usize, usize)] {
        &self.doubles
    }

    fn weighed(mut self) -> Self {
        let weight = |&energy: &T| match self.normalised {
            true => T::from_f64(energy.into().sqrt().recip()),
            false => T::from_f64(1.0),
        };
        self.inverse_norms = self.energies.iter().map(weight).collect();
        self.inverse_norms.resize(padded(self.energies.len()), T::default());
        let shadowed = self.doubles.iter().map(|&(_, higher)| higher);
        for k in self.unseen.iter().copied().chain(shadowed) {
            self.inverse_norms[k] = T::default();
        }
        self
    }

    /// Number of atoms.
    #[must_use]
    pub fn count(&self) -> usize {
        self.energies.len()
    }

    /// Squared norm of each atom.
    #[must_use]
    pub fn energies(&self) -> &[T] {
        &self.energies
    }

    /// Atoms that the measurement does not see.
    #[must_use]
    pub fn unseen(&self) -> &[usize] {
        &self.unseen
    }

    /// Whether atoms are chosen by correlation.
    #[cfg(feature = "gpu")]
    pub(super) fn is_normalised(&self) -> bool {
        self.normalised
    }

    pub(super) fn inverse_norms(&self) -> &[T] {
        &self.inverse_norms
    }
}

/// A dictionary: inner products of its atoms with measurements and with each other. Vectors over
/// the atoms have [`padded`] length, with zeros after the last atom.
pub trait Dictionary<T: Scalar>: Sync {
    /// Length of a measurement.
    fn measurements(&self) -> usize;

    /// The norms of the atoms.
    fn atoms(&self) -> &Atoms<T>;

    /// The initial projection: inner product of the measurement `y` with each atom.
    fn project(&self, y: &[T], p0: &mut [T]);

    /// [`project`](Self::project) of several measurements, one after another, with the same
    /// results.
    fn project_all(&self, y: &[T], p0: &mut [T]) {
        let width = padded(self.atoms().count());
        for (y, p0) in y.chunks_exact(self.measurements()).zip(p0.chunks_exact_mut(width)) {
            self.project(y, p0);
        }
    }

    /// Writes column `atom` of the Gram matrix: the atom's inner products with every atom.
    fn gram_column(&self, atom: usize, out: &mut [T]);

    /// Column `atom` of the Gram matrix, if it is stored.
    fn stored_gram_column(&self, _atom: usize) -> Option<&[T]> {
        None
    }
}

/// Length of a vector over this many atoms: a multiple of 64, the panel size.
#[must_use]
pub fn padded(atoms: usize) -> usize {
    atoms.next_multiple_of(PANEL)
}
