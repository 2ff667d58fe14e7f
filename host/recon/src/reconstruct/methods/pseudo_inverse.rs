//! The pseudo-inverse. Hadamard rows are orthogonal, so their pseudo-inverse is zero filling. A
//! user's own patterns need a solver.

use super::hadamard::ZeroFilling;
use crate::reconstruct::method::Entry;
use crate::reconstruct::{MatrixMethod, Method};

const NAME: &str = "pseudo-inverse";

/// The method of least squares with least norm.
pub(in super::super) const METHOD: Method = Method(&Entry {
    argument: NAME,
    name: NAME,
    about: "Least image that agrees with the measurements: as Hadamard rows are orthogonal, the same as hadamard",
    takes: &[],
    with_matrix: Some(MatrixMethod::PseudoInverse),
    prepare: |_| Ok(Box::new(ZeroFilling { name: NAME })),
});
