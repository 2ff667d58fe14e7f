//! ADC latency and settling of a camera: measured from a burst, kept by serial number, chosen for a capture.
//!
//! Latency belongs to the instrument, not to the scene. It is measured against a white sheet (`nirspi calibrate`,
//! `nirspi selftest`), kept, and used for every capture after it.
//!
//! # Invariant
//! No capture runs with a latency that neither was measured nor is known to the user
//! (`a_dark_scene_uses_the_kept_latency_or_fails`, in `host/tests/calibration.rs`).

mod burst;
mod check;
mod kept;
mod policy;

pub(crate) use burst::ONSET;
pub use burst::{BURSTS, CalibrationError, HALF_PERIOD, Settling, calibrate, calibrate_or};
pub use check::SettlingError;
pub use kept::{CalibrationFileError, KeptCalibration, path_of};
pub use policy::{CalibrationPolicy, Choice, Origin, PolicyError};
