//! Chooses the calibration of a capture: the kept calibration of the camera, one from a file, or a
//! new measurement.

use super::{Calibration, Capture};
use nirspi_camera::calibration::{KeptCalibration, KeptFileError, KeptFlatField, path_of};
use nirspi_camera::setup::MeasurementSetup;
use nirspi_files::causes;
use nirspi_files::identity::CameraIdentity;
use serde::Serialize;
use std::path::PathBuf;
use thiserror::Error;

/// The user's choice of the source of latency and settling.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum CalibrationPolicy {
    /// The calibration kept for the camera's serial number, or a new measurement if none is kept.
    #[default]
    Kept,
    /// Always a new measurement. If the burst is too dim, the kept calibration is used.
    Measure,
    /// The calibration in this file.
    File(PathBuf),
    /// The latency in the setup is right, and the leak is not corrected.
    Off,
}

/// The source of a kept calibration that a capture uses.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Origin {
    /// Time of measurement, as `2026-11-20 08:30 UTC`.
    pub measured: String,
    /// The calibration's file.
    pub file: PathBuf,
}

/// The calibration for one capture, and its remarks for the user.
#[derive(Debug, Clone)]
pub struct Choice {
    /// The calibration for [`crate::capture::CaptureOptions`].
    pub calibration: Calibration,
    /// The kept calibration that is used, or would replace a burst that is too dim.
    pub origin: Option<Origin>,
    /// Why a kept calibration or flat field is not used.
    pub note: Option<String>,
    /// The flat field kept for the camera, by which images are corrected.
    pub flat_field: Option<KeptFlatField>,
}

/// Why no calibration could be chosen.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PolicyError {
    /// Single patterns need the current dark level, which a file does not have.
    #[error(
        "a calibration file with single patterns (no complements): their dark level must be measured at the same time, \
         expected a policy that measures"
    )]
    DarkLevel,
    /// The file is not a calibration of this camera.
    #[error(transparent)]
    File(#[from] KeptFileError),
}

impl CalibrationPolicy {
    /// Chooses the calibration for `camera` and `setup`.
    ///
    /// Patterns without complements need the current dark level, so a burst always precedes them.
    ///
    /// # Errors
    /// [`PolicyError`] if the requested file cannot be used. A kept calibration that cannot be used
    /// is reported as a remark and skipped.
    pub fn choose(
        &self,
        setup: &MeasurementSetup,
        camera: &CameraIdentity,
    ) -> Result<Choice, PolicyError> {
        let mut choice = self.latency(setup, camera)?;
        if *self != Self::Off {
            match KeptFlatField::of(camera) {
                Ok(kept) => choice.flat_field = kept,
                Err(problem) => {
                    let problem = causes::in_one_line(&problem);
                    let note = format!("kept flat field not used: {problem}");
                    choice.note =
                        Some(choice.note.map_or_else(|| note.clone(), |n| format!("{n}; {note}")));
                }
            }
        }
        Ok(choice)
    }

    /// Chooses the source of latency and settling.
    fn latency(
        &self,
        setup: &MeasurementSetup,
        camera: &CameraIdentity,
    ) -> Result<Choice, PolicyError> {
        let measure_first = *self == Self::Measure || !setup.differential;
        match self {
            Self::Off => Ok(Choice::plain(Calibration::None)),
            Self::File(_) if !setup.differential => Err(PolicyError::DarkLevel),
            Self::File(file) => {
                let kept = KeptCalibration::read(file, camera)?;
                Ok(Choice::of(kept, file.clone(), false))
            }
            Self::Kept | Self::Measure => {
                // A user without a home directory has no kept calibration.
                let Some(file) = path_of(&camera.serial).ok().filter(|file| file.exists()) else {
                    return Ok(Choice::plain(Calibration::Measure));
                };
                Ok(match KeptCalibration::read(&file, camera) {
                    Ok(kept) => Choice::of(kept, file, measure_first),
                    Err(problem) => {
                        let problem = causes::in_one_line(&problem);
                        let note = format!("kept calibration not used, measured afresh: {problem}");
                        Choice { note: Some(note), ..Choice::plain(Calibration::Measure) }
                    }
                })
            }
        }
    }
}

impl Choice {
    /// The kept calibration that this capture used; `None` if the capture measured its own
    /// calibration or used none.
    #[must_use]
    pub fn used(&self, captured: &Capture) -> Option<&Origin> {
        // A replay uses the settling of its recording.
        let kept = matches!(&self.calibration, Calibration::Kept(kept) if captured.settling.as_ref() == Some(kept))
            || captured.calibration_problem.is_some();
        self.origin.as_ref().filter(|_| kept)
    }

    fn plain(calibration: Calibration) -> Self {
        Self { calibration, origin: None, note: None, flat_field: None }
    }

    fn of(kept: KeptCalibration, file: PathBuf, measure_first: bool) -> Self {
        let origin = Some(Origin { measured: kept.measured(), file });
        let calibration = if measure_first {
            Calibration::MeasureOr(kept.settling)
        } else {
            Calibration::Kept(kept.settling)
        };
        Self { calibration, origin, note: None, flat_field: None }
    }
}
