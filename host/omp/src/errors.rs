//! Why a backend cannot compute a pursuit. Each error is one line that says what was looked for, or
//! which limit the problem exceeds.

use crate::backend::NOT_BUILT;
use thiserror::Error;

/// Error: a backend cannot compute a pursuit.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum BackendError {
    /// This machine or this build has no such backend.
    #[error("no GPU found ({why})")]
    Absent {
        /// What was looked for and not found.
        why: String,
    },
    /// The problem exceeds a limit of the device.
    #[error("the GPU has {limit} {what}, this problem needs {needed}")]
    TooLarge {
        /// What the device has too little of, with its unit.
        what: &'static str,
        /// How much the problem needs.
        needed: usize,
        /// How much the device has.
        limit: usize,
    },
    /// Double precision was requested.
    #[error("GPUs compute in f32 here, use the cpu backend for f64")]
    Precision,
    /// The device or its driver failed.
    #[error("the GPU failed: {0}")]
    Failed(String),
}

#[cfg(feature = "gpu")]
impl From<nirspi_gpu::GpuError> for BackendError {
    fn from(error: nirspi_gpu::GpuError) -> Self {
        use nirspi_gpu::GpuError;
        match error {
            GpuError::TooLarge { what, needed, limit } => Self::TooLarge { what, needed, limit },
            GpuError::Failed(why) => Self::Failed(why),
            other => Self::Failed(other.to_string()),
        }
    }
}

#[cfg(feature = "gpu")]
impl From<nirspi_gpu::GpuError> for super::OmpError {
    fn from(error: nirspi_gpu::GpuError) -> Self {
        BackendError::from(error).into()
    }
}

impl BackendError {
    /// Error: this build has no kernels.
    #[must_use]
    pub fn not_built() -> Self {
        Self::Absent { why: NOT_BUILT.to_owned() }
    }
}
