//! Why a backend cannot pursue what it was given.
//!
//! The one law: one line that says what was looked for, or how much there is of what is too little.

use crate::backend::NOT_BUILT;
use thiserror::Error;

/// A backend that cannot compute what it was asked for.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum BackendError {
    /// This machine or this build does not have it.
    #[error("no GPU found ({why})")]
    Absent {
        /// What was looked for and not found.
        why: String,
    },
    /// The problem does not fit the device.
    #[error("the GPU has {limit} {what}, this problem needs {needed}")]
    TooLarge {
        /// What there is too little of, with its unit.
        what: &'static str,
        /// How much it takes.
        needed: usize,
        /// How much there is.
        limit: usize,
    },
    /// Double precision was asked for.
    #[error("GPUs compute in f32 here, use the cpu backend for f64")]
    Precision,
    /// The device or its driver gave up.
    #[error("the GPU failed: {0}")]
    Failed(String),
}

impl BackendError {
    /// This build has no kernels.
    #[must_use]
    pub fn not_built() -> Self {
        Self::Absent { why: NOT_BUILT.to_owned() }
    }
}
