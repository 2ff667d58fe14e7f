//! Times sparse representations of many frames by orthogonal matching pursuit.

mod gpu;

pub use gpu::on_gpu;

use super::{FASTEST_SWEEPS_HZ, Times, milliseconds, scenes};
use crate::error::{EvalError, Result};
use nalgebra::DMatrix;
use nirspi::problem::ProblemFile;
use nirspi_recon::omp::{
    Backend, Limits, MixedDictionary, OmpError, Problem, Solution, solve_batch,
};
use nirspi_recon::{Order, Side};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde::Serialize;
use std::time::Instant;

/// The floating-point numbers of a pursuit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// `f32`, and `f64` for frames in which `f32` cannot distinguish two atoms.
    Auto,
    /// `f32` alone.
    F32,
    /// `f64` alone.
    F64,
}

/// How to solve a problem.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// The floating-point numbers.
    pub precision: Precision,
    /// Number of timed solutions after a warm-up, at least one.
    pub repeats: u32,
    /// Whether to choose atoms by correlation, whatever the norms of the dictionary's columns.
    pub normalise: bool,
    /// Whether atom k is the k-th cosine of a 32 x 32 image, as in a [`random_problem`]. A GPU then
    /// makes images of the solutions.
    pub cosines: bool,
}

/// The times of a problem's solutions, and their context.
#[derive(Debug, Serialize)]
pub struct Report {
    /// The backend.
    pub backend: &'static str,
    /// The GPU's name in its driver.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub device: Option<String>,
    /// Whether the processor emulates the GPU. Its times then say nothing about a GPU.
    pub software: bool,
    /// Number of CPU threads.
    pub threads: usize,
    /// The floating-point numbers.
    pub precision: Precision,
    /// Number of columns of the dictionary.
    pub atoms: usize,
    /// Number of rows of the dictionary.
    pub measurements: usize,
    /// Number of atoms to choose for a frame.
    pub sparsity: usize,
    /// Number of frames.
    pub frames: usize,
    /// Number of timed solutions of all frames.
    pub repeats: u32,
    /// Time for preparing a dictionary once.
    pub prepare_ms: f64,
    /// Median time for all frames; on a GPU with the transfer of measurements, solutions and
    /// images.
    pub median_ms: f64,
    /// The shortest time for all frames.
    pub fastest_ms: f64,
    /// The longest time for all frames.
    pub slowest_ms: f64,
    /// Frames a second, from the median.
    pub frames_per_s: f64,
    /// Frames a second, divided by the sweeps a second that the patterns' clock allows.
    pub of_fastest_sweeps: f64,
    /// Number of frames that f32 could not decide.
    pub solved_in_f64: usize,
    /// Number of chosen atoms, mean over the frames.
    pub mean_atoms: f64,
    /// Products (and as many sums) of the rows, the projection and its updates, for one frame.
    pub products_per_frame: f64,
    /// Products a second.
    pub gigaproducts_per_s: f64,
    /// Earlier rows read to orthogonalise the chosen columns of the Gram matrix, for one frame.
    pub row_bytes_per_frame: f64,
    /// Rows read a second.
    pub gigabytes_per_s: f64,
    /// Bytes transferred to and from a GPU.
    pub transferred_bytes_per_frame: f64,
    /// The solution of each frame.
    #[serde(skip)]
    pub solutions: Vec<Solution>,
}

/// The measured times.
struct Timed {
    backend: Backend,
    device: Option<String>,
    software: bool,
    prepare_ms: f64,
    /// The time for all frames, one for each repeat.
    times_ms: Vec<f64>,
    solutions: Vec<Solution>,
    solved_in_f64: usize,
    transferred_bytes_per_frame: f64,
}

/// Times `problem` on all cores of the CPU; a single frame on one core.
///
/// # Errors
/// The pursuit's error for settings or frames out of range.
pub fn on_cpu(problem: &ProblemFile, settings: &Settings) -> Result<Report> {
    let start = Instant::now();
    let dictionary = MixedDictionary::new(matrix(problem), settings.normalise);
    if settings.precision == Precision::F64 {
        dictionary.double();
    }
    let prepare_ms = milliseconds(start);
    let limits = Limits::atoms(problem.sparsity);
    let single: Vec<f32> = problem.frames.iter().map(|&y| y as f32).collect();

    // The warm-up fills caches, threads, and the buffers of double precision.
    let mut solver = dictionary.solver(&limits)?;
    let mut solve = || -> Result<(Vec<Solution>, usize), OmpError> {
        match settings.precision {
            // A single frame is solved for latency, with everything prepared.
            Precision::Auto if problem.frames.len() == problem.measurements => {
                let (solution, in_double) = solver.solve(&problem.frames)?;
                Ok((vec![solution], usize::from(in_double)))
            }
            Precision::Auto => dictionary.solve_batch(&limits, &problem.frames),
            Precision::F32 => {
                let problem = Problem { dictionary: dictionary.single(), limits };
                Ok((solve_batch(&problem, &single, Backend::Cpu)?, 0))
            }
            Precision::F64 => {
                let double = Problem { dictionary: dictionary.double(), limits };
                let solutions = solve_batch(&double, &problem.frames, Backend::Cpu)?;
                let count = solutions.len();
                Ok((solutions, count))
            }
        }
    };
    let (mut solutions, mut solved_in_f64) = solve()?;
    let mut times_ms = Vec::new();
    for _ in 0..settings.repeats.max(1) {
        let start = Instant::now();
        (solutions, solved_in_f64) = solve()?;
        times_ms.push(milliseconds(start));
    }
    let timed = Timed {
        backend: Backend::Cpu,
        device: None,
        software: false,
        prepare_ms,
        times_ms,
        solutions,
        solved_in_f64,
        transferred_bytes_per_frame: 0.0,
    };
    Ok(report(settings, problem, timed))
}

/// The report of the times.
fn report(settings: &Settings, problem: &ProblemFile, timed: Timed) -> Report {
    let frames = timed.solutions.len();
    let chosen: usize = timed.solutions.iter().map(|s| s.support.len()).sum();
    let mean_atoms = chosen as f64 / frames as f64;
    let Times { median_ms, fastest_ms, slowest_ms } = Times::from_ms(timed.times_ms);
    let (m, n, k) = (problem.measurements as f64, problem.atoms as f64, mean_atoms);
    let products_per_frame = n * (m + k * (k - 1.0) / 2.0 + 2.0 * k);
    let number_bytes = if settings.precision == Precision::F64 { 8.0 } else { 4.0 };
    let row_bytes_per_frame = number_bytes * n * k * (k - 1.0).max(0.0) / 2.0;
    let frames_per_s = frames as f64 / median_ms * 1e3;
    Report {
        backend: timed.backend.name(),
        device: timed.device,
        software: timed.software,
        threads: rayon::current_num_threads(),
        precision: settings.precision,
        atoms: problem.atoms,
        measurements: problem.measurements,
        sparsity: problem.sparsity,
        frames,
        repeats: settings.repeats,
        prepare_ms: timed.prepare_ms,
        median_ms,
        fastest_ms,
        slowest_ms,
        frames_per_s,
        of_fastest_sweeps: frames_per_s / FASTEST_SWEEPS_HZ,
        solved_in_f64: timed.solved_in_f64,
        mean_atoms,
        products_per_frame,
        gigaproducts_per_s: products_per_frame * frames as f64 / median_ms / 1e6,
        row_bytes_per_frame,
        gigabytes_per_s: row_bytes_per_frame * frames as f64 / median_ms / 1e6,
        transferred_bytes_per_frame: timed.transferred_bytes_per_frame,
        solutions: timed.solutions,
    }
}

fn matrix(problem: &ProblemFile) -> DMatrix<f64> {
    DMatrix::from_row_slice(problem.measurements, problem.atoms, &problem.dictionary)
}

/// A random problem: random Hadamard rows measure the cosines of a 32 x 32 image, and frames are
/// sums of `sparsity` cosines with noise of 1 %.
///
/// # Errors
/// [`EvalError::Setting`] for a number out of range.
pub fn random_problem(
    measurements: usize,
    sparsity: usize,
    frames: usize,
    seed: u64,
) -> Result<ProblemFile> {
    let side = Side::INSTRUMENT;
    let area = side.area();
    let within = |name, found: usize, most: usize| match (1..=most).contains(&found) {
        true => Ok(()),
        false => Err(EvalError::setting(name, found, format!("1 to {most}"))),
    };
    within("measurements", measurements, area)?;
    within("sparsity", sparsity, measurements)?;
    if frames == 0 {
        return Err(EvalError::setting("frames", frames, "1 or more"));
    }
    let rows = Order::Random(seed).rows(side)?.first(measurements);
    let dictionary = scenes::cosines_by(&rows)?;
    let mut random = Pcg64::seed_from_u64(seed);
    let mut y = Vec::with_capacity(frames * measurements);
    for _ in 0..frames {
        let mut frame: Vec<f64> =
            (0..measurements).map(|_| random.random_range(-0.02..0.02)).collect();
        for _ in 0..sparsity {
            let (atom, size) = (random.random_range(0..area), random.random_range(-1.0..1.0));
            for (m, reading) in frame.iter_mut().enumerate() {
                *reading += size * dictionary[m * area + atom];
            }
        }
        y.append(&mut frame);
    }
    Ok(ProblemFile { dictionary, measurements, atoms: area, frames: y, sparsity })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: Settings =
        Settings { precision: Precision::Auto, repeats: 1, normalise: true, cosines: true };

    #[test]
    fn a_random_problem_follows_from_its_seed_and_a_longer_one_begins_the_same() {
        let problem = |frames, seed| random_problem(64, 4, frames, seed).unwrap();
        let two = problem(2, 1);
        assert_eq!((two.dictionary.len(), two.frames.len()), (64 * 1024, 2 * 64));
        assert_eq!(two.frames[..64], problem(1, 1).frames);
        assert_ne!(two.frames, problem(2, 2).frames);
    }

    #[test]
    fn numbers_out_of_range_are_named_with_their_range() {
        for ((m, k, b), told) in [
            ((1025, 1, 1), "measurements is 1025, expected 1 to 1024"),
            ((512, 513, 1), "sparsity is 513, expected 1 to 512"),
            ((512, 0, 1), "sparsity is 0, expected 1 to 512"),
            ((512, 1, 0), "frames is 0, expected 1 or more"),
        ] {
            let error = random_problem(m, k, b, 1).unwrap_err();
            assert!(error.is_setting());
            assert_eq!(error.to_string(), told);
        }
    }

    #[test]
    fn the_report_counts_what_the_solutions_hold() {
        let problem = random_problem(64, 4, 3, 1).unwrap();
        for precision in [Precision::Auto, Precision::F32, Precision::F64] {
            let report = on_cpu(&problem, &Settings { precision, ..SETTINGS }).unwrap();
            let chosen: usize = report.solutions.iter().map(|s| s.support.len()).sum();
            assert_eq!(report.solutions.len(), 3);
            assert!((report.mean_atoms - chosen as f64 / 3.0).abs() < 1e-12);
            let k = report.mean_atoms;
            let products = 1024.0 * (64.0 + k * (k - 1.0) / 2.0 + 2.0 * k);
            assert!((report.products_per_frame - products).abs() < 1e-6);
            assert!(report.frames_per_s * report.median_ms * 1e-3 - 3.0 < 1e-9);
        }
    }
}
