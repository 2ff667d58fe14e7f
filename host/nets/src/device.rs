//! The device of the networks: the CPU, or a GPU through wgpu (Vulkan, Metal, DirectX) or CUDA.
//!
//! # Invariant
//! A backend requested by name computes, or opening it fails with one line that says why
//! (`tests::a_gpu_that_is_missing_is_one_plain_line`). [`Backend::Auto`] takes a real GPU if there
//! is one, and never a software device (`tests::the_cpu_and_auto_are_always_there`).

pub use nirspi_recon::backend::{Backend, ParseBackendError};

#[cfg(feature = "gpu")]
use nirspi_gpu::{Gpu, Kernels};
#[cfg(not(feature = "gpu"))]
use nirspi_recon::backend::NOT_BUILT;
#[cfg(feature = "gpu")]
use nirspi_recon::backend::probe;
#[cfg(feature = "gpu")]
use std::sync::Arc;
use thiserror::Error;

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
    #[cfg(feature = "gpu")]
    Gpu(Gpu),
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
        match &self.kind {
            Kind::Cpu => Backend::Cpu,
            #[cfg(feature = "gpu")]
            Kind::Gpu(gpu) => probe::backend(gpu),
        }
    }

    /// The engine that launches kernels on the device; `None` for the processor.
    #[cfg(feature = "gpu")]
    pub(crate) fn engine(&self) -> Option<Arc<dyn Kernels>> {
        match &self.kind {
            Kind::Cpu => None,
            Kind::Gpu(gpu) => Some(nirspi_gpu::open(gpu)),
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
    Ok(found.map_or_else(Device::cpu, |gpu| {
        let name = gpu.name().to_owned();
        Device { kind: Kind::Gpu(gpu), name }
    }))
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
