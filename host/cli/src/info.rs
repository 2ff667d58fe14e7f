//! `nirspi info`: the identity of a camera, whether it fits this program, and what to update.

use super::address::{self, CameraAddress};
use super::camera::SceneArgs;
use super::print;
use anyhow::Result;
use nirspi::session::{CameraIdentity, Reports, Session, SessionError};
use nirspi::versions::{Part, compare};
use nirspi_wire::Status;
use nirspi_wire::register::{IDENTITY, Register};
use serde::Serialize;
use std::process::ExitCode;

/// Show a camera's identity and versions, and what to update
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi info --camera usb\n\
    \x20 nirspi info --camera serial:/dev/ttyACM0 --json")]
pub struct Args {
    /// Which camera: virtual, usb, usb:SERIAL, tcp:HOST:PORT or serial:PATH[:BAUD]
    #[arg(long, value_name = "CAMERA", default_value = "virtual")]
    camera: CameraAddress,
    #[command(flatten)]
    scene: SceneArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Report<'r> {
    camera: &'r CameraIdentity,
    parts: Vec<Part>,
    fpga_answers: bool,
    state: String,
    uptime_s: f64,
    /// `null` if the sensor does not answer.
    temperature_celsius: Option<f64>,
    interlock_closed: bool,
    /// Events of the camera while no host was connected.
    reports: Vec<String>,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let mut session = address::open_quietly(&args.camera, &args.scene)?;
    let mut reports = Reports(session.reports().to_vec());
    let (identity_register, map) = registers(&mut session, &mut reports)?;
    let status = session.status(&mut reports)?;
    let fpga_answers = identity_register == Some(IDENTITY);
    let camera = session.identity();
    let parts = compare(camera, map.filter(|_| fpga_answers));
    let report = Report {
        camera,
        parts,
        fpga_answers,
        state: match status.fault {
            Some(fault) => format!("{}: {fault}", status.state),
            None => status.state.to_string(),
        },
        uptime_s: status.uptime_us as f64 * 1e-6,
        temperature_celsius: temperature(&status),
        interlock_closed: status.interlock_closed,
        reports: reports.0,
    };
    if args.json {
        print::json(&report)?;
    } else {
        say(&report)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The values of the FPGA's identity and version registers; `None` if the FPGA does not answer.
fn registers(
    session: &mut Session,
    reports: &mut Reports,
) -> Result<(Option<u32>, Option<u32>), SessionError> {
    let mut read = |register| match session.register(register, reports) {
        Ok(value) => Ok(Some(value)),
        Err(SessionError::Refused { .. }) => Ok(None),
        Err(error) => Err(error),
    };
    Ok((read(Register::Identity)?, read(Register::Version)?))
}

fn temperature(status: &Status) -> Option<f64> {
    let reading = status.temperature_centi_celsius;
    (reading != i16::MIN).then(|| f64::from(reading) / 100.0)
}

fn say(report: &Report<'_>) -> Result<()> {
    let camera = report.camera;
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
    if !report.fpga_answers {
        print::line("the FPGA does not answer: is it powered, and is its gateware loaded?")?;
    }
    report.reports.iter().try_for_each(print::line)
}
