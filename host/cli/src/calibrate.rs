//! `nirspi calibrate`: measures ADC latency and settling against a white sheet and keeps them for the camera.

use super::address::{self, CameraAddress};
use super::camera::{ModelArgs, SceneArgs};
use super::print;
use anyhow::{Context, Result};
use nirspi::calibration::{KeptCalibration, calibrate, path_of};
use nirspi::session::IgnorePackets;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::SystemTime;

/// Measure a camera's ADC latency and settling, and keep them for the captures after it
///
/// Hold a white sheet before the camera, as near as it is sharp. Latency and settling belong to the camera and its
/// gateware, so once is enough, until the gateware or the amplifier changes. `nirspi selftest` does the same and checks the
/// rest of the camera as well. A virtual camera looks at its white sheet by itself.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi calibrate --camera usb\n\
    \x20 nirspi calibrate --camera tcp:127.0.0.1:1550 --calibration bench-2.json")]
pub struct Args {
    /// Which camera: virtual, usb, usb:SERIAL, tcp:HOST:PORT or serial:PATH[:BAUD]
    #[arg(long, value_name = "CAMERA", default_value = "virtual")]
    camera: CameraAddress,
    /// Keep the calibration in this file instead of under the camera's serial number in the user's data directory
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    #[command(flatten)]
    model: ModelArgs,
    /// Seed of the virtual camera's simulated noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Print a JSON report
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Report {
    #[serde(flatten)]
    kept: KeptCalibration,
    file: PathBuf,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let mut session = address::open(&args.camera, &SceneArgs::white_sheet(&args.model, args.seed))?;
    let settling = calibrate(&mut session, &mut IgnorePackets)
        .with_context(|| format!("{}: not calibrated", args.camera))?;
    let camera = session.identity().clone();
    let file = match &args.calibration {
        Some(path) => path.clone(),
        None => path_of(&camera.serial)?,
    };
    let kept = KeptCalibration::new(camera, settling, Vec::new(), SystemTime::now());
    kept.write(&file)?;
    if args.json {
        print::json(&Report { kept, file })?;
        return Ok(ExitCode::SUCCESS);
    }
    let KeptCalibration { camera, settling, .. } = &kept;
    print::line(format_args!(
        "{} {}: ADC latency {} clocks, settled after {} clocks, a step of {:.0} ADC counts",
        camera.board,
        camera.serial,
        settling.adc_latency,
        settling.response.len(),
        settling.step_counts
    ))?;
    print::line(format_args!("kept in {}", file.display()))?;
    Ok(ExitCode::SUCCESS)
}
