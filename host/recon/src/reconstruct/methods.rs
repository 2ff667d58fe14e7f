//! The list of the built-in methods. A new method is a file here and an entry in [`ALL`].

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
pub(super) use auto::METHOD as AUTO;
use fista::METHOD as FISTA;
pub(super) use hadamard::METHOD as HADAMARD;
pub use hadamard::hadamard;
pub(super) use omp::METHOD as OMP;
pub(super) use prior::METHOD as PRIOR;
pub(super) use tikhonov::METHOD as TIKHONOV;
use total_variation::METHOD as TOTAL_VARIATION;

/// Every built-in method, in the order in which help texts and comparisons show them.
pub(super) const ALL: &[Method] = &[
    hadamard::METHOD,
    omp::METHOD,
    pseudo_inverse::METHOD,
    tikhonov::METHOD,
    fista::METHOD,
    total_variation::METHOD,
    prior::METHOD,
    auto::METHOD,
];
