//! Arguments that say where a capture's ADC latency and settling come from.

use super::Usage;
use anyhow::Result;
use nirspi::capture::Calibration;
use nirspi::kept_calibration::{KeptCalibration, path_of};
use nirspi::session::CameraIdentity;
use nirspi::setup::MeasurementSetup;
use serde::Serialize;
use std::path::PathBuf;

/// Which calibration to use.
#[derive(Debug, Clone, clap::Args)]
pub struct CalibrationArgs {
    /// Measure ADC latency and settling first, whatever calibration is kept
    #[arg(long)]
    calibrate: bool,
    /// Use this calibration, written by `nirspi selftest`, rather than the one kept for the camera
    #[arg(long, value_name = "FILE", conflicts_with = "calibrate")]
    calibration: Option<PathBuf>,
    /// Use no calibration, and measure none
    #[arg(long, conflicts_with_all = ["calibrate", "calibration"])]
    no_calibration: bool,
    /// ADC clocks from light to sample, where they are not measured
    #[arg(long, value_name = "N", default_value_t = 0, requires = "no_calibration")]
    pub adc_latency: u8,
}

/// A kept calibration.
#[derive(Debug, Clone, Serialize)]
pub struct Origin {
    pub measured: String,
    pub file: PathBuf,
}

/// Where a capture's calibration comes from, and what is to be said about it.
pub struct Choice {
    pub calibration: Calibration,
    pub origin: Option<Origin>,
    pub note: Option<String>,
}

impl Choice {
    fn plain(calibration: Calibration) -> Self {
        Self { calibration, origin: None, note: None }
    }

    fn kept(kept: KeptCalibration, file: PathBuf) -> Self {
        let origin = Some(Origin { measured: kept.measured().to_owned(), file });
        Self { calibration: Calibration::Kept(kept.settling), origin, note: None }
    }
}

impl CalibrationArgs {
    /// The calibration for this camera and setup.
    pub fn choose(&self, setup: &MeasurementSetup, camera: &CameraIdentity) -> Result<Choice> {
        if self.no_calibration {
            return Ok(Choice::plain(Calibration::None));
        }
        if let Some(file) = &self.calibration {
            if !setup.differential {
                return Err(Usage(
                    "--calibration with --non-differential: patterns without complements need the dark level of the \
                     moment, use --calibrate"
                        .to_owned(),
                )
                .into());
            }
            return Ok(Choice::kept(KeptCalibration::read(file, camera)?, file.clone()));
        }
        if self.calibrate || !setup.differential {
            return Ok(Choice::plain(Calibration::Measure));
        }
        // No home, no calibration kept in it.
        let Some(file) = path_of(&camera.serial).ok().filter(|file| file.exists()) else {
            return Ok(Choice::plain(Calibration::Measure));
        };
        Ok(match KeptCalibration::read(&file, camera) {
            Ok(kept) => Choice::kept(kept, file),
            Err(problem) => {
                let problem = nirspi::causes::in_one_line(&problem);
                let note = Some(format!("kept calibration not used, measured afresh: {problem}"));
                Choice { note, ..Choice::plain(Calibration::Measure) }
            }
        })
    }
}
