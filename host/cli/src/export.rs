//! `nirspi export`: a recording in a form for other programs.

use super::print;
use super::report::{ReportArgs, words};
use anyhow::Result;
use nirspi::export::{ExportOptions, Format, export};
use std::path::PathBuf;
use std::process::ExitCode;

/// Write a recording in a form for other programs
///
/// Readings are ADC counts, corrected for the leak from pattern to pattern. `nirspi reconstruct` of the exported npz, npy
/// or csv gives the image of the recording.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi export rec.mcap --to npz --out rec.npz")]
pub struct Args {
    /// Recording (.mcap)
    recording: PathBuf,
    #[arg(long, value_name = "FORMAT", help = "Form of the file",
          value_parser = words(Format::ALL, |format| (format.name(), format.about())))]
    to: Format,
    /// File to write [default: the recording's name with the ending of the format]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Do not correct the readings for the leak from pattern to pattern
    #[arg(long)]
    keep_leak: bool,
    /// Do not correct images for unequal LEDs, even if a flat field is kept for the camera
    #[arg(long)]
    no_flat_field: bool,
    /// parquet: what the camera looked at
    #[arg(long, value_name = "TEXT", help_heading = "Dataset")]
    scene: Option<String>,
    /// parquet: distance to the target in metres
    #[arg(long, value_name = "M", help_heading = "Dataset")]
    distance_m: Option<f64>,
    /// parquet: an image of the scene as it is, (n, n)
    #[arg(long, value_name = "FILE.npy", help_heading = "Dataset")]
    truth: Option<PathBuf>,
    #[command(flatten)]
    report: ReportArgs,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let Args { recording, to, out, keep_leak, no_flat_field, scene, distance_m, truth, report } =
        args;
    let out = out.unwrap_or_else(|| to.beside(&recording));
    let options = ExportOptions { keep_leak, no_flat_field, scene, distance_m, truth };
    let exported = export(&recording, &out, to, &options)?;
    report.print(&exported, |exported| {
        print::notes(&exported.notes)?;
        print::line(exported)
    })
}
