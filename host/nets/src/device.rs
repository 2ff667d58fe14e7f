//! Where networks run: the CPU, or a GPU through wgpu (Vulkan, Metal, DirectX) or CUDA.
//!
//! Law: a backend asked for by name is the one that computes, or opening it fails with one line that says why;
//! [`Backend::Auto`] takes a real GPU if there is one, never a software one.

#[cfg(feature = "gpu")]
mod probe;

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

/// What shall compute.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Backend {
    /// A real GPU where there is one, else the CPU.
    #[default]
    Auto,
    /// All cores of the CPU.
    Cpu,
    /// A device through Vulkan, Metal or DirectX; also a software one, since it was asked for.
    Wgpu,
    /// A GPU through CUDA.
    Cuda,
}

impl Backend {
    /// All there are.
    pub const ALL: [Self; 4] = [Self::Auto, Self::Cpu, Self::Wgpu, Self::Cuda];
}

impl fmt::Display for Backend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::Cpu => "cpu",
            Self::Wgpu => "wgpu",
            Self::Cuda => "cuda",
        })
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
        let named = Self::ALL.into_iter().find(|backend| backend.to_string() == name);
        named.ok_or_else(|| ParseBackendError { found: name.to_owned() })
    }
}

/// A backend that was asked for by name is not there.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("backend {backend}: {why}")]
pub struct DeviceError {
    /// The backend.
    pub backend: Backend,
    /// What was looked for and not found.
    pub why: String,
}

/// A device that is ready to compute.
#[derive(Debug, Clone)]
pub struct Device {
    pub(crate) kind: Kind,
    name: String,
}

#[derive(Debug, Clone)]
pub(crate) enum Kind {
    Cpu,
    #[cfg(feature = "gpu")]
    Wgpu(burn::backend::wgpu::WgpuDevice),
    #[cfg(feature = "gpu")]
    Cuda(burn::backend::cuda::CudaDevice),
}

impl Device {
    /// The CPU, which is always there.
    pub fn cpu() -> Self {
        Self { kind: Kind::Cpu, name: "CPU".to_owned() }
    }

    /// The device of a backend.
    ///
    /// # Errors
    /// [`DeviceError`] if wgpu or CUDA was asked for and is not there; `Auto` and `Cpu` never fail.
    pub fn open(backend: Backend) -> Result<Self, DeviceError> {
        let absent = |why| DeviceError { backend, why };
        match backend {
            Backend::Cpu => Ok(Self::cpu()),
            Backend::Auto => Ok(cuda().or_else(|_| wgpu(false)).unwrap_or_else(|_| Self::cpu())),
            Backend::Wgpu => wgpu(true).map_err(absent),
            Backend::Cuda => cuda().map_err(absent),
        }
    }

    /// As its driver calls it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How many images at once keep it busy.
    pub(crate) fn batch(&self) -> usize {
        match self.kind {
            Kind::Cpu => 32,
            #[cfg(feature = "gpu")]
            Kind::Wgpu(_) | Kind::Cuda(_) => 256,
        }
    }
}

#[cfg(feature = "gpu")]
fn cuda() -> Result<Device, String> {
    let name = probe::cuda()?;
    Ok(Device { kind: Kind::Cuda(burn::backend::cuda::CudaDevice::new(0)), name })
}

#[cfg(feature = "gpu")]
fn wgpu(software_too: bool) -> Result<Device, String> {
    let (device, name) = probe::wgpu(software_too)?;
    Ok(Device { kind: Kind::Wgpu(device), name })
}

#[cfg(not(feature = "gpu"))]
const NOT_BUILT: &str = "this program was built without the feature gpu";

#[cfg(not(feature = "gpu"))]
fn cuda() -> Result<Device, String> {
    Err(NOT_BUILT.to_owned())
}

#[cfg(not(feature = "gpu"))]
fn wgpu(_software_too: bool) -> Result<Device, String> {
    Err(NOT_BUILT.to_owned())
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

    #[test]
    fn the_cpu_and_auto_are_always_there() {
        assert_eq!(Device::open(Backend::Cpu).unwrap().name(), "CPU");
        assert!(!Device::open(Backend::Auto).unwrap().name().is_empty());
    }

    #[test]
    fn a_gpu_that_is_missing_is_one_plain_line() {
        for backend in [Backend::Wgpu, Backend::Cuda] {
            if let Err(error) = Device::open(backend) {
                let line = error.to_string();
                assert!(line.starts_with(&format!("backend {backend}: ")), "{line}");
                assert!(!line.contains('\n'), "{line}");
            }
        }
    }
}
