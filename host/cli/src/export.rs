//! `nirspi recording export`, `recover`: a recording in another form, or repaired.

use super::camera::ModelArgs;
use super::print;
use super::progress::Progress;
use super::provenance::made;
use super::report::{Overwrite, ReportArgs, words};
use anyhow::Result;
use nirspi::export::{ExportOptions, Format, export};
use nirspi::recording::recover as recovered;
use std::path::PathBuf;
use std::process::ExitCode;

/// Write a recording in a form for other programs
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  nirspi recording export rec.mcap --to npz --out rec.npz")]
pub struct Args {
    /// Recording (.mcap)
    recording: PathBuf,
    /// Form of the file
    #[arg(long, value_parser = words(Format::ALL, |format| (format.name(), format.about())))]
    to: Format,
    /// File to write [default: the recording's name with the ending of the format]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Do not correct the readings for the leak from pattern to pattern
    #[arg(long)]
    keep_leak: bool,
    /// mcap: also enhanced images, and the spread of each pixel if the scene were measured again (9 runs of the network each)
    #[arg(long)]
    enhance: bool,
    #[command(flatten)]
    model: ModelArgs,
    #[command(flatten)]
    overwrite: Overwrite,
    #[command(flatten)]
    report: ReportArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let out = args.out.clone().unwrap_or_else(|| args.to.beside(&args.recording));
    let options = ExportOptions {
        keep_leak: args.keep_leak,
        model: Some(args.model.read()?),
        enhance: args.enhance,
        overwrite: args.overwrite.overwrite,
    };
    let working = Progress::working("export");
    let exported = export(&args.recording, &out, args.to, &options, made())?;
    drop(working);
    args.report.print_answer(&exported, |exported| {
        exported.warnings.iter().for_each(print::warning);
        print::notes(&exported.notes)?;
        print::line(exported)
    })
}

/// Copy what can be read of a damaged recording into a new one, and say what is lost
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  nirspi recording recover rec.mcap --out whole.mcap")]
pub struct RecoverArgs {
    /// Recording (.mcap) that is damaged or cut short; the file stays as it is
    recording: PathBuf,
    /// The new recording
    #[arg(long, value_name = "FILE.mcap")]
    out: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
    #[command(flatten)]
    report: ReportArgs,
}

pub fn recover(args: &RecoverArgs) -> Result<ExitCode> {
    let working = Progress::working("recover");
    let recovered = recovered(&args.recording, &args.out, args.overwrite.overwrite)?;
    drop(working);
    args.report.print_answer(&recovered, |recovered| print::line(recovered))
}
