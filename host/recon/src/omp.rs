//! Orthogonal matching pursuit: few atoms of a dictionary that explain a measurement.
//!
//! The one law: after every atom the coefficients are the least-squares solution over the support, so the
//! residual is orthogonal to every atom chosen and its norm never grows.
//!
//! [`mod@reference`] is the paper's Algorithm 1 line by line, in `f64`; [`fast`] finds the same support and
//! coefficients in `f32` from columns of the Gram matrix; [`sampled`] supplies those columns for Hadamard
//! measurements of an image by fast transforms, without storing a matrix.
//!
//! What the algorithm as printed leaves open, and both paths settle alike:
//! - It assumes atoms of unit norm. Atoms are normalised for the choice, coefficients are those of the atoms given.
//! - An atom of zero norm (one that the chosen patterns do not see: 4 of the 1024 DCT atoms for a random
//!   half of the rows) would divide by zero. It is left out and counted.
//! - An atom in the span of the support would put a zero on the diagonal of the Cholesky factor. Whatever has
//!   the largest correlation with the residual cannot be in that span, unless all that is left is rounding:
//!   the search ends there ([`Stop::Dependent`]).
//! - Equal correlations: the lower atom is chosen.

pub mod fast;
pub mod reference;
pub mod sampled;

use thiserror::Error;

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Most atoms to choose.
    pub sparsity: usize,
    /// Norm of the residual, relative to the measurement's, at which enough is explained; 0 never is.
    pub residual: f64,
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
        /// `dictionary` (column-major) or `measurement`.
        field: &'static str,
        /// Where.
        index: usize,
        /// What was found.
        found: f64,
    },
    /// The residual to stop at is negative or NaN.
    #[error("a residual limit of {found}, expected 0 or more")]
    Residual {
        /// What was asked for.
        found: f64,
    },
}

/// An atom this much weaker than the strongest one (norm squared) is not seen.
const UNSEEN: f64 = 1e-9;
/// A pivot under this share of its atom's norm squared is rounding (of `f32`, so that both paths agree).
const DEPENDENT: f64 = 1e-5;
/// A correlation under this share of the first one is rounding (likewise).
const ROUNDING: f64 = 1e-5;

fn check<T: Copy + Into<f64>>(
    rows: usize,
    dictionary: &[T],
    y: &[T],
    limits: &Limits,
) -> Result<(), OmpError> {
    if y.len() != rows {
        return Err(OmpError::Length { found: y.len(), expected: rows });
    }
    for (field, values) in [("dictionary", dictionary), ("measurement", y)] {
        let values = values.iter().map(|&v| v.into());
        if let Some((index, found)) = values.enumerate().find(|(_, v): &(_, f64)| !v.is_finite()) {
            return Err(OmpError::NotFinite { field, index, found });
        }
    }
    limits.check()
}

impl Limits {
    fn check(&self) -> Result<(), OmpError> {
        let sound = self.residual >= 0.0;
        if sound { Ok(()) } else { Err(OmpError::Residual { found: self.residual }) }
    }
}

#[cfg(test)]
mod tests;
