//! The list of the built-in methods. A new method is a file here and an entry in [`Method::ALL`].

mod auto;
mod fista;
mod hadamard;
mod omp;
mod penalised;
mod prior;
mod pseudo_inverse;
mod tikhonov;
mod total_variation;

use super::Method;
use fista::METHOD as FISTA;
pub use hadamard::hadamard;
use total_variation::METHOD as TOTAL_VARIATION;

impl Method {
    /// Every built-in method, in the order in which help texts and comparisons show them: the simplest first.
    pub const ALL: &'static [Self] = &[
        hadamard::METHOD,
        omp::METHOD,
        pseudo_inverse::METHOD,
        tikhonov::METHOD,
        fista::METHOD,
        total_variation::METHOD,
        prior::METHOD,
        auto::METHOD,
    ];

    /// The inverse transform, with zeros for the patterns that were not measured: the quickest.
    pub const HADAMARD: Self = hadamard::METHOD;

    /// Orthogonal matching pursuit, the paper's method.
    pub const OMP: Self = omp::METHOD;

    /// The method that held-back readings choose, the default.
    pub const AUTO: Self = auto::METHOD;

    /// Tikhonov's method, with a covariance prior.
    pub const TIKHONOV: Self = tikhonov::METHOD;

    /// Total variation.
    pub const TOTAL_VARIATION: Self = total_variation::METHOD;

    /// The learned prior, which needs [`MethodSettings::network`](super::MethodSettings::network); `nirspi_nets::prior::settings`
    /// has the shipped one.
    pub const PRIOR: Self = prior::METHOD;
}
