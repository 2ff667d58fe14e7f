//! `nirspi bench omp`: sparse representations of many frames, timed.

#[cfg(feature = "gpu")]
mod gpu;

use super::{FASTEST_SWEEPS_HZ, milliseconds, scenes};
use crate::{Usage, backend, print};
use anyhow::{Context, Result};
use clap::ValueEnum;
use nalgebra::DMatrix;
use nirspi::files::output::write_atomic;
use nirspi::files::problem::{self, ProblemFile};
use nirspi_recon::omp::{
    Backend, Limits, MixedDictionary, OmpError, Problem, Solution, solve_batch,
};
use nirspi_recon::{Order, Side};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

/// Time orthogonal matching pursuit on a problem of your own, or on a random one
///
/// A problem file holds the dictionary `D` (M x N), measurements `Y` (B x M) and `k`. Atoms are chosen by their inner
/// product with the residual, which is a correlation if the columns of `D` have unit norm. `median_ms` is the time for all
/// of `Y` with the dictionary prepared (`prepare_ms`: its Gram matrix).
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi bench omp --measurements 512 --sparsity 64 --frames 256\n\
    \x20 nirspi bench omp --frames 4096 --backend cuda\n\
    \x20 nirspi bench omp --input problem.npz --out solution.npz")]
pub struct Args {
    /// Problem file; without it, random rows of a Hadamard matrix see cosines of a 32 x 32 image
    #[arg(long, value_name = "NPZ", conflicts_with_all = ["measurements", "sparsity", "frames"])]
    input: Option<PathBuf>,
    /// Where the solution goes: `support` (B x k) and `coef`
    #[arg(long, value_name = "NPZ")]
    out: Option<PathBuf>,
    /// Measurements of a frame, of 1024
    #[arg(long, value_name = "M", default_value_t = 512)]
    measurements: usize,
    /// Atoms to choose
    #[arg(long, value_name = "K", default_value_t = 64)]
    sparsity: usize,
    /// Frames
    #[arg(long, value_name = "B", default_value_t = 1)]
    frames: usize,
    /// Seed of a random problem
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// f32, f64, or auto: f32, and f64 for frames where f32 cannot tell two atoms apart
    #[arg(long, value_enum, default_value_t = Precision::Auto)]
    precision: Precision,
    /// What computes: auto (a GPU from 64 frames on, if there is one), cpu, wgpu, cuda
    #[arg(long, value_name = "BACKEND", default_value = "auto")]
    backend: Backend,
    /// Times to solve it
    #[arg(long, value_name = "R", default_value_t = 15, value_parser = clap::value_parser!(u32).range(1..))]
    repeats: u32,
    /// Choose atoms by correlation whatever the norms of the columns of `D`
    #[arg(long)]
    normalise: bool,
    /// Print JSON, as it does anyway
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
enum Precision {
    Auto,
    F32,
    F64,
}

#[derive(Debug, Serialize)]
struct Report {
    backend: &'static str,
    /// The GPU, as its driver calls it.
    #[serde(skip_serializing_if = "Option::is_none")]
    device: Option<String>,
    /// Whether the processor plays the GPU: its times say nothing of one.
    software: bool,
    threads: usize,
    precision: Precision,
    atoms: usize,
    measurements: usize,
    sparsity: usize,
    frames: usize,
    repeats: u32,
    /// Once for a dictionary.
    prepare_ms: f64,
    /// All frames; on a GPU with the transfer of measurements, solutions and images.
    median_ms: f64,
    fastest_ms: f64,
    slowest_ms: f64,
    frames_per_s: f64,
    /// Frames a second, of the sweeps a second that the patterns' clock allows.
    of_fastest_sweeps: f64,
    /// Frames that f32 could not decide.
    solved_in_f64: usize,
    /// Atoms chosen, mean over the frames.
    mean_atoms: f64,
    /// Products (and as many sums) of the rows, the projection and its updates, of one frame.
    products_per_frame: f64,
    gigaproducts_per_s: f64,
    /// Earlier rows read to orthogonalise the chosen columns of the Gram matrix, of one frame.
    row_bytes_per_frame: f64,
    gigabytes_per_s: f64,
    /// To and from a GPU.
    transferred_bytes_per_frame: f64,
}

/// What was measured.
struct Timed {
    backend: Backend,
    device: Option<String>,
    software: bool,
    prepare_ms: f64,
    /// One time a repeat, for all frames.
    times_ms: Vec<f64>,
    solutions: Vec<Solution>,
    solved_in_f64: usize,
    transferred_bytes_per_frame: f64,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let problem = match &args.input {
        Some(path) => problem::read(path)?,
        None => random_problem(args)?,
    };
    let named =
        || args.input.as_ref().map_or("problem".to_owned(), |path| path.display().to_string());
    let frames = problem.frames.len() / problem.measurements;
    let device = match args.precision {
        // Kernels compute in f32: this is no work for a GPU unless it was asked for, and refused.
        Precision::F64 if args.backend == Backend::Auto => None,
        _ => backend::choose(args.backend, frames)?,
    };
    let timed = match device {
        None => on_cpu(args, &problem),
        #[cfg(feature = "gpu")]
        Some(device) => gpu::time(args, &problem, &device),
        #[cfg(not(feature = "gpu"))]
        Some(device) => match device {},
    };
    let mut timed = timed.with_context(named)?;
    timed.times_ms.sort_unstable_by(f64::total_cmp);
    if let Some(out) = &args.out {
        let solutions: Vec<(&[usize], &[f64])> =
            timed.solutions.iter().map(|s| (&s.support[..], &s.coefficients[..])).collect();
        write_atomic(out, &problem::encode(out, problem.sparsity, &solutions)?)?;
    }
    print::json(&report(args, &problem, &timed))?;
    Ok(ExitCode::SUCCESS)
}

/// All cores, and for one frame no more than one.
fn on_cpu(args: &Args, problem: &ProblemFile) -> Result<Timed> {
    let start = Instant::now();
    let dictionary = MixedDictionary::new(matrix(problem), args.normalises());
    if args.precision == Precision::F64 {
        dictionary.double();
    }
    let prepare_ms = milliseconds(start);
    let limits = Limits::atoms(problem.sparsity);
    let single: Vec<f32> = problem.frames.iter().map(|&y| y as f32).collect();

    // Once to warm up: caches, threads, and what double precision may need.
    let mut solver = dictionary.solver(&limits)?;
    let mut solve = || -> Result<(Vec<Solution>, usize), OmpError> {
        match args.precision {
            // One frame is a question of latency: everything is at hand.
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
    for _ in 0..args.repeats {
        let start = Instant::now();
        (solutions, solved_in_f64) = solve()?;
        times_ms.push(milliseconds(start));
    }
    Ok(Timed {
        backend: Backend::Cpu,
        device: None,
        software: false,
        prepare_ms,
        times_ms,
        solutions,
        solved_in_f64,
        transferred_bytes_per_frame: 0.0,
    })
}

/// What the times mean. They are sorted.
fn report(args: &Args, problem: &ProblemFile, timed: &Timed) -> Report {
    let frames = timed.solutions.len();
    let chosen: usize = timed.solutions.iter().map(|s| s.support.len()).sum();
    let mean_atoms = chosen as f64 / frames as f64;
    let median_ms = timed.times_ms[timed.times_ms.len() / 2];
    let (m, n, k) = (problem.measurements as f64, problem.atoms as f64, mean_atoms);
    let products_per_frame = n * (m + k * (k - 1.0) / 2.0 + 2.0 * k);
    let number_bytes = if args.precision == Precision::F64 { 8.0 } else { 4.0 };
    let row_bytes_per_frame = number_bytes * n * k * (k - 1.0).max(0.0) / 2.0;
    let frames_per_s = frames as f64 / median_ms * 1e3;
    Report {
        backend: timed.backend.name(),
        device: timed.device.clone(),
        software: timed.software,
        threads: rayon::current_num_threads(),
        precision: args.precision,
        atoms: problem.atoms,
        measurements: problem.measurements,
        sparsity: problem.sparsity,
        frames,
        repeats: args.repeats,
        prepare_ms: timed.prepare_ms,
        median_ms,
        fastest_ms: timed.times_ms[0],
        slowest_ms: timed.times_ms[timed.times_ms.len() - 1],
        frames_per_s,
        of_fastest_sweeps: frames_per_s / FASTEST_SWEEPS_HZ,
        solved_in_f64: timed.solved_in_f64,
        mean_atoms,
        products_per_frame,
        gigaproducts_per_s: products_per_frame * frames as f64 / median_ms / 1e6,
        row_bytes_per_frame,
        gigabytes_per_s: row_bytes_per_frame * frames as f64 / median_ms / 1e6,
        transferred_bytes_per_frame: timed.transferred_bytes_per_frame,
    }
}

impl Args {
    /// A random problem's atoms have the lengths that the rows see of them.
    fn normalises(&self) -> bool {
        self.normalise || self.input.is_none()
    }
}

fn matrix(problem: &ProblemFile) -> DMatrix<f64> {
    DMatrix::from_row_slice(problem.measurements, problem.atoms, &problem.dictionary)
}

/// Cosines of an image by a random choice of Hadamard rows, and frames that are sums of some with noise.
fn random_problem(args: &Args) -> Result<ProblemFile> {
    let side = Side::INSTRUMENT;
    let area = side.area();
    let wrong =
        |name: &str, found, most| Usage(format!("--{name} is {found}, expected 1 to {most}"));
    if !(1..=area).contains(&args.measurements) {
        return Err(wrong("measurements", args.measurements, area).into());
    }
    if !(1..=args.measurements).contains(&args.sparsity) {
        return Err(wrong("sparsity", args.sparsity, args.measurements).into());
    }
    if args.frames == 0 {
        return Err(Usage("--frames is 0, expected 1 or more".to_owned()).into());
    }
    let rows = Order::Random(args.seed).rows(side)?.first(args.measurements);
    let dictionary = scenes::cosines_by(&rows)?;
    let mut random = Pcg64::seed_from_u64(args.seed);
    let mut frames = Vec::with_capacity(args.frames * args.measurements);
    for _ in 0..args.frames {
        let mut y: Vec<f64> =
            (0..args.measurements).map(|_| random.random_range(-0.02..0.02)).collect();
        for _ in 0..args.sparsity {
            let (atom, size) = (random.random_range(0..area), random.random_range(-1.0..1.0));
            for (m, y) in y.iter_mut().enumerate() {
                *y += size * dictionary[m * area + atom];
            }
        }
        frames.append(&mut y);
    }
    Ok(ProblemFile {
        dictionary,
        measurements: args.measurements,
        atoms: area,
        frames,
        sparsity: args.sparsity,
    })
}
