//! `nirspi train degrade`: writes scenes and the virtual camera's pictures of them to a file.

use super::data::DataArgs;
use crate::camera::ModelArgs;
use crate::print;
use anyhow::Result;
use indicatif::{ProgressBar, ProgressStyle};
use nirspi::files::output::write_atomic;
use nirspi::training::{LinearCamera, pairs};
use nirspi_eval::train::Found;
use nirspi_nets::data::Part;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Pairs of sharp scenes and the virtual camera's pictures of them, for training elsewhere
///
/// Characters fill the field of view at 0.3 to 1.2 m, dry or in rain, and go through projector, receiver, calibration
/// and reconstruction. Writes x (N, 64, 64), y (N, 32, 32), the blur and noise of each, depth, distance, rain and where
/// the scene comes from.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi train degrade --data chars74k/ --count 4000 --seed 1 --out pairs.npz")]
pub struct Args {
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    model: ModelArgs,
    /// Pairs to make
    #[arg(long, value_name = "N", default_value_t = 1000,
          value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    count: u32,
    /// Seed: the same gives the same file, and pair k of a longer one is the same too
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Take held-out groups, as they are, instead of those to train on
    #[arg(long)]
    only_held_out: bool,
    /// File to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Report {
    simulated: bool,
    pairs: usize,
    seed: u64,
    held_out: bool,
    data: Found,
    out: PathBuf,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let (scenes, data) = args.data.data().scenes(args.seed)?;
    let camera = LinearCamera::new(&args.model.read()?, args.seed)?;
    let bar = ProgressBar::new(u64::from(args.count)).with_style(
        ProgressStyle::with_template("degrade {bar:30} {pos}/{len} pairs, {eta} left")
            .unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    let part = if args.only_held_out { Part::HeldOut } else { Part::Training };
    let count = args.count as usize;
    let pairs = pairs::take(&scenes, part, &camera, count, args.seed, &|| bar.inc(1))?;
    bar.finish_and_clear();
    write_atomic(&args.out, &pairs::encode(&args.out, &scenes, &pairs)?)?;
    let report = Report {
        simulated: true,
        pairs: pairs.len(),
        seed: args.seed,
        held_out: args.only_held_out,
        data,
        out: args.out.clone(),
    };
    if args.json {
        print::json(&report)?;
    } else {
        print::line(format_args!(
            "{} pairs (simulated) of {} images in {}",
            report.pairs,
            if report.held_out { report.data.held_out_images } else { report.data.training_images },
            args.out.display()
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}
