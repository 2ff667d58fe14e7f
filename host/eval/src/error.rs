//! Errors of an evaluation: a setting out of range, a file, or an error of a library.

use nirspi::files::FileError;
use nirspi_optics::mie::MieError;
use nirspi_optics::pixel::PixelError;
use nirspi_optics::rain::RainError;
use std::error::Error;
use std::fmt::Display;
use std::path::Path;

/// Why an evaluation has no result. Messages do not repeat their causes, which follow through
/// `source()`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvalError {
    /// A setting is out of range.
    #[error("{name} is {found}, expected {expected}")]
    Setting {
        /// The setting, in snake case.
        name: &'static str,
        /// Its value.
        found: String,
        /// The allowed values.
        expected: String,
    },
    /// A library refuses a setting.
    #[error("{name}: {why}")]
    Refused {
        /// The setting, in snake case.
        name: &'static str,
        /// The library's message, or the problem.
        why: String,
    },
    /// The measurements are of a part of the patterns, but the image of all patterns is the
    /// reference.
    #[error(
        "{found} of {expected} patterns, expected a full sweep: the image of all patterns is what shares are held against"
    )]
    PartialSweep {
        /// Patterns that were measured.
        found: usize,
        /// Patterns of a full sweep.
        expected: usize,
    },
    /// The rain is not possible.
    #[error(transparent)]
    Rain(#[from] RainError),
    /// A setting of a pixel's budget is out of range.
    #[error(transparent)]
    Pixel(#[from] PixelError),
    /// The Mie solver was not checked for this sphere.
    #[error(transparent)]
    Mie(#[from] MieError),
    /// A file could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The content of a file cannot be evaluated: file, what was found, what was expected.
    #[error("{0}")]
    Content(String),
    /// The work on one item failed.
    #[error("{what}")]
    At {
        /// The item: a file, a folder, a figure.
        what: String,
        /// The error.
        source: Box<Self>,
    },
    /// A library failed.
    #[error(transparent)]
    Library(Box<dyn Error + Send + Sync>),
}

/// The result of an evaluation.
pub type Result<T, E = EvalError> = std::result::Result<T, E>;

impl EvalError {
    pub(crate) fn setting(
        name: &'static str,
        found: impl Display,
        expected: impl Into<String>,
    ) -> Self {
        Self::Setting { name, found: found.to_string(), expected: expected.into() }
    }

    pub(crate) fn refused(name: &'static str, why: &impl Display) -> Self {
        Self::Refused { name, why: why.to_string() }
    }

    /// Whether the caller's settings are the cause, and not a file, a device or the scene.
    #[must_use]
    pub fn is_setting(&self) -> bool {
        matches!(
            self,
            Self::Setting { .. }
                | Self::Refused { .. }
                | Self::Rain(_)
                | Self::Pixel(_)
                | Self::Mie(_)
        )
    }
}

/// Adds the item of the failed work to an error.
pub(crate) trait On<T> {
    fn on(self, what: impl FnOnce() -> String) -> Result<T>;
    fn on_file(self, path: &Path) -> Result<T>;
}

impl<T, E: Into<EvalError>> On<T> for std::result::Result<T, E> {
    fn on(self, what: impl FnOnce() -> String) -> Result<T> {
        self.map_err(|error| EvalError::At { what: what(), source: Box::new(error.into()) })
    }

    fn on_file(self, path: &Path) -> Result<T> {
        self.on(|| path.display().to_string())
    }
}

macro_rules! from_libraries {
    ($($error:ty),+ $(,)?) => {$(
        impl From<$error> for EvalError {
            fn from(error: $error) -> Self {
                Self::Library(Box::new(error))
            }
        }
    )+};
}

from_libraries!(
    nirspi::integrate::IntegrateError,
    crate::legibility::LegibilityError,
    nirspi::scene::SceneError,
    nirspi::source::SourceError,
    crate::training::TrainingCameraError,
    nirspi_virtual::ShotError,
    nirspi_virtual::VirtualOpticsError,
    nirspi_nets::DeviceEnhancerError,
    nirspi_nets::EnhanceError,
    nirspi_nets::MeasuredRowsError,
    nirspi_nets::classical::ClassicalError,
    nirspi_nets::data::DataError,
    nirspi_nets::device::DeviceError,
    nirspi_nets::images::ImagesError,
    nirspi_nets::interval::NoIntervals,
    nirspi_nets::interval::TableError,
    nirspi_nets::metrics::FrechetError,
    nirspi_nets::upscale::UpscaleError,
    nirspi_nets::weights::WeightsError,
    nirspi_nets::DepthError,
    nirspi_optics::CameraModelError,
    nirspi_optics::SceneError,
    nirspi_optics::ProjectorError,
    nirspi_optics::rig::RigError,
    nirspi_optics::visible::VisibleError,
    nirspi_recon::FwhtLengthError,
    nirspi_recon::MeasurementError,
    nirspi_recon::RowsError,
    nirspi_recon::SideError,
    nirspi_recon::metrics::MetricError,
    nirspi_recon::omp::BackendError,
    nirspi_recon::omp::OmpError,
    nirspi_recon::reconstruct::ReconstructError,
    std::io::Error,
    serde_json::Error,
);

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(error: &EvalError) -> Vec<String> {
        let (mut told, mut next) = (Vec::new(), Some(error as &dyn Error));
        while let Some(cause) = next {
            told.push(cause.to_string());
            next = cause.source();
        }
        told
    }

    #[test]
    fn a_cause_is_told_once_below_what_failed() {
        let lost = || std::io::Error::other("the disk is gone");
        let failed: Result<()> = Err(lost()).on_file(Path::new("a.json"));
        assert_eq!(chain(&failed.unwrap_err()), ["a.json", "the disk is gone"]);
        assert_eq!(chain(&lost().into()), ["the disk is gone"]);
    }

    #[test]
    fn only_settings_are_the_callers_mistakes() {
        assert!(EvalError::setting("snr", 0, "more than 0").is_setting());
        assert!(EvalError::refused("drops", &"hail").is_setting());
        assert!(!EvalError::Content("a.npy: no images".to_owned()).is_setting());
        assert!(!EvalError::from(std::io::Error::other("gone")).is_setting());
    }
}
