//! What computes, by name: OMP here and the networks of `nirspi-nets` take the same names.
//!
//! A backend asked for by name is the one that computes, or the call fails and says why; only [`Backend::Auto`] chooses, and
//! never a software device (`probe::find`, with the feature `gpu`).

#[cfg(feature = "gpu")]
pub mod probe;

use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// Why a build without the feature `gpu` has no GPU.
pub const NOT_BUILT: &str = "this build is without the feature gpu";

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
