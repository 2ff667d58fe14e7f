//! What a pursuit asks of a dictionary.
//!
//! The one law: a dictionary is its measurements' inner products. Whoever can project a measurement onto all atoms
//! and supply a column of the Gram matrix on demand, from a matrix or by fast transforms, is one; a backend that wants the
//! whole Gram matrix on a device asks for its columns once.

use super::kernel::PANEL;
use super::scalar::Scalar;

/// An atom this much weaker than the strongest one (norm squared) is not seen.
pub(super) const UNSEEN: f64 = 1e-9;

/// Lengths of all atoms, as the choice needs them.
#[derive(Debug, Clone)]
pub struct Atoms<T> {
    energies: Vec<T>,
    /// Padded to whole panels; zeros are never chosen.
    inverse_norms: Vec<T>,
    unseen: Vec<usize>,
    doubles: Vec<(usize, usize)>,
    normalised: bool,
}

impl<T: Scalar> Atoms<T> {
    /// From the squared norm of each atom, the diagonal of the Gram matrix.
    #[must_use]
    pub fn new(energies: Vec<T>) -> Self {
        let strongest = energies.iter().fold(0.0, |most, &e| f64::max(most, e.into()));
        let hidden = |&k: &usize| energies[k].into() <= UNSEEN * strongest;
        let unseen = (0..energies.len()).filter(hidden).collect();
        let (inverse_norms, doubles) = (Vec::new(), Vec::new());
        Self { energies, inverse_norms, unseen, doubles, normalised: true }.weighed()
    }

    /// The same atoms, chosen by their inner products with the residual as they are: longer atoms are more attractive, if only
    /// by a rounding, so that of equal ones each stands for itself.
    #[must_use]
    pub fn unnormalised(self) -> Self {
        Self { normalised: false, doubles: Vec::new(), ..self }.weighed()
    }

    /// The same atoms, of which some pairs, the lower atom first, point the same or the opposite way. Of those the lower
    /// stands for all: rounding alone would decide between them.
    #[must_use]
    pub(super) fn with_doubles(self, doubles: Vec<(usize, usize)>) -> Self {
        Self { doubles, ..self }.weighed()
    }

    /// Pairs of atoms that the measurement cannot tell apart.
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

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.energies.len()
    }

    /// Squared norm of each.
    #[must_use]
    pub fn energies(&self) -> &[T] {
        &self.energies
    }

    /// Atoms that the measurement does not see.
    #[must_use]
    pub fn unseen(&self) -> &[usize] {
        &self.unseen
    }

    /// Whether they are chosen by correlation.
    #[cfg(feature = "gpu")]
    pub(super) fn is_normalised(&self) -> bool {
        self.normalised
    }

    pub(super) fn inverse_norms(&self) -> &[T] {
        &self.inverse_norms
    }
}

/// Atoms, as their inner products with measurements and with each other. Vectors over the atoms are
/// [`padded`], zero past the last atom.
pub trait Dictionary<T: Scalar>: Sync {
    /// Length of a measurement.
    fn measurements(&self) -> usize;

    /// Lengths of the atoms.
    fn atoms(&self) -> &Atoms<T>;

    /// The initial projection: inner product of the measurement `y` with each atom.
    fn project(&self, y: &[T], p0: &mut [T]);

    /// [`project`](Self::project) of several measurements of equal length, one after another; the same numbers.
    fn project_all(&self, y: &[T], p0: &mut [T]) {
        let width = padded(self.atoms().count());
        for (y, p0) in y.chunks_exact(self.measurements()).zip(p0.chunks_exact_mut(width)) {
            self.project(y, p0);
        }
    }

    /// Writes column `atom` of the Gram matrix: its inner products with every atom.
    fn gram_column(&self, atom: usize, out: &mut [T]);

    /// The same column where it is stored.
    fn stored_gram_column(&self, _atom: usize) -> Option<&[T]> {
        None
    }
}

/// Length of a vector over this many atoms: whole panels of 64.
#[must_use]
pub fn padded(atoms: usize) -> usize {
    atoms.next_multiple_of(PANEL)
}
