//! Names and settings of the methods for a user's own patterns instead of Hadamard rows, which are in the crate
//! `nirspi-own`.

use super::Penalty;
use crate::basis::Basis;

/// The method of inversion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MatrixMethod {
    /// Tikhonov's or total variation, whichever better predicts held-back measurements. Tikhonov's
    /// for as many orthogonal patterns as pixels, for over 2^20 weights, for atoms of one's own, and
    /// where the strength is given.
    Best,
    /// Least squares of least norm.
    PseudoInverse,
    /// The minimum of a sum with a penalty.
    Penalty(Penalty),
    /// Few coefficients.
    Omp,
}

/// Settings of a method for a user's own patterns.
#[derive(Debug, Clone, PartialEq)]
pub struct MatrixSettings {
    /// The method of inversion.
    pub method: MatrixMethod,
    /// Basis of the coefficients.
    pub basis: Basis,
    /// Images of the matrix's size, one after another, as atoms instead of a basis.
    pub atoms: Option<Vec<f32>>,
    /// Strength of a penalty, `t` in the table of `nirspi-own`. By default, the strength that best
    /// predicts held-back measurements.
    pub strength: Option<f64>,
    /// Number of atoms for OMP. By default, the number that best predicts held-back measurements.
    pub sparsity: Option<usize>,
    /// Whether OMP's coefficients must be non-negative.
    pub non_negative: bool,
    /// Whether a dark level is fitted with the image.
    pub dark: bool,
    /// Standard deviation of the noise of a measurement, if it is known. Tikhonov's strength is then
    /// the one at which the measurements are most likely.
    pub noise: Option<f64>,
    /// What that noise is at most, for each of the measurements, where it is not known and more than the measurement says so.
    /// Only complete sets of orthogonal patterns need it: other measurements predict each other.
    pub most_noise: Vec<Option<f64>>,
    /// Whether held-back measurements are to say how well the others predict them, where it does not take long.
    pub judge: bool,
}

impl MatrixSettings {
    /// Default settings: all values are found from the measurements, in the DCT basis.
    #[must_use]
    pub fn new(method: MatrixMethod) -> Self {
        let (atoms, strength, sparsity) = (None, None, None);
        Self {
            method,
            basis: Basis::Dct,
            atoms,
            strength,
            sparsity,
            non_negative: false,
            dark: true,
            noise: None,
            most_noise: Vec::new(),
            judge: true,
        }
    }

    /// The settings of these measurements alone, by their numbers.
    #[must_use]
    pub fn of_some(&self, which: &[usize]) -> Self {
        let most_noise = &self.most_noise;
        let most_noise = which.iter().map(|&at| most_noise.get(at).copied().flatten()).collect();
        Self { most_noise, ..self.clone() }
    }
}
