//! `nirspi dev bench`: speed on this machine, as JSON.

mod enhance;
mod omp;
mod pipeline;

use super::networks::NetworkArgs;
use super::report::ReportArgs;
use anyhow::Result;
use clap::Subcommand;
use std::process::ExitCode;

/// Measure speed on this machine, as JSON
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi dev bench omp --frames 256\n\
    \x20 nirspi dev bench omp --input problem.npz --out solution.npz\n\
    \x20 nirspi dev bench enhance --frames 256\n\
    \x20 nirspi dev bench pipeline --frames 4096 --backend cuda")]
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
    /// Frames in the batch
    #[arg(long, value_name = "B", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=131_072))]
    frames: u32,
    /// Do not correct the network's result where the readings contradict it
    #[arg(long)]
    no_consistency: bool,
    /// Number of runs
    #[arg(long, value_name = "R", default_value_t = 9, value_parser = clap::value_parser!(u32).range(1..))]
    repeats: u32,
    /// Seed of the random frames
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    networks: NetworkArgs,
    #[command(flatten)]
    _report: ReportArgs,
}
