//! Pursues many measurements of one dictionary at once, on the processor.
//!
//! # Invariant
//! Each solution of a batch is the one that [`Solver::solve`] finds alone, bit for
//! bit, whatever the number of threads (`tests::batch::a_batch_is_a_loop`).

use super::dictionary::{Dictionary, padded};
use super::path::Path;
use super::pursuit::{Solver, energy};
use super::referee::Referee;
use super::scalar::Scalar;
use super::{Limits, OmpError, finite};
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// The common part of the measurements of a batch: a dictionary, and when to stop.
#[derive(Debug)]
pub struct Problem<'d, D: ?Sized> {
    /// The atoms.
    pub dictionary: &'d D,
    /// When the pursuit stops.
    pub limits: Limits,
}

/// Largest number of measurements projected together: enough to share each read of the dictionary.
const TOGETHER: usize = 16;

/// [`solve_batch`](super::solve_batch) on the processor; returns the whole [`Path`] of each pursuit.
pub(super) fn solve_batch_paths<T: Scalar, D: Dictionary<T> + ?Sized>(
    problem: &Problem<'_, D>,
    y: &[T],
) -> Result<Vec<Path<T>>, OmpError> {
    check(problem, y)?;
    on_all_cores(problem.dictionary, &problem.limits, y, |_| ())
}

/// [`solve_batch_paths`], with the referee that `referee_of` gives for each frame.
pub(super) fn solve_batch_with<T: Scalar, D: Dictionary<T> + ?Sized, R: Referee<T>>(
    problem: &Problem<'_, D>,
    y: &[T],
    referee_of: impl Fn(usize) -> R + Sync,
) -> Result<Vec<Path<T>>, OmpError> {
    check(problem, y)?;
    on_all_cores(problem.dictionary, &problem.limits, y, referee_of)
}

pub(super) fn check<T: Scalar, D: Dictionary<T> + ?Sized>(
    problem: &Problem<'_, D>,
    y: &[T],
) -> Result<(), OmpError> {
    let expected = problem.dictionary.measurements();
    if expected == 0 || !y.len().is_multiple_of(expected) {
        return Err(OmpError::Length { found: y.len(), expected });
    }
    finite("measurement", y)?;
    problem.limits.check()
}

fn on_all_cores<T: Scalar, D: Dictionary<T> + ?Sized, R: Referee<T>>(
    dictionary: &D,
    limits: &Limits,
    y: &[T],
    referee_of: impl Fn(usize) -> R + Sync,
) -> Result<Vec<Path<T>>, OmpError> {
    let expected = dictionary.measurements();
    let frames = y.len() / expected;
    if frames == 1 {
        // One measurement is solved on this thread: waking another thread takes as long as solving.
        return Ok(vec![Solver::new(dictionary, limits)?.solve_with(y, &mut referee_of(0))?]);
    }
    let width = padded(dictionary.atoms().count());
    let together = frames.div_ceil(rayon::current_num_threads()).clamp(1, TOGETHER);
    // One solver for each thread. A solver passes from group to group with its memory in the cache.
    let idle = Mutex::new(Vec::new());
    let groups: Result<Vec<Vec<Path<T>>>, OmpError> = y
        .par_chunks(together * expected)
        .enumerate()
        .map(|(group, y)| {
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
                .enumerate()
                .map(|(i, (y, p0))| {
                    solver.solve_projected(p0, energy(y), &mut referee_of(group * together + i))
                })
                .collect();
            idle.lock().unwrap_or_else(PoisonError::into_inner).push((solver, p0));
            paths
        })
        .collect();
    Ok(groups?.into_iter().flatten().collect())
}
