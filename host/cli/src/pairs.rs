//! `nirspi train degrade`: writes scenes and the virtual camera's pictures of them to a file.

use super::data::DataArgs;
use crate::camera::ModelArgs;
use crate::print;
use crate::progress::Progress;
use crate::provenance;
use crate::report::{Overwrite, ReportArgs};
use anyhow::Result;
use nirspi::files::output::{Existing, write_result};
use nirspi::training::{LinearCamera, pairs};
use nirspi_eval::train::Found;
use nirspi_nets::data::Part;
use nirspi_recon::words::count_of;
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
    /// Seed. The same seed gives the same file; pair k is the same in a longer file
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Use the held-out groups instead of the groups to train on
    #[arg(long)]
    only_held_out: bool,
    /// File to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
    #[command(flatten)]
    report: ReportArgs,
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
    // The scenes are in folders of pictures, whose names differ from a file of arrays.
    let existing = Existing::of(args.overwrite.overwrite, None);
    existing.check(&args.out)?;
    let (scenes, data) = args.data.data().scenes(args.seed)?;
    let camera = LinearCamera::new(&args.model.read()?, args.seed)?;
    let bar = Progress::of("degrade", args.count, "pairs");
    let part = if args.only_held_out { Part::HeldOut } else { Part::Training };
    let count = args.count as usize;
    let pairs = pairs::take(&scenes, part, &camera, count, args.seed, &|| bar.add(1))?;
    drop(bar);
    let provenance = provenance::simulated();
    let encoded = pairs::encode(&args.out, &scenes, &pairs, &provenance)?;
    write_result(&args.out, existing, &encoded)?;
    let report = Report {
        simulated: true,
        pairs: pairs.len(),
        seed: args.seed,
        held_out: args.only_held_out,
        data,
        out: args.out.clone(),
    };
    args.report.print(&report, &provenance, |report| {
        let Found { held_out_images, training_images, .. } = report.data;
        let images = if report.held_out { held_out_images } else { training_images };
        print::line(format_args!(
            "{} (simulated) of {} in {}",
            count_of(report.pairs, "pair"),
            count_of(images, "image"),
            args.out.display()
        ))
    })
}
