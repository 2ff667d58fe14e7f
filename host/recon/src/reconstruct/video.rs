//! OMP over the frames of a video.
//!
//! The one law: what was decided on one frame holds for the next as long as it explains the next as well. That is the noise, the
//! prior, the number of atoms and the trust in them, and most of the atoms: of a frame's support the first
//! three quarters are taken over with their orthogonalised columns, and the others chosen anew. A frame of which more is left
//! than that allows, or that has other rows, starts from scratch, and a new scene with it.

use super::pursuit::Found;
use super::{
    OmpReconstruction, OmpSettings, Problem, ReconstructError, choose_atoms, omp, reconstruction,
};
use crate::Measurements;
use crate::omp::{Limits, Solver};

/// Of four atoms, how many are taken over.
const KEPT_OF_FOUR: usize = 3;

/// Residual of a frame, relative to that of its scene's first one, above which the atoms no longer fit: the residual of
/// some hundred measurements that are noise differs from one frame to the next by this much.
const WORSE: f64 = 1.05;

/// A frame of a video.
#[derive(Debug, Clone, PartialEq)]
pub struct VideoFrame {
    /// As [`omp()`] has it.
    pub reconstruction: OmpReconstruction,
    /// Whether it started from the frame before.
    pub warm: bool,
}

/// [`omp()`] of one frame after another, each from where the one before it ended. Coefficients of 0 or more are found from
/// scratch for each.
///
/// # Errors
/// As [`omp()`].
pub fn omp_video(
    frames: &[Measurements],
    settings: &OmpSettings,
) -> Result<Vec<VideoFrame>, ReconstructError> {
    settings.check()?;
    let mut done = Vec::with_capacity(frames.len());
    if settings.non_negative {
        for frame in frames {
            done.push(VideoFrame { reconstruction: omp(frame, settings)?, warm: false });
        }
        return Ok(done);
    }
    while done.len() < frames.len() {
        let scene = &frames[done.len()..];
        add_scene(&scene[0], &scene[1..], settings, &mut done)?;
    }
    Ok(done)
}

/// Adds `first`, and as many frames after it as its atoms explain.
fn add_scene(
    first: &Measurements,
    after: &[Measurements],
    settings: &OmpSettings,
    done: &mut Vec<VideoFrame>,
) -> Result<(), ReconstructError> {
    let mut problem = Problem::new(first, settings);
    let choice = choose_atoms(&problem, settings)?;
    let (transform, prior) = (problem.transform.clone(), problem.prior.clone());
    let dictionary = crate::omp::sampled::SampledHadamard::new(&transform, problem.rows, &prior);
    let limits = Limits { sparsity: choice.atoms, ..problem.limits() };
    let mut solver = Solver::new(&dictionary, &limits)?;
    let mut start = Vec::new();
    let mut first_residual = None;
    for frame in std::iter::once(first).chain(after) {
        if frame.rows() != problem.rows {
            break;
        }
        problem.values = problem.in_units(frame);
        let path = solver.solve_from(&problem.values, &start)?;
        let found = Found::first(choice.atoms, &path);
        let predicted = dictionary.predict(&found.support, &found.coefficients);
        let made = reconstruction(&problem, found, predicted, settings.completion, choice.trust);
        if made.residual > WORSE * *first_residual.get_or_insert(made.residual) {
            break;
        }
        start = path.support;
        start.truncate(start.len() * KEPT_OF_FOUR / 4);
        done.push(VideoFrame { reconstruction: made, warm: !std::ptr::eq(frame, first) });
    }
    Ok(())
}
