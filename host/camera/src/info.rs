//! What a camera says of itself: identity, versions, state, and what happened while no host was
//! connected.

use crate::fpga::Fpga;
use crate::session::{Session, SessionError};
use crate::signal::Signal;
use crate::versions::{Part, compare};
use nirspi_files::identity::CameraIdentity;
use nirspi_wire::Status;
use serde::Serialize;
use std::fmt;

/// A camera's identity, versions and state.
#[derive(Debug, Serialize)]
pub struct Info {
    /// Who the camera is.
    pub camera: CameraIdentity,
    /// The versions of its parts, beside those that this program expects.
    pub parts: Vec<Part>,
    /// Whether the FPGA answers.
    pub fpga_answers: bool,
    /// What the FPGA is built for and its ADC clock, or what to check where it cannot be used.
    pub fpga: String,
    /// The camera's state, and its fault if one is latched.
    pub state: String,
    /// Seconds since the camera was switched on.
    pub uptime_s: f64,
    /// `null` if the sensor does not answer.
    pub temperature_celsius: Option<f64>,
    /// Whether the interlock is closed.
    pub interlock_closed: bool,
    /// What the detector saw in the last run; `null` before one.
    pub signal: Option<Signal>,
    /// Events of the camera while no host was connected.
    pub reports: Vec<String>,
}

impl fmt::Display for Info {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let camera = &self.camera;
        writeln!(f, "{} {}", camera.board, camera.serial)?;
        let (mega, bits, nm) = (camera.adc_hz / 1_000_000, camera.adc_bits, camera.wavelength_nm);
        writeln!(f, "ADC {mega} MS/s, {bits} bit; LEDs {nm} nm")?;
        if !camera.capabilities.is_empty() {
            writeln!(f, "capabilities: {}", camera.capabilities.join(", "))?;
        }
        let sensor = self.temperature_celsius.map_or_else(
            || "no temperature sensor".to_owned(),
            |celsius| format!("{celsius:.1} °C"),
        );
        let interlock = if self.interlock_closed { "closed" } else { "open" };
        writeln!(f, "{}, {sensor}, interlock {interlock}", self.state)?;
        if let Some(signal) = &self.signal {
            writeln!(f, "{signal}")?;
        }
        for Part { name, camera, expected, advice, .. } in &self.parts {
            let verdict = advice.as_deref().unwrap_or("as expected");
            writeln!(f, "{name:<13} {camera:<9} expected {expected:<9} {verdict}")?;
        }
        write!(f, "{}", self.fpga)?;
        self.reports.iter().try_for_each(|report| write!(f, "\n{report}"))
    }
}

/// Asks a camera for its identity, versions and state.
///
/// # Errors
/// [`SessionError`] if the camera does not answer, or answers with something else.
pub fn info(session: &mut Session) -> Result<Info, SessionError> {
    let mut reports = session.reports().clone();
    let fpga = Fpga::ask(session, &mut reports)?;
    let status = session.status(&mut reports)?;
    let camera = session.identity().clone();
    let parts = compare(&camera, fpga.version());
    Ok(Info {
        camera,
        parts,
        fpga_answers: fpga.answers(),
        fpga: fpga.to_string(),
        state: match status.fault {
            Some(fault) => format!("{}: {fault}", status.state),
            None => status.state.to_string(),
        },
        uptime_s: status.uptime_us as f64 * 1e-6,
        temperature_celsius: temperature(&status),
        interlock_closed: status.interlock_closed,
        signal: Signal::of(&status),
        reports: reports.lines,
    })
}

fn temperature(status: &Status) -> Option<f64> {
    let reading = status.temperature_centi_celsius;
    (reading != i16::MIN).then(|| f64::from(reading) / 100.0)
}
