//! ADC latency, settling and flat field of a camera: measured, kept by serial number, and chosen
//! for a capture.
//!
//! Latency belongs to the instrument and not to the scene. Latency is measured against a white
//! sheet (`nirspi camera calibrate`, `nirspi camera selftest`), kept, and used for every later capture.
//!
//! # Invariant
//! Every capture runs with a latency that was measured or that the user gave
//! (`a_dark_scene_uses_the_kept_latency_or_fails` in `host/virtual/tests/calibration.rs`).

mod burst;
mod file;
mod flat;
mod kept;

pub(crate) use burst::ONSET;
pub use burst::{BURSTS, CalibrationError, HALF_PERIOD, calibrate, calibrate_or};
pub use file::{Kept, KeptFileError};
pub use flat::{FlatField, FramesError, KeptFlatField, Measured, Sweeps, pattern_noise};
pub use kept::{KeptCalibration, path_of};
