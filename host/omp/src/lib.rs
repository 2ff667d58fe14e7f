#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! # Invariant
//! After every atom the coefficients are the least-squares solution over the support, so the
//! residual is orthogonal to every atom of the support and its norm never grows
//! (`tests::laws::what_remains_is_orthogonal_to_the_support_and_never_grows`).
//!
//! | module | contents |
//! |---|---|
//! | [`mod@reference`] | the paper's Algorithm 1 line by line, in `f64`: every other implementation is checked against it |
//! | [`Solver`] | the same support and coefficients, fast, in `f32` or `f64`, one measurement at a time |
//! | [`solve_batch`], [`solve_path`] | many measurements of one [`Problem`], or one, on a [`Backend`] chosen at run time |
//! | [`StackSolver`] | batch after batch of one [`Problem`], by a GPU as long as it works |
//! | [`Dictionary`] | the interface of a dictionary: projections, and columns of the Gram matrix |
//! | [`DenseDictionary`] | a dictionary that is a matrix |
//! | [`MixedDictionary`] | the same in `f32`, with choices in `f64` where `f32` cannot distinguish two atoms |
//! | [`Remembered`] | any dictionary, with columns of the Gram matrix that are computed once |
//! | [`nonnegative`] | non-negative coefficients |
//! | [`sampled`] | Hadamard measurements of an image, by fast transforms, without a stored matrix |
//! | `gpu` | the same on a GPU, in `f32`; with the feature of that name |
//!
//! The printed algorithm leaves these cases open. Every implementation here handles them alike:
//! - The printed algorithm assumes atoms of unit norm. Here atoms are normalised for the choice,
//!   and coefficients belong to the atoms as given.
//! - An atom of zero norm (one that the measured patterns do not see: 4 of the 1024 DCT atoms for a
//!   random half of the rows) would cause a division by zero. Such an atom is left out and counted.
//! - An atom in the span of the support would put a zero on the diagonal of the Cholesky factor.
//!   The atom with the largest correlation cannot be in that span, unless the residual is only
//!   rounding; the search then ends ([`Stop::Dependent`]). Rounding means less than 1e-5 of an
//!   atom's squared norm in `f32`, and less than 1e-10 in `f64`.
//! - Of atoms with equal correlations, the lower is chosen. Of atoms that are parallel to within
//!   rounding (random Hadamard rows see some cosines alike), only the lowest can be chosen.

pub mod backend;
mod batch;
mod dense;
mod dictionary;
mod errors;
#[cfg(feature = "gpu")]
pub mod gpu;
mod kernel;
mod mixed;
pub mod nonnegative;
mod on_backend;
mod panels;
mod path;
mod pursuit;
mod referee;
pub mod reference;
mod remembered;
pub mod sampled;
mod scalar;

pub use backend::{Backend, ParseBackendError};
pub use batch::Problem;
pub use dense::DenseDictionary;
pub use dictionary::{Atoms, Dictionary, padded};
pub use errors::BackendError;
pub use mixed::{MixedDictionary, MixedSolver};
pub use on_backend::{StackSolver, solve_batch, solve_path};
pub use path::Path;
pub use pursuit::{Solver, error_bound};
pub use remembered::Remembered;
pub use scalar::Scalar;

use thiserror::Error;

/// When a pursuit stops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Largest number of atoms.
    pub sparsity: usize,
    /// Norm of the residual, relative to the measurement's norm, at which the pursuit stops; 0
    /// means never.
    pub residual: f64,
    /// Standard deviation of a measured number's noise, in its own unit. The pursuit stops when the
    /// residual is no longer than noise alone would be, `noise * sqrt(measurements)`.
    pub noise: f64,
}

impl Limits {
    /// Stops at this number of atoms, however small the residual.
    #[must_use]
    pub fn atoms(sparsity: usize) -> Self {
        Self { sparsity, residual: 0.0, noise: 0.0 }
    }
}

/// Why a pursuit stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// The support has as many atoms as requested.
    Sparsity,
    /// The residual is as small as requested.
    Residual,
    /// No atom that the measurement sees correlates with the residual beyond rounding.
    NoAtomLeft,
    /// The best atom left is a combination of the chosen atoms, to within rounding.
    Dependent,
}

/// A sparse representation.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// Atoms in the order in which they were chosen.
    pub support: Vec<usize>,
    /// Coefficient of each atom of the support; the atoms have the norms of the dictionary as
    /// given.
    pub coefficients: Vec<f64>,
    /// Norm of the residual before the first atom and after each atom, relative to the
    /// measurement's norm.
    pub residual_norms: Vec<f64>,
    /// Why the pursuit stopped.
    pub stop: Stop,
    /// Atoms that the measurement does not see.
    pub unseen: Vec<usize>,
}

/// Why a problem is refused.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum OmpError {
    /// The measurement's length differs from the dictionary's.
    #[error("a measurement of {found} values for a dictionary of {expected} rows")]
    Length {
        /// Length of the measurement.
        found: usize,
        /// Rows of the dictionary.
        expected: usize,
    },
    /// A number is NaN or infinite.
    #[error("{field}[{index}] is {found}, expected a finite number")]
    NotFinite {
        /// `dictionary` (column-major), `measurement`, or the `projection` of the measurement onto
        /// the dictionary.
        field: &'static str,
        /// Index of the number.
        index: usize,
        /// The number.
        found: f64,
    },
    /// A limit is negative or NaN.
    #[error("a {limit} limit of {found}, expected 0 or more")]
    Limit {
        /// `residual` or `noise`.
        limit: &'static str,
        /// The limit that was given.
        found: f64,
    },
    /// The start names an atom that the dictionary does not have.
    #[error("start atom {found} does not exist, expected an atom below {atoms}")]
    Start {
        /// Number of the atom.
        found: usize,
        /// Number of atoms in the dictionary.
        atoms: usize,
    },
    /// The backend cannot compute.
    #[error(transparent)]
    Backend(#[from] BackendError),
}

fn finite<T: Copy + Into<f64>>(field: &'static str, values: &[T]) -> Result<(), OmpError> {
    let finite = |v: &T| Into::<f64>::into(*v).is_finite();
    match values.iter().position(|v| !finite(v)) {
        Some(index) => Err(OmpError::NotFinite { field, index, found: values[index].into() }),
        None => Ok(()),
    }
}

impl Limits {
    fn check(&self) -> Result<(), OmpError> {
        for (limit, found) in [("residual", self.residual), ("noise", self.noise)] {
            let sound = found >= 0.0; // NaN is not
            if !sound {
                return Err(OmpError::Limit { limit, found });
            }
        }
        Ok(())
    }

    /// Energy of the residual at which a measurement's pursuit stops.
    fn enough(&self, energy: f64, measurements: usize) -> f64 {
        (self.residual.powi(2) * energy).max(self.noise.powi(2) * measurements as f64)
    }
}

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
