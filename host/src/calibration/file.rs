//! Files that are kept for a camera between sessions: what calibrations and flat fields share.

use crate::files::output::keep;
use crate::files::{FileError, read_small_text};
use etcetera::HomeDirError;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
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
            Self::Calibration => "nirspi calibrate or nirspi selftest",
            Self::FlatField => "nirspi calibrate --white",
        }
    }

    /// The command that measures it again.
    fn again(self) -> &'static str {
        match self {
            Self::Calibration => "nirspi calibrate",
            Self::FlatField => "nirspi calibrate --white",
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

    /// Writes the file, whole or not at all.
    pub(super) fn write(self, path: &Path, content: &impl Serialize) -> Result<(), KeptFileError> {
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
        let text = read_small_text(path).map_err(|source| KeptFileError::Io {
            path: path.to_owned(),
            kept: self,
            source,
        })?;
        let head: Head<Kind> =
            serde_json::from_str(&text).map_err(|e| self.format_error(path, &e))?;
        if head.version != self.format() {
            let (path, found) = (path.to_owned(), head.version);
            return Err(KeptFileError::Version { path, kept: self, found });
        }
        serde_json::from_str(&text).map_err(|e| self.format_error(path, &e))
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
