//! The device of the networks: the CPU, or a GPU through wgpu (Vulkan, Metal, DirectX) or CUDA.
//!
//! # Invariant
//! A backend requested by name computes, or opening it fails with one line that says why
//! (`tests::a_gpu_that_is_missing_is_one_plain_line`). [`Backend::Auto`] takes a real GPU if there
//! is one, and never a software device (`tests::the_cpu_and_auto_are_always_there`).

mod networks;

pub use nirspi_recon::backend::{Backend, ParseBackendError};

use crate::arithmetic::Arithmetic;
#[cfg(feature = "gpu")]
use crate::gpu::Multiplier;
use crate::note::{Note, Notes};
#[cfg(feature = "gpu")]
use nirspi_gpu::network::Product;
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
    arithmetic: Arithmetic,
    notes: Notes,
    /// Multiplies in place of the tensor cores, in tests.
    #[cfg(all(test, feature = "gpu"))]
    pub(crate) product: Option<Product>,
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
        Self::of(Kind::Cpu, "CPU".to_owned())
    }

    fn of(kind: Kind, name: String) -> Self {
        Self {
            kind,
            name,
            arithmetic: Arithmetic::default(),
            notes: Notes::default(),
            #[cfg(all(test, feature = "gpu"))]
            product: None,
        }
    }

    /// This GPU.
    #[cfg(feature = "gpu")]
    #[must_use]
    pub fn on(gpu: Gpu) -> Self {
        let name = gpu.name().to_owned();
        Self::of(Kind::Gpu(gpu), name)
    }

    /// The same device with this arithmetic. Where the device does not have it, networks compute in
    /// [`Arithmetic::F32`], and [`notes`](Self::notes) say so.
    #[must_use]
    pub fn with_arithmetic(self, arithmetic: Arithmetic) -> Self {
        if arithmetic == Arithmetic::F16 && !self.has_tensor_cores() {
            self.notes.add(Note::NoTensorCores { device: self.name.clone() });
            return self;
        }
        Self { arithmetic, ..self }
    }

    /// The arithmetic of the UNet's convolutions.
    #[must_use]
    pub fn arithmetic(&self) -> Arithmetic {
        self.arithmetic
    }

    /// What the networks of this device did in another way than asked or expected since the last
    /// call, each once. The results are right in any case.
    #[must_use]
    pub fn notes(&self) -> Vec<Note> {
        self.notes.take()
    }

    /// Notes that images come to the host between the networks.
    #[cfg(feature = "gpu")]
    pub(crate) fn tell_through_host(&self, why: String) {
        self.notes.add(Note::ThroughHost { why });
    }

    /// The notes, for a network on this device to add to.
    #[cfg(feature = "gpu")]
    pub(crate) fn shared_notes(&self) -> Notes {
        self.notes.clone()
    }

    #[cfg(not(feature = "gpu"))]
    fn has_tensor_cores(&self) -> bool {
        false
    }

    #[cfg(feature = "gpu")]
    fn has_tensor_cores(&self) -> bool {
        self.engine().is_some_and(|engine| self.product(engine.as_ref()).is_some())
    }

    /// What multiplies small matrices on this device.
    #[cfg(feature = "gpu")]
    fn product(&self, engine: &dyn Kernels) -> Option<Product> {
        #[cfg(test)]
        if self.product.is_some() {
            return self.product;
        }
        engine.has(Product::TensorCores).then_some(Product::TensorCores)
    }

    /// The tensor cores of this device, if it has any.
    #[cfg(feature = "gpu")]
    pub(crate) fn multiplier(&self, engine: &dyn Kernels) -> Option<Multiplier> {
        let product = self.product(engine)?;
        Some(Multiplier::new(engine, product, self.arithmetic, self.notes.clone()))
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
    Ok(found.map_or_else(Device::cpu, Device::on))
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
