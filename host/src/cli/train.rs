//! `nirspi train`: networks from a user's own characters, or pairs to train on elsewhere.

mod data;
mod degrade;

use anyhow::Result;
use clap::Subcommand;
use std::process::ExitCode;

/// Train the networks on your own characters, on the CPU or a GPU
#[derive(Debug, clap::Args)]
pub struct TrainArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    Degrade(degrade::Args),
}

pub fn run(args: &TrainArgs) -> Result<ExitCode> {
    match &args.what {
        What::Degrade(args) => degrade::run(args),
    }
}
