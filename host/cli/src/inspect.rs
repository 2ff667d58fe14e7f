//! `nirspi inspect`: what is in a file of readings, and the command that reconstructs it.

use super::report::{FigureArgs, Overwrite, ReportArgs};
use super::{Usage, print, provenance};
use anyhow::Result;
use nirspi::files::output::Existing;
use nirspi::inspect::Inspection;
use nirspi::picture::Pictures;
use std::path::PathBuf;
use std::process::ExitCode;

/// Say what is in a file, and guess the command that reconstructs it
///
/// The command lists the arrays of a .npz, .npy, .mat, .h5, .csv, .txt or .wav file, or what a recording (.mcap) holds. Of a feed it
/// receives some frames, for some seconds, and says whether the readings fit the header. It then reads the readings in each form and order that options of `nirspi reconstruct` name. It ranks these ways: those that keep the law
/// of light first, then those whose readings predict more of the readings that were held back. A trace and patterns of your
/// own are named with their command. The best ways are guesses: look at their images (--out).
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi inspect wing.npz\n\
    \x20 nirspi inspect scope.csv --out guesses.png\n\
    \x20 nirspi inspect feed:127.0.0.1:5025")]
pub struct Args {
    /// The file to inspect, or feed:ADDR: live readings (docs/feeds.md)
    #[arg(value_name = "FILE")]
    input: PathBuf,
    /// Picture to write: the images of the best ways, at most four, side by side
    #[arg(long, value_name = "FILE.png")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    #[command(flatten)]
    figure: FigureArgs,
    #[command(flatten)]
    report: ReportArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let existing = Existing::of(args.overwrite.overwrite, Some(&args.input));
    if let Some(out) = &args.out {
        if out.extension().is_none_or(|extension| extension != "png") {
            let found = out.display();
            return Err(Usage(format!("--out {found}: expected a name that ends in .png")).into());
        }
        existing.check(out)?;
    }
    let found = Inspection::of(&args.input)?;
    let provenance = found.taken.clone().made(provenance::made());
    let picture = args.out.as_ref().zip(found.picture());
    if let Some((out, picture)) = &picture {
        let mut pictures = Pictures::new(args.figure.figure, &provenance);
        pictures.add(&out.display().to_string(), picture.clone());
        pictures.write_files(existing)?;
    }
    let code = args.report.print(&found, &provenance, |found| {
        found.words().iter().try_for_each(print::line)?;
        print::notes(&found.notes)?;
        match (&args.out, picture) {
            (Some(out), Some(_)) => print::line(format_args!("wrote {}", out.display())),
            (Some(_), None) => print::line("no picture: no way to read readings was found"),
            (None, _) => Ok(()),
        }
    })?;
    Ok(if found.is_silent() { ExitCode::FAILURE } else { code })
}
