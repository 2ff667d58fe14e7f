//! Tikhonov's method, with a covariance prior.

use super::penalised;
use crate::reconstruct::method::{Entry, Setting};
use crate::reconstruct::{MatrixMethod, Method, Penalty};

const NAME: &str = "Tikhonov";

/// The method with [`Penalty::Tikhonov`].
pub(in super::super) const METHOD: Method = Method(&Entry {
    argument: "tikhonov",
    name: NAME,
    about: "Most likely image if coefficients fall as one over frequency (Tikhonov, a covariance prior)",
    takes: &[Setting::Basis, Setting::Strength],
    with_matrix: Some(MatrixMethod::Penalty(Penalty::Tikhonov)),
    prepare: |settings| penalised::prepare(NAME, Penalty::Tikhonov, settings),
});
