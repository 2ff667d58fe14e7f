//! Keeps calibrations between sessions: a self-test measures latency and response for later
//! captures.
//!
//! Each camera has one JSON file, named after its serial number, in the user's data directory.
//! Latency and step response are in ADC clocks and hold for any dwell and blanking, so a
//! calibration depends only on the camera and its gateware. Its dark level holds only for the time
//! of measurement. Captures without complements need the current dark level and do not use the kept
//! one.
//!
//! # Invariant
//! A calibration of another camera, or of other gateware, is never applied
//! (`tests::a_calibration_of_something_else_is_refused_in_one_line`).

use super::file::{Kept, KeptFileError, path_with};
use crate::check::Check;
use crate::response::Settling;
use nirspi_files::clock::date;
use nirspi_files::identity::CameraIdentity;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// The ending of the file's name.
const ENDING: &str = "json";

/// A calibration in its file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KeptCalibration {
    /// Always `nirspi calibration`.
    kind: Kind,
    /// Version of the format.
    version: u32,
    /// When it was measured, in seconds since 1970.
    measured_unix_s: u64,
    /// Time of measurement in words.
    measured: String,
    /// The camera that was measured.
    pub camera: CameraIdentity,
    /// Latency and step response.
    pub settling: Settling,
    /// The checks that the camera has passed.
    pub checks: Vec<Check>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
enum Kind {
    #[serde(rename = "nirspi calibration")]
    Calibration,
}

impl KeptCalibration {
    /// A calibration measured at `when`.
    #[must_use]
    pub fn new(
        camera: CameraIdentity,
        settling: Settling,
        checks: Vec<Check>,
        when: SystemTime,
    ) -> Self {
        let measured_unix_s = when.duration_since(UNIX_EPOCH).map_or(0, |age| age.as_secs());
        let measured = date(measured_unix_s);
        let (kind, version) = (Kind::Calibration, Kept::Calibration.format());
        Self { kind, version, measured_unix_s, measured, camera, settling, checks }
    }

    /// Time of measurement, as `2026-11-20 08:30 UTC`: from the seconds in the file, because its words
    /// for the time could hold anything.
    #[must_use]
    pub fn measured(&self) -> String {
        date(self.measured_unix_s)
    }

    /// Keeps the calibration in a file, whole or not at all: in the camera's own, or in the `named` one.
    /// A calibration of the same camera there is replaced. Returns the path.
    ///
    /// # Errors
    /// If the named file holds anything else, the folder cannot be made, or the file cannot be written.
    pub fn keep(&self, named: Option<&Path>) -> Result<PathBuf, KeptFileError> {
        Kept::Calibration.keep::<Kind>(named, &self.camera, ENDING, self)
    }

    /// Reads the file for use with `camera`.
    ///
    /// # Errors
    /// If there is no file, or the calibration does not belong to this camera.
    pub fn read(path: &Path, camera: &CameraIdentity) -> Result<Self, KeptFileError> {
        let file = Kept::Calibration;
        let kept: Self = file.read::<Kind, Self>(path)?;
        kept.settling.check().map_err(|problem| file.format_error(path, &problem))?;
        let (then, now) = (&kept.camera, camera);
        let same = [
            ("serial number", then.serial.clone(), now.serial.clone()),
            ("board", then.board.clone(), now.board.clone()),
            ("gateware", then.gateware.clone(), now.gateware.clone()),
            ("ADC rate in Hz", then.adc_hz.to_string(), now.adc_hz.to_string()),
        ];
        file.check(path, &same)?;
        Ok(kept)
    }
}

/// The path of the calibration of the camera with this serial number.
///
/// # Errors
/// If the user has no home directory.
pub fn path_of(serial: &str) -> Result<PathBuf, KeptFileError> {
    path_with(serial, ENDING)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn camera() -> CameraIdentity {
        CameraIdentity::current("virtual", "A 1")
    }

    fn kept() -> KeptCalibration {
        let settling = Settling {
            adc_latency: 6,
            response: vec![0.4, 0.9],
            dark_counts: 2048.0,
            step_counts: 8000.0,
            noise_counts: 18.5,
            tile_sag: 0.0165,
        };
        let when = UNIX_EPOCH + Duration::from_secs(1_795_163_400);
        KeptCalibration::new(camera(), settling, vec![Check::told("x", true, "")], when)
    }

    #[test]
    fn a_calibration_comes_back_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("made/for/it/a.json");
        assert_eq!(kept().keep(Some(&path)).unwrap(), path);
        assert_eq!(KeptCalibration::read(&path, &camera()).unwrap(), kept());
        assert_eq!(kept().measured(), "2026-11-20 08:30 UTC");
    }

    #[test]
    fn a_calibration_of_something_else_is_refused_in_one_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        assert_eq!(kept().keep(Some(&path)).unwrap(), path);
        type Change<'c> = (&'c str, &'c dyn Fn(&mut CameraIdentity));
        let changes: [Change<'_>; 4] = [
            ("serial number A 1", &|camera| camera.serial = "B2".into()),
            ("board virtual", &|camera| camera.board = "nucleo".into()),
            ("gateware", &|camera| camera.gateware = "0.2.0".into()),
            ("ADC rate in Hz 125000000", &|camera| camera.adc_hz = 100_000_000),
        ];
        for (words, change) in changes {
            let mut camera = camera();
            change(&mut camera);
            let error = KeptCalibration::read(&path, &camera).unwrap_err().to_string();
            assert!(error.contains(words) && error.lines().count() == 1, "{error}");
        }
        // Newer firmware with the same gateware does not change the path from light to sample.
        let newer = CameraIdentity { firmware: "9.9.9".into(), ..camera() };
        KeptCalibration::read(&path, &newer).unwrap();
    }

    #[test]
    fn a_calibration_replaces_none_of_another_camera_and_no_other_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        let mut real = kept();
        (real.camera.board, real.camera.serial) = ("nucleo".into(), "77".into());
        real.keep(Some(&path)).unwrap();
        let newer = KeptCalibration { measured_unix_s: 1, ..real.clone() };
        newer.keep(Some(&path)).unwrap();
        assert_eq!(KeptCalibration::read(&path, &real.camera).unwrap(), newer);
        let error = kept().keep(Some(&path)).unwrap_err().to_string();
        assert!(
            error.contains("calibration of nucleo 77, and this camera is virtual A 1"),
            "{error}"
        );
        assert_eq!(KeptCalibration::read(&path, &real.camera).unwrap(), newer);
        std::fs::write(&path, "my notes").unwrap();
        let error = kept().keep(Some(&path)).unwrap_err().to_string();
        assert!(error.contains("expected a calibration"), "{error}");
        assert_eq!(std::fs::read(&path).unwrap(), b"my notes");
    }

    #[test]
    fn a_file_of_another_format_says_so() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        let error = |text: &str| {
            std::fs::write(&path, text).unwrap();
            KeptCalibration::read(&path, &camera()).unwrap_err().to_string()
        };
        let newer = error(r#"{"kind": "nirspi calibration", "version": 2, "other": []}"#);
        assert!(newer.contains("format 2, expected 1"), "{newer}");
        for foreign in ["", "{}", r#"{"kind": "shopping list", "version": 1}"#] {
            let error = error(foreign);
            assert!(error.contains("expected a calibration") && error.lines().count() == 1);
        }
    }
}
