//! The device of the networks: the CPU, or a GPU through wgpu (Vulkan, Metal, DirectX) or CUDA.
//!
//! # Invariant
//! A backend requested by name computes, or opening it fails with one line that says why
//! (`tests::a_gpu_that_is_missing_is_one_plain_line`). [`Backend::Auto`] takes a real GPU if there
//! is one, and never a software device (`tests::the_cpu_and_auto_are_always_there`).

pub use nirspi_recon::backend::{Backend, ParseBackendError};

#[cfg(not(feature = "gpu"))]
use nirspi_recon::backend::NOT_BUILT;
#[cfg(feature = "gpu")]
use nirspi_recon::backend::probe::{self, Gpu};
#[cfg(feature = "gpu")]
use std::sync::Arc;
use thiserror::Error;

#[cfg(feature = "gpu")]
use crate::gpu::{self, Engine};

/// The backend requested by name was not found.
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
    #[cfg(feature = "wgpu")]
    Wgpu(cubecl::wgpu::WgpuDevice),
    #[cfg(feature = "gpu")]
    Cuda(cubecl::cuda::CudaDevice),
}

impl Device {
    /// The CPU, which is always available.
    pub fn cpu() -> Self {
        Self { kind: Kind::Cpu, name: "CPU".to_owned() }
    }

    /// The device of a backend.
    ///
    /// # Errors
    /// [`DeviceError`] if wgpu or CUDA was requested and was not found; `Auto` and `Cpu` never
    /// fail.
    pub fn open(backend: Backend) -> Result<Self, DeviceError> {
        match find(backend) {
            Err(_) if backend == Backend::Auto => Ok(Self::cpu()),
            found => found.map_err(|why| DeviceError { backend, why }),
        }
    }

    /// The device's name in its driver.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The backend of the device; never [`Backend::Auto`].
    pub fn backend(&self) -> Backend {
        match self.kind {
            Kind::Cpu => Backend::Cpu,
            #[cfg(feature = "wgpu")]
            Kind::Wgpu(_) => Backend::Wgpu,
            #[cfg(feature = "gpu")]
            Kind::Cuda(_) => Backend::Cuda,
        }
    }

    /// The engine that launches kernels on the device; `None` for the processor.
    #[cfg(feature = "gpu")]
    pub(crate) fn engine(&self) -> Option<Arc<dyn Engine>> {
        match &self.kind {
            Kind::Cpu => None,
            #[cfg(feature = "wgpu")]
            Kind::Wgpu(device) => Some(gpu::wgpu(device)),
            Kind::Cuda(device) => Some(gpu::cuda(device)),
        }
    }

    /// Number of images that keep the device busy.
    pub(crate) fn batch(&self) -> usize {
        match self.kind {
            Kind::Cpu => 32,
            #[cfg(feature = "gpu")]
            _ => 256,
        }
    }
}

#[cfg(feature = "gpu")]
fn find(backend: Backend) -> Result<Device, String> {
    let found = probe::find(backend).map_err(|missing| missing.to_string())?;
    Ok(match found {
        None => Device::cpu(),
        Some(Gpu::Cuda(found)) => Device { kind: Kind::Cuda(found.device), name: found.name },
        #[cfg(feature = "wgpu")]
        Some(Gpu::Wgpu(found)) => Device { kind: Kind::Wgpu(found.device), name: found.name },
        // A program may have given the feature wgpu to nirspi-recon alone.
        Some(_) => return Err("this build of nirspi-nets is without the feature wgpu".to_owned()),
    })
}

#[cfg(not(feature = "gpu"))]
fn find(backend: Backend) -> Result<Device, String> {
    if backend == Backend::Cpu { Ok(Device::cpu()) } else { Err(NOT_BUILT.to_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;

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
