//! `nirspi bench omp`: sparse representations of many frames, timed.

use crate::cli::{Usage, print};
use anyhow::{Context, Result};
use clap::ValueEnum;
use nalgebra::DMatrix;
use nirspi::files::output::write_atomic;
use nirspi::files::problem::{self, ProblemFile};
use nirspi_recon::basis::Transform;
use nirspi_recon::omp::{
    Backend, Limits, MixedDictionary, OmpError, Problem, Solution, solve_batch,
};
use nirspi_recon::{Basis, Order, Side, fwht};
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
    /// What computes: auto, cpu
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
    threads: usize,
    precision: Precision,
    atoms: usize,
    measurements: usize,
    sparsity: usize,
    frames: usize,
    repeats: u32,
    /// Once for a dictionary.
    prepare_ms: f64,
    /// All frames.
    median_ms: f64,
    fastest_ms: f64,
    slowest_ms: f64,
    frames_per_s: f64,
    /// Frames that f32 could not decide.
    solved_in_f64: usize,
    /// Atoms chosen, mean over the frames.
    mean_atoms: f64,
    /// Products (and as many sums) of the rows, the projection and its updates, of one frame.
    products_per_frame: f64,
    gigaproducts_per_s: f64,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let problem = match &args.input {
        Some(path) => problem::read(path)?,
        None => random_problem(args)?,
    };
    let named =
        || args.input.as_ref().map_or("problem".to_owned(), |path| path.display().to_string());
    let matrix = DMatrix::from_row_slice(problem.measurements, problem.atoms, &problem.dictionary);
    // A random problem's atoms have the lengths that the rows see of them.
    let normalise = args.normalise || args.input.is_none();
    let start = Instant::now();
    let dictionary = MixedDictionary::new(matrix, normalise);
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
            Precision::Auto => dictionary.solve_batch(&limits, &problem.frames, args.backend),
            Precision::F32 => {
                let problem = Problem { dictionary: dictionary.single(), limits };
                Ok((solve_batch(&problem, &single, args.backend)?, 0))
            }
            Precision::F64 => {
                let double = Problem { dictionary: dictionary.double(), limits };
                let solutions = solve_batch(&double, &problem.frames, args.backend)?;
                let count = solutions.len();
                Ok((solutions, count))
            }
        }
    };
    let (mut solutions, mut solved_in_f64) = solve().with_context(named)?;
    let mut times = Vec::new();
    for _ in 0..args.repeats {
        let start = Instant::now();
        (solutions, solved_in_f64) = solve()?;
        times.push(milliseconds(start));
    }
    times.sort_unstable_by(f64::total_cmp);
    if let Some(out) = &args.out {
        let solutions: Vec<(&[usize], &[f64])> =
            solutions.iter().map(|s| (&s.support[..], &s.coefficients[..])).collect();
        write_atomic(out, &problem::encode(out, problem.sparsity, &solutions)?)?;
    }
    let frames = solutions.len();
    let mean_atoms =
        solutions.iter().map(|s| s.support.len()).sum::<usize>() as f64 / frames as f64;
    let median_ms = times[times.len() / 2];
    let (m, n, k) = (problem.measurements as f64, problem.atoms as f64, mean_atoms);
    let products_per_frame = n * (m + k * (k - 1.0) / 2.0 + 2.0 * k);
    print::json(&Report {
        backend: "cpu",
        threads: rayon::current_num_threads(),
        precision: args.precision,
        atoms: problem.atoms,
        measurements: problem.measurements,
        sparsity: problem.sparsity,
        frames,
        repeats: args.repeats,
        prepare_ms,
        median_ms,
        fastest_ms: times[0],
        slowest_ms: times[times.len() - 1],
        frames_per_s: frames as f64 / median_ms * 1e3,
        solved_in_f64,
        mean_atoms,
        products_per_frame,
        gigaproducts_per_s: products_per_frame * frames as f64 / median_ms / 1e6,
    })?;
    Ok(ExitCode::SUCCESS)
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
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
    let mut rows = Order::Random(args.seed).rows(side)?;
    rows.truncate(args.measurements);
    let transform = Transform::new(Basis::Dct, side);
    let mut dictionary = vec![0.0; args.measurements * area];
    for atom in 0..area {
        let mut image = vec![0.0_f32; area];
        image[atom] = 1.0;
        transform.synthesise(&mut image);
        let mut seen: Vec<f64> = image.iter().map(|&v| v.into()).collect();
        fwht(&mut seen)?;
        for (m, &row) in rows.iter().enumerate() {
            dictionary[m * area + atom] = seen[row as usize] / side.pixels() as f64;
        }
    }
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
