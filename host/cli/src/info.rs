//! `nirspi info`: who a camera is and what to update on it, or what a recording holds.

use super::camera::{CameraArgs, ModelArgs, SceneArgs};
use super::report::ReportArgs;
use super::{address, print};
use anyhow::Result;
use nirspi::info::{Info, info};
use nirspi::recording::RecordingInfo;
use nirspi::versions::Part;
use std::path::PathBuf;
use std::process::ExitCode;

/// Show a camera's identity and versions, and what to update; or what a recording holds
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi info --camera usb\n\
    \x20 nirspi info --camera serial:/dev/ttyACM0 --json\n\
    \x20 nirspi info rec.mcap")]
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
        return args.report.print(&RecordingInfo::read(recording)?, |info| print::line(info));
    }
    let scene = SceneArgs::white_sheet(&args.model, 1);
    let report = info(&mut address::open_quietly(&args.camera.camera, &scene)?)?;
    args.report.print(&report, say)
}

fn say(report: &Info) -> Result<()> {
    let camera = &report.camera;
    print::line(format_args!("{} {}", camera.board, camera.serial))?;
    print::line(format_args!(
        "ADC {} MS/s, {} bit; LEDs {} nm",
        camera.adc_hz / 1_000_000,
        camera.adc_bits,
        camera.wavelength_nm
    ))?;
    if !camera.capabilities.is_empty() {
        print::line(format_args!("capabilities: {}", camera.capabilities.join(", ")))?;
    }
    let sensor = report
        .temperature_celsius
        .map_or_else(|| "no temperature sensor".to_owned(), |celsius| format!("{celsius:.1} °C"));
    let interlock = if report.interlock_closed { "closed" } else { "open" };
    print::line(format_args!("{}, {sensor}, interlock {interlock}", report.state))?;
    report.signal.iter().try_for_each(print::line)?;
    for Part { name, camera, expected, advice, .. } in &report.parts {
        let verdict = advice.as_deref().unwrap_or("as expected");
        print::line(format_args!("{name:<13} {camera:<9} expected {expected:<9} {verdict}"))?;
    }
    print::line(&report.fpga)?;
    report.reports.iter().try_for_each(print::line)
}
