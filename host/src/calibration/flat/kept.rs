//! Keeps flat fields between sessions: one JSON file a camera, next to its calibration.
//!
//! The flat field has its own file, because a self-test and new gateware renew latency and settling
//! but change neither LEDs nor lens.
//!
//! # Invariant
//! A flat field of another camera is never applied
//! (`super::tests::an_old_or_foreign_flat_field_is_refused_in_one_line`).

use super::{FlatField, Measured, Sweeps};
use crate::calibration::kept::{CalibrationFileError, date, path_with};
use crate::files::FileError;
use crate::files::output::OutputDir;
use crate::session::CameraIdentity;
use serde::{Deserialize, Serialize};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};
use thiserror::Error;

/// Version of the file's format. A field with a new meaning needs a new version.
const FORMAT: u32 = 1;

/// A flat field in its file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KeptFlatField {
    /// Always `nirspi flat field`.
    kind: Kind,
    /// Version of the format.
    version: u32,
    /// When it was measured, in seconds since 1970.
    measured_unix_s: u64,
    /// Time of measurement in words.
    measured: String,
    /// The camera that was measured.
    pub camera: CameraIdentity,
    /// Number of summed sweeps.
    pub sweeps: Sweeps,
    /// Fixed pattern of images of the white sheet without the flat field, as a share of white.
    pub pattern_before: f64,
    /// Fixed pattern with the flat field, as a share of white.
    pub pattern_after: f64,
    /// The flat field.
    pub flat: FlatField,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
enum Kind {
    #[serde(rename = "nirspi flat field")]
    FlatField,
}

/// Why a flat field cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FlatFieldFileError {
    /// The file cannot be read.
    #[error("{path}: cannot read the flat field")]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The file is not a flat field.
    #[error("{path}: {reason}, expected a flat field written by nirspi calibrate --white")]
    Format {
        /// The file.
        path: PathBuf,
        /// The problem.
        reason: String,
    },
    /// The file has another version of the format.
    #[error(
        "{path}: a flat field of format {found}, expected {FORMAT}: run nirspi calibrate --white again"
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// The file's version.
        found: u32,
    },
    /// The flat field was measured on another camera.
    #[error(
        "{path}: measured with {field} {found}, this camera has {expected}: run nirspi calibrate --white"
    )]
    Mismatch {
        /// The file.
        path: PathBuf,
        /// The name of the property that differs.
        field: &'static str,
        /// The property in the file.
        found: String,
        /// The property of this camera.
        expected: String,
    },
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] FileError),
    /// There is no folder for the file.
    #[error(transparent)]
    Place(#[from] CalibrationFileError),
}

impl KeptFlatField {
    /// A flat field measured at `when`.
    #[must_use]
    pub fn new(
        camera: CameraIdentity,
        measured: Measured,
        sweeps: Sweeps,
        when: SystemTime,
    ) -> Self {
        let measured_unix_s = when.duration_since(UNIX_EPOCH).map_or(0, |age| age.as_secs());
        let Measured { flat, pattern_before, pattern_after, .. } = measured;
        Self {
            kind: Kind::FlatField,
            version: FORMAT,
            measured_unix_s,
            measured: date(measured_unix_s),
            camera,
            sweeps,
            pattern_before,
            pattern_after,
            flat,
        }
    }

    /// A copy with `flat`, which includes a dark frame, in place of its own flat field.
    #[must_use]
    pub fn renewed(self, flat: FlatField) -> Self {
        Self { flat, ..self }
    }

    /// A summary for the user: time of measurement, the pattern that the flat field removes, and
    /// the dead LEDs.
    #[must_use]
    pub fn summary(&self) -> String {
        let percent = |share: f64| 100.0 * share;
        let mut text = format!(
            "flat field of {}: pattern {:.2} % of white, {:.2} % once corrected",
            self.measured,
            percent(self.pattern_before),
            percent(self.pattern_after)
        );
        let dead = self.flat.dead_leds();
        if !dead.is_empty() {
            // The file lists all dead LEDs.
            let named: Vec<String> = dead
                .iter()
                .take(8)
                .map(|[row, column]| format!("row {row} column {column}"))
                .collect();
            let more = if dead.len() > named.len() { ", ..." } else { "" };
            let leds = if dead.len() == 1 { "LED" } else { "LEDs" };
            text += &format!("; {} dead {leds} ({}{more})", dead.len(), named.join(", "));
        }
        text
    }

    /// Writes the file, whole or not at all.
    ///
    /// # Errors
    /// If the folder cannot be made, or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), FlatFieldFileError> {
        let json = serde_json::to_vec(self).map_err(|error| format_error(path, &error))?;
        let folder = path.parent().unwrap_or(Path::new("."));
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mut folder = OutputDir::create(folder)?;
        folder.write(&name, &json)?;
        folder.commit()?;
        Ok(())
    }

    /// Reads the file for use with `camera`.
    ///
    /// # Errors
    /// If there is no file, or the flat field does not belong to this camera.
    pub fn read(path: &Path, camera: &CameraIdentity) -> Result<Self, FlatFieldFileError> {
        /// The fields that every version has.
        #[derive(Deserialize)]
        struct Head {
            #[serde(rename = "kind")]
            _kind: Kind,
            version: u32,
        }
        let text = std::fs::read(path)
            .map_err(|source| FlatFieldFileError::Io { path: path.to_owned(), source })?;
        let head: Head =
            serde_json::from_slice(&text).map_err(|error| format_error(path, &error))?;
        if head.version != FORMAT {
            let found = head.version;
            return Err(FlatFieldFileError::Version { path: path.to_owned(), found });
        }
        let kept: Self =
            serde_json::from_slice(&text).map_err(|error| format_error(path, &error))?;
        let same = [
            ("serial number", &kept.camera.serial, &camera.serial),
            ("board", &kept.camera.board, &camera.board),
        ];
        if let Some((field, found, expected)) = same.into_iter().find(|(_, a, b)| a != b) {
            let (found, expected) = (found.clone(), expected.clone());
            let path = path.to_owned();
            return Err(FlatFieldFileError::Mismatch { path, field, found, expected });
        }
        Ok(kept)
    }

    /// The kept flat field of this camera; `None` if no flat field is kept.
    ///
    /// # Errors
    /// If the kept flat field cannot be used.
    pub fn of(camera: &CameraIdentity) -> Result<Option<Self>, FlatFieldFileError> {
        // A user without a home directory has no kept flat field.
        let Some(path) = flat_field_path_of(&camera.serial).ok().filter(|path| path.exists())
        else {
            return Ok(None);
        };
        Self::read(&path, camera).map(Some)
    }
}

fn format_error(path: &Path, error: &serde_json::Error) -> FlatFieldFileError {
    FlatFieldFileError::Format { path: path.to_owned(), reason: error.to_string() }
}

/// The path of the flat field of the camera with this serial number.
///
/// # Errors
/// If the user has no home directory.
pub fn flat_field_path_of(serial: &str) -> Result<PathBuf, FlatFieldFileError> {
    Ok(path_with(serial, "flat.json")?)
}
