//! `nirspi camera info`: who a camera is and what to update on it, or what a recording holds.

use super::camera::{CameraArgs, ModelArgs, SceneArgs};
use super::report::ReportArgs;
use super::{address, print};
use anyhow::Result;
use nirspi::info::info;
use nirspi::recording::RecordingInfo;
use std::path::PathBuf;
use std::process::ExitCode;

/// Show a camera's identity and versions, and what to update; or what a recording holds
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi camera info --camera usb\n\
    \x20 nirspi camera info --camera serial:/dev/ttyACM0 --json\n\
    \x20 nirspi camera info rec.mcap")]
pub struct Args {
    /// Recording (.mcap) to describe, instead of a camera
    recording: Option<PathBuf>,
    #[command(flatten)]
    camera: CameraArgs,
    #[command(flatten)]
    model: ModelArgs,
    #[command(flatten)]
    report: ReportArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    if let Some(recording) = &args.recording {
        return args
            .report
            .print_answer(&RecordingInfo::read(recording)?, |info| print::line(info));
    }
    let scene = SceneArgs::white_sheet(&args.model, 1);
    let report =
        info(&mut address::open_quietly(&args.camera.address(args.report.json)?, &scene)?)?;
    args.report.print_answer(&report, |report| print::line(report))
}
