//! Orthogonal matching pursuit: few atoms of a dictionary that explain a measurement.
//!
//! The one law: after every atom the coefficients are the least-squares solution over the support, so the
//! residual is orthogonal to every atom chosen and its norm never grows.
//!
//! | module | holds |
//! |---|---|
//! | [`mod@reference`] | the paper's Algorithm 1 line by line, in `f64`: what the others are checked against |
//! | [`Solver`] | the same support and coefficients, fast, in `f32` or `f64`, one measurement at a time |
//! | [`solve_batch`], [`solve_path`] | many measurements of one [`Problem`], or one, on a [`Backend`] chosen at run time |
//! | [`Dictionary`] | what both ask of the atoms: projections, and columns of the Gram matrix |
//! | [`DenseDictionary`] | a dictionary that is a matrix |
//! | [`MixedDictionary`] | the same in `f32`, with choices in `f64` where `f32` cannot tell two atoms apart |
//! | [`nonnegative`] | coefficients of 0 or more |
//! | [`sampled`] | Hadamard measurements of an image, by fast transforms, without storing a matrix |
//! | `gpu` | the same on a GPU, in `f32`; with the feature of that name |
//!
//! What the algorithm as printed leaves open, and both paths settle alike:
//! - It assumes atoms of unit norm. Atoms are normalised for the choice, coefficients are those of the atoms given.
//! - An atom of zero norm (one that the chosen patterns do not see: 4 of the 1024 DCT atoms for a random
//!   half of the rows) would divide by zero. It is left out and counted.
//! - An atom in the span of the support would put a zero on the diagonal of the Cholesky factor. Whatever has
//!   the largest correlation with the residual cannot be in that span, unless all that is left is rounding:
//!   the search ends there ([`Stop::Dependent`]). What is rounding depends on the number type: under 1e-5 of an atom's norm
//!   squared in `f32`, 1e-10 in `f64`.
//! - Equal correlations: the lower atom is chosen. Of atoms that point the same way to rounding (random Hadamard rows see some
//!   cosines alike) the lower stands for all.

mod backend;
mod batch;
mod dense;
mod dictionary;
#[cfg(feature = "gpu")]
pub mod gpu;
mod kernel;
mod mixed;
pub mod nonnegative;
mod panels;
mod path;
mod pursuit;
mod referee;
pub mod reference;
pub mod sampled;
mod scalar;

pub use crate::backend::{Backend, ParseBackendError};
pub use backend::BackendError;
pub use batch::{Problem, solve_batch, solve_path};
pub use dense::DenseDictionary;
pub use dictionary::{Atoms, Dictionary, padded};
pub use mixed::{MixedDictionary, MixedSolver};
pub use path::Path;
pub use pursuit::{Solver, error_bound};
pub use scalar::Scalar;

use thiserror::Error;

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Most atoms to choose.
    pub sparsity: usize,
    /// Norm of the residual, relative to the measurement's, at which enough is explained; 0 never is.
    pub residual: f64,
    /// Standard deviation of a measured number's noise, in its own unit: a residual that is no longer than noise
    /// alone would be, `noise * sqrt(measurements)`, is explained enough.
    pub noise: f64,
}

impl Limits {
    /// This many atoms, however small the residual.
    #[must_use]
    pub fn atoms(sparsity: usize) -> Self {
        Self { sparsity, residual: 0.0, noise: 0.0 }
    }
}

/// Why the search stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// As many atoms as were asked for.
    Sparsity,
    /// The residual is as small as was asked for.
    Residual,
    /// No atom that the measurement sees correlates with the residual beyond rounding.
    NoAtomLeft,
    /// The best atom left is a combination of those chosen, to rounding.
    Dependent,
}

/// A sparse representation.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// Atoms in the order in which they were chosen.
    pub support: Vec<usize>,
    /// Coefficient of each atom of the support, for the dictionary as given.
    pub coefficients: Vec<f64>,
    /// Norm of the residual before the first and after each atom, relative to the measurement's.
    pub residual_norms: Vec<f64>,
    /// Why there are no more.
    pub stop: Stop,
    /// Atoms that the measurement does not see.
    pub unseen: Vec<usize>,
}

/// A problem that has no solution to look for.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum OmpError {
    /// The measurement does not fit the dictionary.
    #[error("a measurement of {found} values for a dictionary of {expected} rows")]
    Length {
        /// Values measured.
        found: usize,
        /// Rows of the dictionary.
        expected: usize,
    },
    /// A number is NaN or infinite.
    #[error("{field}[{index}] is {found}, expected a finite number")]
    NotFinite {
        /// `dictionary` (column-major), `measurement`, or `projection` of one onto the other.
        field: &'static str,
        /// Where.
        index: usize,
        /// What was found.
        found: f64,
    },
    /// A limit is negative or NaN.
    #[error("a {limit} limit of {found}, expected 0 or more")]
    Limit {
        /// `residual` or `noise`.
        limit: &'static str,
        /// What was asked for.
        found: f64,
    },
    /// A pursuit is to start from an atom that there is not.
    #[error("a start from atom {found} of a dictionary of {atoms}")]
    Start {
        /// The atom.
        found: usize,
        /// How many there are.
        atoms: usize,
    },
    /// What was to compute it cannot.
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

    /// Energy of the residual at which enough of a measurement's is explained.
    fn enough(&self, energy: f64, measurements: usize) -> f64 {
        (self.residual.powi(2) * energy).max(self.noise.powi(2) * measurements as f64)
    }
}

#[cfg(test)]
mod tests;
