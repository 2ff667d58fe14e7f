//! Pursuits with several numbers of atoms over one dictionary, with signed or non-negative
//! coefficients.
//!
//! The result for `n` atoms is that of a pursuit that stops at `n`. One signed pursuit contains all
//! shorter ones. A non-negative pursuit can remove atoms, so each number of atoms needs its own
//! pursuit.

use crate::omp::{
    Backend, Dictionary, Limits, OmpError, Path, Solution, Stop, nonnegative, solve_path,
};

/// The kind of pursuit, and its backend.
#[derive(Debug, Clone, Copy)]
pub(super) struct How {
    /// Non-negative coefficients; computed on the processor.
    pub non_negative: bool,
    pub backend: Backend,
}

/// Atoms and their coefficients.
pub(super) struct Found {
    pub support: Vec<usize>,
    pub coefficients: Vec<f64>,
    pub stop: Stop,
    /// Number of atoms that the measurements do not see.
    pub unseen: usize,
}

/// Pursues up to each of these numbers of atoms, the last number the largest; `limits` can stop a
/// pursuit earlier.
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
    /// The solution with the first atoms of a path.
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
