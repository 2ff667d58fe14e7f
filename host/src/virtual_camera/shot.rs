//! One picture through the whole virtual camera: light, gateware model, firmware, packets, host.

use super::{MemoryLink, VirtualOptics, VirtualOpticsError};
use crate::calibration::{CalibrationError, Settling, calibrate};
use crate::capture::{
    Calibration, Capture, CaptureError, CaptureOptions, Ended, Progress, capture,
};
use crate::integrate::IntegrateError;
use crate::session::{IgnorePackets, Session, SessionError};
use crate::setup::MeasurementSetup;
use nirspi_recon::Measurements;
use nirspi_wire::Fault;
use std::ops::ControlFlow;
use thiserror::Error;

/// Why the virtual camera gave no picture.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ShotError {
    /// The optics cannot be built.
    #[error(transparent)]
    Optics(#[from] VirtualOpticsError),
    /// The conversation with the camera failed.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// A white sheet did not show the latency.
    #[error("the virtual camera is not calibrated before its white sheet")]
    Calibration(#[source] CalibrationError),
    /// The capture did not start.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The camera switched its LEDs off.
    #[error("the virtual camera switched its LEDs off: {0}")]
    Fault(Fault),
    /// The caller stopped the capture.
    #[error("the capture was stopped after {received} frames")]
    Stopped {
        /// Frames received until then.
        received: u64,
    },
    /// The camera did not make the frames that were asked for.
    #[error("the capture is not whole: {0}")]
    NotWhole(String),
    /// The frames give no measurements.
    #[error(transparent)]
    Integrate(#[from] IntegrateError),
}

/// Latency and settling of the camera behind these optics, measured against a white sheet where the lens is focused, as
/// its user would.
///
/// They are the instrument's: they hold for any scene, distance and weather, and should be measured once for many shots.
///
/// # Errors
/// [`ShotError`] if the camera sees no light even there.
pub fn calibrate_against_white(optics: &VirtualOptics, seed: u64) -> Result<Settling, ShotError> {
    let sheet = optics.white_sheet()?;
    let mut session = Session::open(Box::new(MemoryLink::new(sheet.camera(seed)?)))?;
    calibrate(&mut session, &mut IgnorePackets).map_err(ShotError::Calibration)
}

/// Captures `frames` frames with the camera behind these optics, whose latency and settling are known.
///
/// `watch` is called while frames come and may break to stop.
///
/// # Errors
/// [`ShotError`] unless all frames were made.
pub fn shoot(
    optics: &VirtualOptics,
    setup: MeasurementSetup,
    settling: &Settling,
    frames: u32,
    seed: u64,
    watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Shot, ShotError> {
    let mut session = Session::open(Box::new(MemoryLink::new(optics.camera(seed)?)))?;
    let calibration = if setup.differential {
        Calibration::Kept(settling.clone())
    } else {
        // Single patterns need the dark level in front of this scene.
        Calibration::MeasureOr(settling.clone())
    };
    let options = CaptureOptions { setup, frames: Some(frames), calibration, record: None };
    let capture = capture(&mut session, &options, watch)?;
    let missing = capture.missing();
    match capture.ended {
        Ended::Complete => Ok(Shot { session, capture }),
        Ended::Stopped => Err(ShotError::Stopped { received: capture.counters.received }),
        Ended::Fault(fault) => Err(ShotError::Fault(fault)),
        Ended::LinkLost(error) | Ended::Unconfirmed(error) => Err(error.into()),
        Ended::WrongNumber { .. } | Ended::Junk { .. } => {
            Err(ShotError::NotWhole(missing.unwrap_or_default()))
        }
    }
}

/// What one shot brought.
pub struct Shot {
    /// The conversation, which knows the camera's identity.
    pub session: Session,
    /// The frames and their account.
    pub capture: Capture,
}

impl Shot {
    /// The measurements, with the leak from pattern to pattern undone.
    ///
    /// # Errors
    /// [`ShotError::Integrate`] where the camera's response cannot be undone.
    pub fn measurements(&self) -> Result<Measurements, ShotError> {
        let Capture { setup, settling, integrated, .. } = &self.capture;
        Ok(integrated.measurements(setup, settling.as_ref(), false)?)
    }
}
