//! The backends by name. OMP and the networks of `nirspi-nets` use the same names.
//!
//! A backend requested by name computes, or the call fails and says why. Only [`Backend::Auto`]
//! chooses a device, and never a software device (`probe::find`, with the feature `gpu`).

#[cfg(feature = "gpu")]
pub mod probe;
mod turns;

pub use turns::{Failure, Turns};

use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// Why a build without the feature `gpu` finds no GPU.
pub const NOT_BUILT: &str = "this build is without the feature gpu";

/// A backend: what computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Backend {
    /// A GPU if there is one and the work is large enough for it, else the processor.
    #[default]
    Auto,
    /// All cores of the processor.
    Cpu,
    /// A device through Vulkan, Metal or DirectX. A software device is accepted, because the
    /// backend was requested by name.
    Wgpu,
    /// A GPU through CUDA.
    Cuda,
}

impl Backend {
    /// Every backend.
    pub const ALL: [Self; 4] = [Self::Auto, Self::Cpu, Self::Wgpu, Self::Cuda];

    /// The backend's name on the command line.
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

/// Error: no backend has this name.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("unknown backend {found:?}, expected auto, cpu, wgpu or cuda")]
pub struct ParseBackendError {
    /// The name that was given.
    pub found: String,
}

impl FromStr for Backend {
    type Err = ParseBackendError;

    fn from_str(name: &str) -> Result<Self, ParseBackendError> {
        let named = Self::ALL.into_iter().find(|backend| backend.name() == name);
        named.ok_or_else(|| ParseBackendError { found: name.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_backend_is_written_and_read_alike() {
        for backend in Backend::ALL {
            assert_eq!(backend.to_string().parse(), Ok(backend));
        }
        let error = "tpu".parse::<Backend>().unwrap_err();
        assert_eq!(error.to_string(), "unknown backend \"tpu\", expected auto, cpu, wgpu or cuda");
    }
}
