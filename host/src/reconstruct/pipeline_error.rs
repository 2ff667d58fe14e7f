//! Why there are no images, or no more.

use super::SolverError;
use crate::files::FileError;
use crate::imaging::FramesError;
use crate::source::SourceError;
use std::io::ErrorKind;
use thiserror::Error;

/// Why there is no image, or no more of a stack.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PipelineError {
    /// There is no measurement.
    #[error("{}: no measurement in it", .0.display())]
    Empty(std::path::PathBuf),
    /// None of several files gave an image.
    #[error("none of {files} gave an image; the first: {reason}")]
    NoneOf {
        /// The files in words: `3 files`.
        files: String,
        /// Why the first gave none.
        reason: String,
    },
    /// Measurements cannot be read.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// Measurements give no image.
    #[error(transparent)]
    Solver(#[from] SolverError),
    /// Networks take real images only.
    #[error("networks need real images, expected the real or the imaginary part")]
    Complex,
    /// The networks failed.
    #[error("networks")]
    Networks(#[from] FramesError),
    /// The user has stopped the work.
    #[error("stopped")]
    Stopped,
    /// A result cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
}

impl PipelineError {
    /// Whether the images before it can be written.
    pub(super) fn leaves_images(&self) -> bool {
        match self {
            Self::Complex => false,
            Self::File(_) => self.full().is_some(),
            _ => true,
        }
    }

    /// Whether a disk or a file is full.
    pub(super) fn full(&self) -> Option<Full> {
        let Self::File(FileError::Io { system, .. }) = self else { return None };
        match system.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => Some(Full::Disk),
            ErrorKind::FileTooLarge => Some(Full::File),
            _ => None,
        }
    }
}

/// What takes no more bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Full {
    /// The disk.
    Disk,
    /// The largest file that a user may have, or the file system.
    File,
}
