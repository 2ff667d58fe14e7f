//! Keeps flat fields between sessions: one JSON file a camera, next to its calibration.
//!
//! The flat field has its own file, because a self-test and new gateware renew latency and settling
//! but change neither LEDs nor lens.
//!
//! # Invariant
//! A flat field of another camera is never applied
//! (`super::tests::an_old_or_foreign_flat_field_is_refused_in_one_line`).

use super::{FlatField, Measured, Sweeps};
use crate::calibration::file::{Kept, KeptFileError, path_with};
use nirspi_files::clock::date;
use nirspi_files::identity::CameraIdentity;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// The ending of the file's name.
const ENDING: &str = "flat.json";

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
            version: Kept::FlatField.format(),
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
            date(self.measured_unix_s),
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

    /// Keeps the flat field in a file, whole or not at all: in the camera's own, or in the `named` one. A
    /// flat field of the same camera there is replaced. Returns the path.
    ///
    /// # Errors
    /// If the named file holds anything else, the folder cannot be made, or the file cannot be written.
    pub fn keep(&self, named: Option<&Path>) -> Result<PathBuf, KeptFileError> {
        Kept::FlatField.keep::<Kind>(named, &self.camera, ENDING, self)
    }

    /// Reads the file for use with `camera`.
    ///
    /// # Errors
    /// If there is no file, or the flat field does not belong to this camera.
    pub fn read(path: &Path, camera: &CameraIdentity) -> Result<Self, KeptFileError> {
        let kept: Self = Kept::FlatField.read::<Kind, Self>(path)?;
        let same = [
            ("serial number", kept.camera.serial.clone(), camera.serial.clone()),
            ("board", kept.camera.board.clone(), camera.board.clone()),
        ];
        Kept::FlatField.check(path, &same)?;
        Ok(kept)
    }

    /// The kept flat field of this camera; `None` if no flat field is kept.
    ///
    /// # Errors
    /// If the kept flat field cannot be used.
    pub fn of(camera: &CameraIdentity) -> Result<Option<Self>, KeptFileError> {
        // A user without a home directory has no kept flat field.
        let Some(path) = flat_field_path_of(&camera.serial).ok().filter(|path| path.exists())
        else {
            return Ok(None);
        };
        Self::read(&path, camera).map(Some)
    }
}

/// The path of the flat field of the camera with this serial number.
///
/// # Errors
/// If the user has no home directory.
fn flat_field_path_of(serial: &str) -> Result<PathBuf, KeptFileError> {
    path_with(serial, ENDING)
}
