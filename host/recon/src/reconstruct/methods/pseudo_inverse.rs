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
    about: "Image of smallest norm that agrees with the measurements. For Hadamard patterns, the same as hadamard; not with --matrix",
    takes: &[],
    with_matrix: Some(MatrixMethod::PseudoInverse),
    prepare: |_| Ok(Box::new(ZeroFilling { name: NAME })),
});
