//! `nirspi dev pairs`: writes scenes and the virtual camera's pictures of them to a file.

use crate::camera::ModelArgs;
use crate::print;
use crate::progress::Progress;
use crate::provenance;
use crate::report::{Overwrite, ReportArgs};
use anyhow::Result;
use nirspi::files::output::{Existing, write_result};
use nirspi_eval::training::characters::{Characters, Found, write_stacks};
use nirspi_eval::training::{LinearCamera, pairs};
use nirspi_nets::data::Part;
use nirspi_recon::words::count_of;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Make pairs of sharp scenes and the virtual camera's pictures of them, to train networks on
///
/// Characters fill the field of view at 0.3 to 1.2 m, dry or in rain, and go through projector, receiver, calibration
/// and reconstruction. The file has x (N, 64, 64), y (N, 32, 32), the blur and noise of each, depth, distance, rain, and
/// where the scene comes from. `python -m nirspi.train --pairs FILE` trains on it (docs/training.md).
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("letters").args(["data", "fonts"]).multiple(true))]
#[command(after_help = "Examples:\n\
    \x20 nirspi dev pairs --data letters.npz --count 4000 --out pairs.npz\n\
    \x20 nirspi dev pairs --data chars74k/ --characters letters/ --count 4000 --out pairs.npz")]
pub struct Args {
    /// Characters: a .npz stack (x, label, family or writer), a folder of such files, or Chars74K's folder; may be given
    /// several times. Without --data and --fonts, scenes are shapes
    #[arg(long, value_name = "PATH")]
    data: Vec<PathBuf>,
    /// A folder of .ttf and .otf fonts, from which 0-9, A-Z and a-z are drawn
    #[arg(long, value_name = "DIR")]
    fonts: Vec<PathBuf>,
    /// Share of the font families, writers and photographs of which no pairs are made
    #[arg(long, value_name = "0..1", default_value_t = 0.1)]
    held_out: f64,
    /// Share of the scenes that are no letters
    #[arg(long, value_name = "0..1", default_value_t = 0.15)]
    shapes: f32,
    #[command(flatten)]
    model: ModelArgs,
    /// Pairs to make
    #[arg(long, value_name = "N", default_value_t = 1000,
          value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    count: u32,
    /// Seed. The same seed gives the same file; pair k is the same in a longer file
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Make pairs of the held-out groups instead of the others
    #[arg(long)]
    only_held_out: bool,
    /// Write the characters of --data and --fonts to this new folder, a .npz stack each, for `python -m nirspi.train --data`
    #[arg(long, value_name = "DIR", requires = "letters")]
    characters: Option<PathBuf>,
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
    let characters = Characters {
        stacks: args.data.clone(),
        fonts: args.fonts.clone(),
        held_out: args.held_out,
        shapes: args.shapes,
    };
    let (scenes, data) = characters.scenes(args.seed)?;
    let camera = LinearCamera::new(&args.model.read()?, args.seed)?;
    if let Some(folder) = &args.characters {
        write_stacks(folder, &scenes)?;
    }
    let bar = Progress::of("pairs", args.count, "pairs");
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
