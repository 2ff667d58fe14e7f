//! `nirspi gateware`: loads a bitstream into a camera's FPGA.

use super::address::{self, CameraAddress};
use super::camera::SceneArgs;
use super::print;
use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use nirspi::gateware;
use nirspi::versions::of_register;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Load gateware into a camera's FPGA, through its firmware
///
/// The FPGA keeps it until its power goes; the board's page says how to store it for good. A board that cannot load
/// gateware refuses.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi gateware target/gateware/ecp5-evn/nirspi.bit --camera usb")]
pub struct Args {
    /// The bitstream, as `hdl/build.py` writes it
    #[arg(value_name = "FILE")]
    bitstream: PathBuf,
    /// Which camera: usb, usb:SERIAL, tcp:HOST:PORT or serial:PATH[:BAUD]
    #[arg(long, value_name = "CAMERA")]
    camera: CameraAddress,
    #[command(flatten)]
    scene: SceneArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Report {
    bytes: usize,
    gateware: String,
}

/// A bar for a bitstream of this many bytes.
pub fn progress(bytes: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("loading {bar:30} {bytes}/{total_bytes}, {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(bytes as u64).with_style(style)
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let file = args.bitstream.display();
    let bitstream = std::fs::read(&args.bitstream).with_context(|| file.to_string())?;
    let mut session = address::open(&args.camera, &args.scene)?;
    let bar = progress(bitstream.len());
    let loaded =
        gateware::load(&mut session, &bitstream, &mut |bytes| bar.set_position(bytes.into()));
    bar.finish_and_clear();
    let version = loaded.with_context(|| file.to_string())?;
    let report = Report { bytes: bitstream.len(), gateware: of_register(version) };
    if args.json {
        print::json(&report)?;
    } else {
        print::line(format_args!("the FPGA runs gateware {}", report.gateware))?;
    }
    Ok(ExitCode::SUCCESS)
}
