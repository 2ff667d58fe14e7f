//! `nirspi bench`: how long things take here, as JSON.

mod omp;

use anyhow::Result;
use clap::Subcommand;
use std::process::ExitCode;

/// Measure speed on this machine, as JSON
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi bench omp --frames 256\n\
    \x20 nirspi bench omp --input problem.npz --out solution.npz")]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    Omp(omp::Args),
}

pub fn run(args: &Args) -> Result<ExitCode> {
    match &args.what {
        What::Omp(args) => omp::run(args),
    }
}
