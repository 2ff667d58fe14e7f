//! What can go wrong in an evaluation: a setting out of range, a file, or the work of a library below.

use nirspi::files::FileError;
use nirspi_optics::mie::MieError;
use nirspi_optics::pixel::PixelError;
use nirspi_optics::rain::RainError;
use std::error::Error;
use std::fmt::Display;
use std::path::Path;

/// Why there is no result. Messages of causes are not repeated: they follow through `source()`.
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
        /// The values that are allowed.
        expected: String,
    },
    /// A library below refuses a setting.
    #[error("{name}: {why}")]
    Refused {
        /// The setting, in snake case.
        name: &'static str,
        /// The library's message, or what is wrong.
        why: String,
    },
    /// Measurements of a part of the patterns, where the image of all is the reference.
    #[error(
        "{found} of {expected} patterns, expected a full sweep: the image of all patterns is what shares are held against"
    )]
    PartialSweep {
        /// Patterns that were measured.
        found: usize,
        /// Patterns of a full sweep.
        expected: usize,
    },
    /// Rain that cannot fall like this.
    #[error(transparent)]
    Rain(#[from] RainError),
    /// A pixel's budget with a setting out of range.
    #[error(transparent)]
    Pixel(#[from] PixelError),
    /// A sphere that the Mie solver was not checked for.
    #[error(transparent)]
    Mie(#[from] MieError),
    /// A file could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The content of a file cannot be evaluated: file, what was found, what was expected.
    #[error("{0}")]
    Content(String),
    /// The work on one thing failed.
    #[error("{what}")]
    At {
        /// The thing: a file, a folder, a figure.
        what: String,
        /// What failed.
        source: Box<Self>,
    },
    /// A library below failed.
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

    /// Whether the caller's settings are the cause, rather than a file, a device or the scene.
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

/// Says what the failed work was on.
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
    nirspi::legibility::LegibilityError,
    nirspi::scene::SceneError,
    nirspi::source::SourceError,
    nirspi::training::TrainingCameraError,
    nirspi::virtual_camera::ShotError,
    nirspi::virtual_camera::VirtualOpticsError,
    nirspi_nets::EnhanceError,
    nirspi_nets::MeasuredRowsError,
    nirspi_nets::classical::ClassicalError,
    nirspi_nets::data::DataError,
    nirspi_nets::degrade::DegradeError,
    nirspi_nets::device::DeviceError,
    nirspi_nets::images::ImagesError,
    nirspi_nets::metrics::FrechetError,
    nirspi_nets::upscale::UpscaleError,
    nirspi_nets::weights::WeightsError,
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

#[cfg(feature = "gpu")]
from_libraries!(nirspi_nets::DeviceEnhancerError);

#[cfg(feature = "train")]
from_libraries!(nirspi_nets::metrics::inception::ImageSize, nirspi_nets::train::TrainError);

#[cfg(not(feature = "train"))]
from_libraries!(nirspi_nets::metrics::inception::NotBuilt);

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
