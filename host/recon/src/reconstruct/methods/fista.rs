//! FISTA: few and small coefficients.

use super::penalised;
use crate::reconstruct::method::{Entry, Setting};
use crate::reconstruct::{MatrixMethod, Method, Penalty};

const NAME: &str = "FISTA";

/// The method with [`Penalty::Sparse`].
pub(in super::super) const METHOD: Method = Method(&Entry {
    argument: "fista",
    name: NAME,
    about: "Small sum of magnitudes of the coefficients (FISTA)",
    takes: &[Setting::Basis, Setting::Strength, Setting::WarmStart],
    with_matrix: Some(MatrixMethod::Penalty(Penalty::Sparse)),
    prepare: |settings| penalised::prepare(NAME, Penalty::Sparse, settings),
});
