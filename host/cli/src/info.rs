//! `nirspi info`: the identity of a camera, whether it fits this program, and what to update.

use super::camera::{CameraArgs, ModelArgs, SceneArgs};
use super::report::ReportArgs;
use super::{address, print};
use anyhow::Result;
use nirspi::info::{Info, info};
use nirspi::versions::Part;
use std::process::ExitCode;

/// Show a camera's identity and versions, and what to update
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi info --camera usb\n\
    \x20 nirspi info --camera serial:/dev/ttyACM0 --json")]
pub struct Args {
    #[command(flatten)]
    camera: CameraArgs,
    #[command(flatten)]
    model: ModelArgs,
    #[command(flatten)]
    report: ReportArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
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
    for Part { name, camera, expected, advice, .. } in &report.parts {
        let verdict = advice.as_deref().unwrap_or("as expected");
        print::line(format_args!("{name:<13} {camera:<9} expected {expected:<9} {verdict}"))?;
    }
    print::line(&report.fpga)?;
    report.reports.iter().try_for_each(print::line)
}
