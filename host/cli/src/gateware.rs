//! `nirspi camera gateware`: loads a bitstream into a camera's FPGA.

use super::address;
use super::camera::{ModelArgs, SceneArgs};
use super::print;
use super::progress::Progress;
use super::report::ReportArgs;
use anyhow::{Context, Result};
use nirspi::address::CameraAddress;
use nirspi::session::Session;
use nirspi_update::gateware;
use nirspi_wire::Version;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Load gateware into a camera's FPGA, through its firmware
///
/// The FPGA keeps the gateware until its power is switched off; the page of the board says how to store gateware
/// permanently. A board that cannot load gateware refuses.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi camera gateware target/gateware/ecp5-evn/nirspi.bit --camera usb")]
pub struct Args {
    /// The bitstream, as `hdl/build.py` writes it
    #[arg(value_name = "FILE")]
    bitstream: PathBuf,
    /// Which camera: usb, usb:SERIAL, tcp:HOST:PORT or serial:PATH[:BAUD]
    #[arg(long, value_name = "CAMERA")]
    camera: CameraAddress,
    #[command(flatten)]
    report: ReportArgs,
}

#[derive(Debug, Serialize)]
struct Report {
    bytes: usize,
    gateware: String,
}

/// Opens the camera. A virtual one looks at a white sheet.
pub fn open(camera: &CameraAddress) -> Result<Session> {
    let model = ModelArgs { camera_model: "paper".to_owned() };
    address::open(camera, &SceneArgs::white_sheet(&model, 1))
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let file = args.bitstream.display();
    let bitstream = nirspi::files::read_small(&args.bitstream).with_context(|| file.to_string())?;
    let mut session = open(&args.camera)?;
    let bar = Progress::of("loading", bitstream.len(), "bytes");
    let loaded = gateware::load(&mut session, &bitstream, &mut |bytes| bar.set(bytes));
    drop(bar);
    let version = loaded.with_context(|| file.to_string())?;
    let report =
        Report { bytes: bitstream.len(), gateware: Version::of_register(version).to_string() };
    args.report.print_answer(&report, |report| {
        print::line(format_args!("the FPGA runs gateware {}", report.gateware))
    })
}
