//! Takes one picture through the whole virtual camera: light, gateware model, firmware, packets,
//! host.

use super::{MemoryLink, VirtualOptics, VirtualOpticsError};
use nirspi::calibration::{CalibrationError, FlatField, Sweeps, calibrate};
use nirspi::capture::{
    Calibration, Capture, CaptureError, CaptureOptions, Ended, FlatFieldError, Progress, StopCause,
    capture, measure_flat_field,
};
use nirspi::integrate::IntegrateError;
use nirspi::response::Settling;
use nirspi::session::{IgnorePackets, Session, SessionError};
use nirspi::setup::MeasurementSetup;
use nirspi_recon::{Measurements, Order, RowsError, reconstruct};
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
    /// The latency could not be measured against a white sheet.
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
    /// The camera did not make all requested frames.
    #[error("the capture is not whole: {0}")]
    NotWhole(String),
    /// Frames were lost between the camera and this program.
    #[error("{0}; frames of more sweeps come slower and are not lost")]
    Lost(String),
    /// A white sheet gives no light.
    #[error("a white sheet at {distance_m} m reads {counts:.3} ADC counts, expected more than 0")]
    NoWhite {
        /// The distance of the sheet.
        distance_m: f64,
        /// The mean of its pixels.
        counts: f64,
    },
    /// The flat field could not be measured against a white sheet.
    #[error("the virtual camera's flat field is not known")]
    FlatField(#[source] FlatFieldError),
    /// The patterns cannot be computed.
    #[error(transparent)]
    Rows(#[from] RowsError),
    /// The frames give no measurements.
    #[error(transparent)]
    Integrate(#[from] IntegrateError),
}

/// Latency and settling of the camera with these optics, measured as a user would: against a white
/// sheet at the lens's focus.
///
/// Latency and settling belong to the instrument and hold for any scene, distance and weather.
/// Measure them once for many shots.
///
/// # Errors
/// [`ShotError`] if the camera sees no light from the white sheet.
pub fn calibrate_against_white(optics: &VirtualOptics, seed: u64) -> Result<Settling, ShotError> {
    let sheet = optics.white_sheet()?;
    let mut session = Session::open(Box::new(MemoryLink::new(sheet.camera(seed)?)))?;
    calibrate(&mut session, &mut IgnorePackets).map_err(ShotError::Calibration)
}

/// Number of sweeps for the flat field of a virtual camera: 0.9 % of noise with the paper's camera.
const FLAT_FIELD_SWEEPS: u32 = 4000;

/// The flat field of the camera with these optics, measured as a user would: against a white sheet
/// at the lens's focus. `None` for a camera whose LEDs are all alike.
///
/// # Errors
/// [`ShotError`] if the sheet is too dim.
pub fn flat_field_against_white(
    optics: &VirtualOptics,
    settling: &Settling,
    seed: u64,
) -> Result<Option<FlatField>, ShotError> {
    if optics.camera_model().led_gains().iter().all(|&gain| gain == 1.0) {
        return Ok(None);
    }
    let sheet = optics.white_sheet()?;
    let setup = sheet.setup(&Order::Natural, 1.0)?;
    let mut session = Session::open(Box::new(MemoryLink::new(sheet.camera(seed)?)))?;
    let sweeps = Sweeps::of_map(FLAT_FIELD_SWEEPS);
    let mut go_on = |_: &Progress| ControlFlow::Continue(());
    match measure_flat_field(&mut session, &setup, settling, sweeps, &mut go_on) {
        Ok(measured) => Ok(Some(measured.flat)),
        // LEDs that differ by less than the noise need no flat field.
        Err(FlatFieldError::NothingGained { .. }) => Ok(None),
        Err(error) => Err(ShotError::FlatField(error)),
    }
}

/// Frames for the white level, and sweeps of each: 20 ms of light with the paper's camera.
const SHEET_FRAMES: u32 = 61;
const SHEET_SWEEPS: u32 = 4;
/// Makes the noise of the white sheet another one than that of the picture.
const SHEET_SEED: u64 = 0x5EE7 << 48;

/// The ADC counts of a pixel that sees a white sheet in place of the target, at the same distance
/// and in the same weather, measured as a user would: the scale of the target's images.
///
/// # Errors
/// [`ShotError`] if the sheet gives no light, or the capture fails.
pub fn white_level_at_target(
    optics: &VirtualOptics,
    settling: &Settling,
    flat_field: Option<&FlatField>,
    seed: u64,
) -> Result<f32, ShotError> {
    let sheet = optics.white_sheet_at_target()?;
    let setup = sheet.setup(&Order::Natural, 1.0)?;
    let setup = MeasurementSetup { sweeps: SHEET_SWEEPS, ..setup };
    let mut go_on = |_: &Progress| ControlFlow::Continue(());
    let seed = seed ^ SHEET_SEED;
    let shot = shoot(&sheet, setup, settling, SHEET_FRAMES, seed, &mut go_on)?;
    let image = reconstruct::hadamard(&shot.measurements()?);
    let image = match flat_field {
        Some(flat) => flat.correct(&image),
        None => image,
    };
    let sum: f64 = image.pixels().iter().map(|&counts| f64::from(counts)).sum();
    let counts = sum / image.pixels().len() as f64;
    if counts > 0.0 {
        return Ok(counts as f32);
    }
    Err(ShotError::NoWhite { distance_m: optics.distance_mm() / 1e3, counts })
}

/// Captures `frames` frames with the camera with these optics. Its latency and settling are known.
///
/// `watch` is called while frames arrive and may break to stop.
///
/// # Errors
/// [`ShotError`] unless all frames were made and received.
pub fn shoot(
    optics: &VirtualOptics,
    setup: MeasurementSetup,
    settling: &Settling,
    frames: u32,
    seed: u64,
    watch: &mut dyn FnMut(&Progress) -> ControlFlow<StopCause>,
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
        Ended::Complete => match missing {
            None => Ok(Shot { session, capture }),
            Some(missing) => Err(ShotError::Lost(missing)),
        },
        Ended::Stopped(_) => Err(ShotError::Stopped { received: capture.counters.received }),
        Ended::Fault(fault) => Err(ShotError::Fault(fault)),
        Ended::LinkLost(error) | Ended::Unconfirmed(error) => Err(error.into()),
        Ended::WrongNumber { .. } | Ended::Junk { .. } | Ended::NoFrames { .. } => {
            Err(ShotError::NotWhole(missing.unwrap_or_default()))
        }
    }
}

/// The result of one shot.
pub struct Shot {
    /// The session, which knows the camera's identity.
    pub session: Session,
    /// The frames and their account.
    pub capture: Capture,
}

impl Shot {
    /// The measurements, with the leak between patterns corrected.
    ///
    /// # Errors
    /// [`ShotError::Integrate`] if the camera's response cannot be corrected.
    pub fn measurements(&self) -> Result<Measurements, ShotError> {
        let Capture { setup, settling, integrated, .. } = &self.capture;
        Ok(integrated.measurements(setup, settling.as_ref(), false)?)
    }
}
