//! `nirspi dev bench omp`: times sparse representations of many frames.

use crate::report::{Overwrite, ReportArgs};
use crate::{backend, print, provenance, refused};
use anyhow::{Context, Result};
use clap::{ValueEnum, builder::RangedU64ValueParser};
use nirspi::files::output::{Existing, write_result};
use nirspi::problem;
use nirspi_eval::bench::omp::{self, Settings};
use nirspi_recon::omp::Backend;
use std::path::PathBuf;
use std::process::ExitCode;

/// Time orthogonal matching pursuit on a problem of your own, or on a random one
///
/// A problem file holds the dictionary `D` (M x N), measurements `Y` (B x M) and `k`. Atoms are chosen by their inner
/// product with the residual, which is a correlation if the columns of `D` have unit norm. `median_ms` is the time for all
/// of `Y` with the dictionary prepared (`prepare_ms`: its Gram matrix).
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi dev bench omp --measurements 512 --sparsity 64 --frames 256\n\
    \x20 nirspi dev bench omp --frames 4096 --backend cuda\n\
    \x20 nirspi dev bench omp --input problem.npz --out solution.npz")]
pub struct Args {
    /// Problem file [default: a random problem: random rows of a Hadamard matrix measure a 32 x 32 image of cosines]
    #[arg(long, value_name = "NPZ", conflicts_with_all = ["measurements", "sparsity", "frames"])]
    input: Option<PathBuf>,
    /// File for the solution: `support` (B x k) and `coef`
    #[arg(long, value_name = "NPZ")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Measurements of a frame, of 1024
    #[arg(long, value_name = "M", default_value_t = 512)]
    measurements: usize,
    /// Atoms to choose
    #[arg(long, value_name = "K", default_value_t = 64)]
    sparsity: usize,
    /// Frames in the batch
    #[arg(long, value_name = "B", default_value_t = 1, value_parser = RangedU64ValueParser::<usize>::new().range(1..=65_536))]
    frames: usize,
    /// Seed of a random problem
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// f32, f64, or auto: f32, and f64 for frames where f32 cannot tell two atoms apart
    #[arg(long, value_enum, default_value_t = Precision::Auto)]
    precision: Precision,
    /// Where to compute: auto (a GPU if there is one and the batch has 64 frames or more), cpu, wgpu or cuda
    #[arg(long, value_name = "BACKEND", default_value = "auto")]
    backend: Backend,
    /// Number of runs
    #[arg(long, value_name = "R", default_value_t = 15, value_parser = clap::value_parser!(u32).range(1..))]
    repeats: u32,
    /// Choose atoms by their correlation, whatever the norms of the columns of `D` are
    #[arg(long)]
    normalise: bool,
    #[command(flatten)]
    _report: ReportArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Precision {
    Auto,
    F32,
    F64,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let existing = Existing::of(args.overwrite.overwrite, args.input.as_deref());
    args.out.as_ref().map_or(Ok(()), |out| existing.check(out))?;
    let problem = match &args.input {
        Some(path) => problem::read(path)?,
        None => omp::random_problem(args.measurements, args.sparsity, args.frames, args.seed)
            .map_err(refused)?,
    };
    let named =
        || args.input.as_ref().map_or("problem".to_owned(), |path| path.display().to_string());
    let is_random = args.input.is_none();
    let settings = Settings {
        precision: match args.precision {
            Precision::Auto => omp::Precision::Auto,
            Precision::F32 => omp::Precision::F32,
            Precision::F64 => omp::Precision::F64,
        },
        repeats: args.repeats,
        // The rows' measurements of the cosines have different norms.
        normalise: args.normalise || is_random,
        cosines: is_random,
    };
    let device = match args.precision {
        // Kernels compute in f32: `auto` does not look for a GPU, and a GPU requested by name is
        // refused.
        Precision::F64 if args.backend == Backend::Auto => None,
        _ => backend::choose(args.backend, problem.frames.len() / problem.measurements)?,
    };
    let report = match device {
        None => omp::on_cpu(&problem, &settings),
        Some(device) => omp::on_gpu(&problem, &settings, &device),
    };
    let report = report.with_context(named)?;
    if let Some(out) = &args.out {
        let solutions: Vec<(&[usize], &[f64])> =
            report.solutions.iter().map(|s| (&s.support[..], &s.coefficients[..])).collect();
        write_result(out, existing, &problem::encode(out, problem.sparsity, &solutions)?)?;
    }
    print::json(&report, &provenance::computed())?;
    Ok(ExitCode::SUCCESS)
}
