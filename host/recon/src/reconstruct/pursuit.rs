//! Pursuits of several lengths over one dictionary, with coefficients of any sign or of 0 and more.
//!
//! The one law: of `n` atoms is what a pursuit that stops at `n` finds. One without signs holds all shorter ones; one that gives
//! atoms back does not.

use crate::omp::{
    Backend, Dictionary, Limits, OmpError, Path, Solution, Stop, nonnegative, solve_path,
};

/// Which pursuit, and where.
#[derive(Debug, Clone, Copy)]
pub(super) struct How {
    /// Coefficients of 0 or more; found on the processor.
    pub non_negative: bool,
    pub backend: Backend,
}

/// Atoms and their coefficients.
pub(super) struct Found {
    pub support: Vec<usize>,
    pub coefficients: Vec<f64>,
    pub stop: Stop,
    /// How many atoms the measurements do not see.
    pub unseen: usize,
}

/// Up to each of these numbers of atoms, the last the largest; `limits` says when to stop before.
pub(super) fn pursue<D: Dictionary<f32>>(
    dictionary: &D,
    values: &[f32],
    limits: &Limits,
    how: How,
    sparsities: &[usize],
) -> Result<Vec<Found>, OmpError> {
    let up_to = |&sparsity: &usize| Limits { sparsity, ..*limits };
    if how.non_negative {
        let solve = |sparsity| nonnegative::solve(dictionary, values, &up_to(sparsity));
        return sparsities.iter().map(|sparsity| solve(sparsity).map(Found::from)).collect();
    }
    let longest = up_to(sparsities.last().unwrap_or(&0));
    let path = solve_path(dictionary, &longest, values, how.backend)?;
    Ok(sparsities.iter().map(|&atoms| Found::first(atoms, &path)).collect())
}

impl Found {
    /// The first atoms of a path.
    pub(super) fn first(atoms: usize, path: &Path<f32>) -> Self {
        Self {
            support: path.support[..atoms.min(path.support.len())].to_vec(),
            coefficients: path.coefficients(atoms),
            stop: path.stop,
            unseen: path.unseen.len(),
        }
    }
}

impl From<Solution> for Found {
    fn from(solution: Solution) -> Self {
        let Solution { support, coefficients, stop, unseen, .. } = solution;
        Self { support, coefficients, stop, unseen: unseen.len() }
    }
}
