//! What a camera says of itself: identity, versions, state, and what happened while no host was
//! connected.

use crate::session::{CameraIdentity, Reports, Session, SessionError};
use crate::signal::Signal;
use crate::versions::{Part, compare};
use nirspi_wire::Status;
use nirspi_wire::register::{IDENTITY, Register};
use serde::Serialize;

/// A camera's identity, versions and state.
#[derive(Debug, Serialize)]
pub struct Info {
    /// Who the camera is.
    pub camera: CameraIdentity,
    /// The versions of its parts, beside those that this program expects.
    pub parts: Vec<Part>,
    /// Whether the FPGA answers.
    pub fpga_answers: bool,
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

/// Asks a camera for its identity, versions and state.
///
/// # Errors
/// [`SessionError`] if the camera does not answer, or answers with something else.
pub fn info(session: &mut Session) -> Result<Info, SessionError> {
    let mut reports = Reports(session.reports().to_vec());
    let (identity_register, map) = registers(session, &mut reports)?;
    let status = session.status(&mut reports)?;
    let fpga_answers = identity_register == Some(IDENTITY);
    let camera = session.identity().clone();
    let parts = compare(&camera, map.filter(|_| fpga_answers));
    Ok(Info {
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
        signal: Signal::of(&status),
        reports: reports.0,
    })
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
