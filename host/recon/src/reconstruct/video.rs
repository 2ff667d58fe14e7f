//! OMP over the frames of a video.
//!
//! Noise, prior, number of atoms and trust are computed on a scene's first frame, and stay for the
//! next frames as long as they explain them as well. Of a frame's support, the next frame takes
//! over the first three quarters with their orthogonalised columns, and chooses the other atoms
//! again. A frame with other rows, or with too large a residual, starts a new scene from scratch
//! (`tests::frames_of_a_video_start_from_the_one_before_until_the_scene_changes`).

use super::pursuit::Found;
use super::{
    OmpReconstruction, OmpSettings, Problem, ReconstructError, choose_atoms, omp, reconstruction,
};
use crate::Measurements;
use crate::omp::{Limits, Solver};

/// Number of atoms, of every four, that the next frame takes over.
const KEPT_OF_FOUR: usize = 3;

/// Residual of a frame, relative to that of its scene's first frame, above which the atoms no
/// longer fit. The residual of some hundred measurements of noise varies between frames by this
/// much.
const WORSE: f64 = 1.05;

/// A frame of a video.
#[derive(Debug, Clone, PartialEq)]
pub struct VideoFrame {
    /// The frame's reconstruction, as from [`omp()`].
    pub reconstruction: OmpReconstruction,
    /// Whether the frame started from the previous one.
    pub warm: bool,
}

/// [`omp()`] of one frame after another, each starting from the previous one. With non-negative
/// coefficients every frame starts from scratch.
///
/// # Errors
/// The errors of [`omp()`].
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

/// Adds `first`, and as many later frames as its atoms explain.
fn add_scene(
    first: &Measurements,
    after: &[Measurements],
    settings: &OmpSettings,
    done: &mut Vec<VideoFrame>,
) -> Result<(), ReconstructError> {
    let mut problem = Problem::new(first, settings);
    let mut choice = choose_atoms(&problem, settings)?;
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
        let left = problem.residual_of(&predicted);
        let made = reconstruction(&problem, found, predicted, settings, &choice);
        if left > WORSE * *first_residual.get_or_insert(left) {
            break;
        }
        // Later frames were not held back.
        choice.held_back = None;
        start = path.support;
        start.truncate(start.len() * KEPT_OF_FOUR / 4);
        done.push(VideoFrame { reconstruction: made, warm: !std::ptr::eq(frame, first) });
    }
    Ok(())
}
