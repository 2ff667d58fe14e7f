//! Many measurements of one dictionary at once, on whatever is there to compute on.
//!
//! The one law: a batch is a loop. Each solution is the one that [`Solver::solve`] finds alone, bit for bit, whatever the
//! number of threads.

use super::dictionary::{Dictionary, padded};
use super::pursuit::{Path, Solver, energy};
use super::scalar::Scalar;
use super::{Limits, OmpError, Solution, finite};
use rayon::prelude::*;
use std::fmt;
use std::str::FromStr;
use std::sync::{Mutex, PoisonError};
use thiserror::Error;

/// What computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Backend {
    /// The fastest that this build and machine have.
    #[default]
    Auto,
    /// All cores of the processor.
    Cpu,
}

/// The name of no backend.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("unknown backend {found:?}, expected auto or cpu")]
pub struct ParseBackendError {
    /// What was given.
    pub found: String,
}

impl FromStr for Backend {
    type Err = ParseBackendError;

    fn from_str(name: &str) -> Result<Self, ParseBackendError> {
        match name {
            "auto" => Ok(Self::Auto),
            "cpu" => Ok(Self::Cpu),
            _ => Err(ParseBackendError { found: name.to_owned() }),
        }
    }
}

impl fmt::Display for Backend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::Cpu => "cpu",
        })
    }
}

/// A dictionary, and when to stop: all that is common to the measurements of a batch.
#[derive(Debug)]
pub struct Problem<'d, D: ?Sized> {
    /// The atoms.
    pub dictionary: &'d D,
    /// When to stop.
    pub limits: Limits,
}

/// Most measurements whose projections are computed together: enough to share each read of the dictionary.
const TOGETHER: usize = 16;

/// Finds a sparse representation of each measurement in `y`, `measurements` numbers each, one after another.
///
/// # Errors
/// [`OmpError`] if the length of `y` is no multiple of the dictionary's measurements, a number is not finite or a limit
/// makes no sense.
pub fn solve_batch<T: Scalar, D: Dictionary<T> + ?Sized>(
    problem: &Problem<'_, D>,
    y: &[T],
    backend: Backend,
) -> Result<Vec<Solution>, OmpError> {
    Ok(solve_batch_paths(problem, y, backend)?.into_iter().map(Path::solution).collect())
}

/// [`solve_batch`] with what the pursuits know besides.
pub(super) fn solve_batch_paths<T: Scalar, D: Dictionary<T> + ?Sized>(
    problem: &Problem<'_, D>,
    y: &[T],
    backend: Backend,
) -> Result<Vec<Path<T>>, OmpError> {
    let Problem { dictionary, limits } = *problem;
    let expected = dictionary.measurements();
    if expected == 0 || !y.len().is_multiple_of(expected) {
        return Err(OmpError::Length { found: y.len(), expected });
    }
    finite("measurement", y)?;
    limits.check()?;
    match backend {
        Backend::Auto | Backend::Cpu => on_all_cores(dictionary, &limits, y),
    }
}

fn on_all_cores<T: Scalar, D: Dictionary<T> + ?Sized>(
    dictionary: &D,
    limits: &Limits,
    y: &[T],
) -> Result<Vec<Path<T>>, OmpError> {
    let expected = dictionary.measurements();
    let frames = y.len() / expected;
    if frames == 1 {
        // To wake another thread takes as long as to solve it.
        return Ok(vec![Solver::new(dictionary, limits)?.solve(y)?]);
    }
    let width = padded(dictionary.atoms().count());
    let together = frames.div_ceil(rayon::current_num_threads()).clamp(1, TOGETHER);
    // As many solvers as threads, each handed from group to group with its memory warm.
    let idle = Mutex::new(Vec::new());
    let groups: Result<Vec<Vec<Path<T>>>, OmpError> = y
        .par_chunks(together * expected)
        .map(|y| {
            let waiting = idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
            let (mut solver, mut p0) = match waiting {
                Some(solver) => solver,
                None => (Solver::new(dictionary, limits)?, vec![T::default(); together * width]),
            };
            let frames = y.chunks_exact(expected);
            let projections = &mut p0[..frames.len() * width];
            dictionary.project_all(y, projections);
            let paths = frames
                .zip(projections.chunks_exact(width))
                .map(|(y, p0)| solver.solve_projected(p0, energy(y)))
                .collect();
            idle.lock().unwrap_or_else(PoisonError::into_inner).push((solver, p0));
            paths
        })
        .collect();
    Ok(groups?.into_iter().flatten().collect())
}
