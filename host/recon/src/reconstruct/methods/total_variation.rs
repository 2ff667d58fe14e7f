//! Total variation: flat regions with edges.

use super::penalised;
use crate::reconstruct::method::{Entry, Setting};
use crate::reconstruct::{MatrixMethod, Method, Penalty};

const NAME: &str = "total variation";

/// The method with [`Penalty::TotalVariation`].
pub(in super::super) const METHOD: Method = Method(&Entry {
    argument: "tv",
    name: NAME,
    about: "Small total variation (Chambolle and Pock)",
    takes: &[Setting::Strength, Setting::WarmStart],
    with_matrix: Some(MatrixMethod::Penalty(Penalty::TotalVariation)),
    prepare: |settings| penalised::prepare(NAME, Penalty::TotalVariation, settings),
});
