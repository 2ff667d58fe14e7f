//! `nirspi bench`: how long things take here, as JSON.

mod enhance;
mod omp;
mod pipeline;
mod scenes;

use super::networks::NetworkArgs;
use anyhow::Result;
use clap::Subcommand;
use serde::Serialize;
use std::process::ExitCode;
use std::time::Instant;

/// Sweeps a second that the patterns' clock allows: as fast as there is anything to reconstruct.
const FASTEST_SWEEPS_HZ: f64 = nirspi_wire::PATTERN_HZ as f64 / nirspi_wire::PATTERNS as f64;

/// Measure speed on this machine, as JSON
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi bench omp --frames 256\n\
    \x20 nirspi bench omp --input problem.npz --out solution.npz\n\
    \x20 nirspi bench enhance --frames 256\n\
    \x20 nirspi bench pipeline --frames 4096 --backend cuda")]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    Enhance(enhance::Args),
    Omp(omp::Args),
    Pipeline(pipeline::Args),
}

pub fn run(args: &Args) -> Result<ExitCode> {
    match &args.what {
        What::Enhance(args) => enhance::run(args),
        What::Omp(args) => omp::run(args),
        What::Pipeline(args) => pipeline::run(args),
    }
}

/// What the benchmarks take that run networks.
#[derive(Debug, clap::Args)]
struct RunArgs {
    /// Frames
    #[arg(long, value_name = "B", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    frames: u32,
    /// Let the network say what the readings contradict
    #[arg(long)]
    no_consistency: bool,
    /// Times to run it
    #[arg(long, value_name = "R", default_value_t = 9, value_parser = clap::value_parser!(u32).range(1..))]
    repeats: u32,
    /// Seed of all that is random
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    networks: NetworkArgs,
    /// Print JSON, as it does anyway
    #[arg(long)]
    json: bool,
}

/// Of several runs, in milliseconds.
#[derive(Debug, Clone, Serialize)]
struct Times {
    median_ms: f64,
    fastest_ms: f64,
    slowest_ms: f64,
}

impl Times {
    /// Runs `work` as often as said, at least once.
    fn of<T>(repeats: u32, mut work: impl FnMut() -> T) -> Self {
        let mut times: Vec<f64> = (0..repeats.max(1))
            .map(|_| {
                let start = Instant::now();
                std::hint::black_box(work());
                milliseconds(start)
            })
            .collect();
        times.sort_by(f64::total_cmp);
        Self {
            median_ms: times[times.len() / 2],
            fastest_ms: times[0],
            slowest_ms: times[times.len() - 1],
        }
    }
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
