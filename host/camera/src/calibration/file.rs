//! Files that are kept for a camera between sessions: what calibrations and flat fields share.

use etcetera::{BaseStrategy, HomeDirError, choose_base_strategy};
use nirspi_files::identity::CameraIdentity;
use nirspi_files::output::keep;
use nirspi_files::{FileError, read_small_text};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::{fmt, io};
use thiserror::Error;

/// What is kept in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kept {
    /// Latency and settling.
    Calibration,
    /// The light of each LED.
    FlatField,
}

impl Kept {
    /// The commands that write such a file.
    fn writers(self) -> &'static str {
        match self {
            Self::Calibration => "nirspi camera calibrate or nirspi camera selftest",
            Self::FlatField => "nirspi camera calibrate --white",
        }
    }

    /// The command that measures it again.
    fn again(self) -> &'static str {
        match self {
            Self::Calibration => "nirspi camera calibrate",
            Self::FlatField => "nirspi camera calibrate --white",
        }
    }

    /// Version of the file's format. A field with a new meaning needs a new version.
    pub(super) const fn format(self) -> u32 {
        match self {
            Self::Calibration | Self::FlatField => 1,
        }
    }
}

impl fmt::Display for Kept {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Calibration => "calibration",
            Self::FlatField => "flat field",
        })
    }
}

/// Why a kept file cannot be used. `Display` is one line.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum KeptFileError {
    /// The file cannot be read.
    #[error("{path}: cannot read the {kept}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What is kept in it.
        kept: Kept,
        /// The system's reason.
        source: io::Error,
    },
    /// The file holds something else.
    #[error("{path}: {reason}, expected a {kept} written by {}", kept.writers())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is kept in it.
        kept: Kept,
        /// The problem.
        reason: String,
    },
    /// The file has another version of the format.
    #[error("{path}: a {kept} of format {found}, expected {}: run {} again", kept.format(), kept.again())]
    Version {
        /// The file.
        path: PathBuf,
        /// What is kept in it.
        kept: Kept,
        /// The file's version.
        found: u32,
    },
    /// It was measured on another camera or gateware.
    #[error("{path}: measured with {field} {found}, this camera has {expected}: run {}", kept.again())]
    Mismatch {
        /// The file.
        path: PathBuf,
        /// What is kept in it.
        kept: Kept,
        /// The name of the property that differs.
        field: &'static str,
        /// The property in the file.
        found: String,
        /// The property of this camera.
        expected: String,
    },
    /// The file to write holds that of another camera.
    #[error("{path}: holds the {kept} of {found}, and this camera is {camera}: name another file")]
    Owned {
        /// The file.
        path: PathBuf,
        /// What is kept in it.
        kept: Kept,
        /// Board and serial number in the file.
        found: String,
        /// Board and serial number of this camera.
        camera: String,
    },
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] FileError),
    /// There is no folder for the file.
    #[error("no data directory to keep calibrations in")]
    NoHome(#[from] HomeDirError),
}

impl Kept {
    pub(super) fn format_error(self, path: &Path, reason: &impl ToString) -> KeptFileError {
        KeptFileError::Format { path: path.to_owned(), kept: self, reason: reason.to_string() }
    }

    /// Keeps what was measured of a camera in the named file, which holds nothing or the same of the same
    /// camera, or in the camera's own file with this ending. Returns the path.
    pub(super) fn keep<Kind: DeserializeOwned>(
        self,
        named: Option<&Path>,
        camera: &CameraIdentity,
        ending: &str,
        content: &impl Serialize,
    ) -> Result<PathBuf, KeptFileError> {
        let path = match named {
            Some(path) => path.to_owned(),
            None => path_with(&camera.serial, ending)?,
        };
        if named.is_some() && path.exists() {
            self.check_owner::<Kind>(&path, camera)?;
        }
        self.write(&path, content)?;
        Ok(path)
    }

    /// Writes the file, whole or not at all.
    fn write(self, path: &Path, content: &impl Serialize) -> Result<(), KeptFileError> {
        let json = match self {
            Self::Calibration => serde_json::to_vec_pretty(content),
            // Two thousand numbers, not one on each line.
            Self::FlatField => serde_json::to_vec(content),
        }
        .map_err(|e| self.format_error(path, &e))?;
        Ok(keep(path, &json)?)
    }

    /// Reads a file whose field `kind` is a `Kind`, in the current version of its format.
    pub(super) fn read<Kind: DeserializeOwned, T: DeserializeOwned>(
        self,
        path: &Path,
    ) -> Result<T, KeptFileError> {
        /// The fields that every version has.
        #[derive(Deserialize)]
        struct Head<Kind> {
            #[serde(rename = "kind")]
            _kind: Kind,
            version: u32,
        }
        let text = self.text(path)?;
        let head: Head<Kind> =
            serde_json::from_str(&text).map_err(|e| self.format_error(path, &e))?;
        if head.version != self.format() {
            let (path, found) = (path.to_owned(), head.version);
            return Err(KeptFileError::Version { path, kept: self, found });
        }
        serde_json::from_str(&text).map_err(|e| self.format_error(path, &e))
    }

    /// Refuses a file that is not this camera's to replace: one whose field `kind` is no `Kind`, and one
    /// of another camera.
    fn check_owner<Kind: DeserializeOwned>(
        self,
        path: &Path,
        camera: &CameraIdentity,
    ) -> Result<(), KeptFileError> {
        /// The fields that say whose a file is, of any version.
        #[derive(Deserialize)]
        struct Owned<Kind> {
            #[serde(rename = "kind")]
            _kind: Kind,
            camera: Owner,
        }
        #[derive(Deserialize)]
        struct Owner {
            board: String,
            serial: String,
        }
        let text = self.text(path)?;
        let owned: Owned<Kind> =
            serde_json::from_str(&text).map_err(|e| self.format_error(path, &e))?;
        let Owner { board, serial } = owned.camera;
        if (&board, &serial) == (&camera.board, &camera.serial) {
            return Ok(());
        }
        let found = format!("{board} {serial}");
        let camera = format!("{} {}", camera.board, camera.serial);
        Err(KeptFileError::Owned { path: path.to_owned(), kept: self, found, camera })
    }

    fn text(self, path: &Path) -> Result<String, KeptFileError> {
        let error = |source| KeptFileError::Io { path: path.to_owned(), kept: self, source };
        read_small_text(path).map_err(error)
    }

    /// Refuses a file of which a property is not that of the camera: name, in the file, of the camera.
    pub(super) fn check(
        self,
        path: &Path,
        properties: &[(&'static str, String, String)],
    ) -> Result<(), KeptFileError> {
        match properties.iter().find(|(_, found, expected)| found != expected) {
            None => Ok(()),
            Some((field, found, expected)) => Err(KeptFileError::Mismatch {
                path: path.to_owned(),
                kept: self,
                field,
                found: found.clone(),
                expected: expected.clone(),
            }),
        }
    }
}

/// The path of a file of the camera with this serial number, with this ending.
pub(super) fn path_with(serial: &str, ending: &str) -> Result<PathBuf, KeptFileError> {
    let folder = choose_base_strategy()?.data_dir().join("nirspi").join("calibration");
    Ok(folder.join(format!("{}.{ending}", file_name(serial))))
}

/// A serial number as a file name, unique for each serial number: every byte that is not a letter,
/// digit, `-` or `_` becomes `%` and two digits.
fn file_name(serial: &str) -> String {
    serial
        .bytes()
        .map(|byte| match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' => char::from(byte).to_string(),
            byte => format!("%{byte:02x}"),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn serial_numbers_become_file_names_one_each() {
        assert_eq!(file_name("virtual-1"), "virtual-1");
        assert_eq!(file_name("../a b%"), "%2e%2e%2fa%20b%25");
    }
}
