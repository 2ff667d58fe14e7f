//! `nirspi camera update`: brings a camera to the versions of a release.

use super::progress::Progress;
use super::report::ReportArgs;
use super::{flash, gateware, print};
use anyhow::{Context, Result};
use nirspi::address::CameraAddress;
use nirspi_update::{Plan, Release, await_firmware, load_gateware};
use std::path::PathBuf;
use std::process::ExitCode;

/// Update a camera's firmware and gateware from a release folder
///
/// Every file is verified and the release is checked against the camera before anything changes. Gateware goes through
/// the camera; a load that was cut goes on where it stopped. Firmware goes through a debug probe (feature `flash`).
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi camera update nirspi-0.1.0-firmware/ --camera usb --check\n\
    \x20 nirspi camera update nirspi-0.1.0-firmware/ecp5-evn.bit --camera usb")]
pub struct Args {
    /// A release folder, with release.json in it, or one of its files
    #[arg(value_name = "RELEASE")]
    release: PathBuf,
    /// Which camera: usb, usb:SERIAL, tcp:HOST:PORT or serial:PATH[:BAUD]
    #[arg(long, value_name = "CAMERA", default_value = "usb")]
    camera: CameraAddress,
    /// Say what would change, and change nothing
    #[arg(long)]
    check: bool,
    /// Which debug probe, where there are several: VID:PID:SERIAL as `nirspi camera flash --list` shows it
    #[arg(long, value_name = "PROBE")]
    probe: Option<String>,
    #[command(flatten)]
    report: ReportArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let release = Release::open(&args.release)?;
    let mut session = gateware::open(&args.camera)?;
    let plan = Plan::new(&release, session.identity())?;
    if !args.check {
        if let Some(firmware) = &plan.firmware {
            let chip = plan.chip().with_context(|| format!("{}: no chip to flash", plan.board))?;
            drop(session);
            flash::write(chip, &firmware.path, &firmware.content, args.probe.as_deref())?;
            session = await_firmware(firmware, || gateware::open(&args.camera))?;
        }
        if let Some(change) = &plan.gateware {
            let bar = Progress::of("loading", change.content.len(), "bytes");
            let loaded = load_gateware(&mut session, change, &mut |bytes| bar.set(bytes));
            drop(bar);
            loaded.with_context(|| change.path.display().to_string())?;
        }
    }
    args.report.print_answer(&plan, |plan| print::line(plan))
}
