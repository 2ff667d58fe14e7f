//! Which calibration a capture uses: the one kept for the camera, one from a file, or one measured first.

use super::{CalibrationFileError, KeptCalibration, KeptFlatField, path_of};
use crate::capture::{Calibration, Capture};
use crate::causes;
use crate::session::CameraIdentity;
use crate::setup::MeasurementSetup;
use serde::Serialize;
use std::path::PathBuf;
use thiserror::Error;

/// Where the user wants latency and settling to come from.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum CalibrationPolicy {
    /// The calibration kept for the camera's serial number; measured first where none is kept.
    #[default]
    Kept,
    /// Measured first, whatever is kept. A burst that is too dim falls back to the kept calibration.
    Measure,
    /// Read from this file.
    File(PathBuf),
    /// The latency in the setup is right, and the leak is left as it is.
    Off,
}

/// A kept calibration that a capture uses.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Origin {
    /// When it was measured, as `2026-11-20 08:30 UTC`.
    pub measured: String,
    /// The file that holds it.
    pub file: PathBuf,
}

/// The calibration for one capture, and what to tell the user about it.
#[derive(Debug, Clone)]
pub struct Choice {
    /// For [`crate::capture::CaptureOptions`].
    pub calibration: Calibration,
    /// The kept calibration that is used, or stands ready if a burst is too dim.
    pub origin: Option<Origin>,
    /// Why a kept calibration or flat field was passed over.
    pub note: Option<String>,
    /// The flat field kept for the camera: images are to be corrected by it.
    pub flat_field: Option<KeptFlatField>,
}

/// Why no calibration could be chosen.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PolicyError {
    /// Single patterns need the dark level of the moment, which a file does not hold.
    #[error(
        "a calibration file with single patterns (no complements): their dark level must be measured at the same time, \
         expected a policy that measures"
    )]
    DarkLevel,
    /// The file is no calibration of this camera.
    #[error(transparent)]
    File(#[from] CalibrationFileError),
}

impl CalibrationPolicy {
    /// The calibration for `camera` measuring with `setup`.
    ///
    /// Patterns without complements need the dark level of the moment, so they are always preceded by a burst.
    ///
    /// # Errors
    /// [`PolicyError`] if the file asked for cannot be used. A kept calibration that cannot be used is noted and passed
    /// over.
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

    /// Where latency and settling come from.
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
    /// The kept calibration that this capture has used; `None` if it has measured its own, or none.
    #[must_use]
    pub fn used(&self, captured: &Capture) -> Option<&Origin> {
        let kept = matches!(self.calibration, Calibration::Kept(_))
            || captured.calibration_problem.is_some();
        self.origin.as_ref().filter(|_| kept)
    }

    fn plain(calibration: Calibration) -> Self {
        Self { calibration, origin: None, note: None, flat_field: None }
    }

    fn of(kept: KeptCalibration, file: PathBuf, measure_first: bool) -> Self {
        let origin = Some(Origin { measured: kept.measured().to_owned(), file });
        let calibration = if measure_first {
            Calibration::MeasureOr(kept.settling)
        } else {
            Calibration::Kept(kept.settling)
        };
        Self { calibration, origin, note: None, flat_field: None }
    }
}
