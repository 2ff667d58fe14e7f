//! Arguments for the source of a capture's ADC latency and settling.

use super::Usage;
use anyhow::Result;
use nirspi::capture::{CalibrationPolicy, Choice, PolicyError};
use nirspi::identity::CameraIdentity;
use nirspi::setup::MeasurementSetup;
use std::path::PathBuf;

/// Which calibration to use.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Calibration")]
pub struct CalibrationArgs {
    /// Measure ADC latency and settling first, even if a calibration is kept. If the scene is too dim to measure them, the
    /// kept calibration is used
    #[arg(long)]
    calibrate: bool,
    /// Use this calibration, written by `nirspi camera calibrate` or `nirspi camera selftest`, instead of the one kept for the camera
    #[arg(long, value_name = "FILE", conflicts_with = "calibrate")]
    calibration: Option<PathBuf>,
    /// Use no calibration and measure none. This needs --adc-latency, and leaves the leak from pattern to pattern in the
    /// readings
    #[arg(long, conflicts_with_all = ["calibrate", "calibration"], requires = "adc_latency")]
    no_calibration: bool,
    /// ADC clocks from light to sample, if you know their number. A wrong number makes a wrong or inverted picture
    #[arg(long, value_name = "N", requires = "no_calibration")]
    adc_latency: Option<u8>,
    /// Do not correct images for unequal LEDs, even if `nirspi camera calibrate --white` has kept a flat field for the camera
    #[arg(long)]
    no_flat_field: bool,
}

impl CalibrationArgs {
    /// The latency for the measurement if there is no calibration.
    pub fn adc_latency(&self) -> u8 {
        self.adc_latency.unwrap_or(0)
    }

    fn policy(&self) -> CalibrationPolicy {
        match &self.calibration {
            _ if self.no_calibration => CalibrationPolicy::Off,
            Some(file) => CalibrationPolicy::File(file.clone()),
            None if self.calibrate => CalibrationPolicy::Measure,
            None => CalibrationPolicy::Kept,
        }
    }

    /// The calibration for this camera and setup.
    pub fn choose(&self, setup: &MeasurementSetup, camera: &CameraIdentity) -> Result<Choice> {
        let choice = self.policy().choose(setup, camera).map_err(|error| match error {
            PolicyError::DarkLevel => Usage(
                "--calibration with --non-differential: patterns without complements need the dark level of the \
                 moment, use --calibrate"
                    .to_owned(),
            )
            .into(),
            error => anyhow::Error::from(error),
        })?;
        Ok(if self.no_flat_field { Choice { flat_field: None, ..choice } } else { choice })
    }
}
