//! What computes, by name.
//!
//! The one law: a backend asked for by name is the one that computes, or the call fails and says why; only
//! [`Backend::Auto`] chooses.

use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// What computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Backend {
    /// A GPU where there is one and the work is worth sending there, else the processor.
    #[default]
    Auto,
    /// All cores of the processor.
    Cpu,
    /// A device through Vulkan, Metal or DirectX. A software device counts, since it was asked for.
    Wgpu,
    /// A GPU through CUDA.
    Cuda,
}

impl Backend {
    /// All there are.
    pub const ALL: [Self; 4] = [Self::Auto, Self::Cpu, Self::Wgpu, Self::Cuda];

    /// As it is written on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Cpu => "cpu",
            Self::Wgpu => "wgpu",
            Self::Cuda => "cuda",
        }
    }
}

impl fmt::Display for Backend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The name of no backend.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("unknown backend {found:?}, expected auto, cpu, wgpu or cuda")]
pub struct ParseBackendError {
    /// What was given.
    pub found: String,
}

impl FromStr for Backend {
    type Err = ParseBackendError;

    fn from_str(name: &str) -> Result<Self, ParseBackendError> {
        let named = Self::ALL.into_iter().find(|backend| backend.name() == name);
        named.ok_or_else(|| ParseBackendError { found: name.to_owned() })
    }
}

/// A backend that cannot compute what it was asked for.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
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
        Self::Absent { why: "this build is without the feature gpu".to_owned() }
    }
}
