//! The device that computes. [`probe::find`] finds it.

use crate::backend::probe;
use crate::{Backend, BackendError};
use nirspi_gpu::limits::DeviceLimits;
use nirspi_gpu::{Gpu, Kernels};
use std::fmt;
use std::sync::Arc;

/// A device, ready to compute.
#[derive(Clone)]
pub struct Device {
    pub(super) engine: Arc<dyn Kernels>,
    name: String,
    backend: Backend,
    software: bool,
}

impl fmt::Debug for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Device({} {})", self.backend, self.name)
    }
}

impl Device {
    /// The device of a backend, found by [`probe::find`]; `None` for the processor.
    ///
    /// # Errors
    /// [`BackendError::Absent`] if the device is missing.
    pub fn open(backend: Backend) -> Result<Option<Self>, BackendError> {
        let found = probe::find(backend)
            .map_err(|missing| BackendError::Absent { why: missing.to_string() })?;
        Ok(found.map(|gpu| Self::of(&gpu)))
    }

    /// The device of a GPU that was found before.
    #[must_use]
    pub fn of(gpu: &Gpu) -> Self {
        Self {
            engine: nirspi_gpu::open(gpu),
            name: gpu.name().to_owned(),
            backend: probe::backend(gpu),
            software: gpu.is_software(),
        }
    }

    /// The device's name in its driver.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// [`Backend::Wgpu`] or [`Backend::Cuda`].
    #[must_use]
    pub fn backend(&self) -> Backend {
        self.backend
    }

    /// Whether the processor emulates this GPU: right results without the speed of a GPU.
    #[must_use]
    pub fn is_software(&self) -> bool {
        self.software
    }

    #[cfg(test)]
    pub(crate) fn engine(&self) -> &dyn Kernels {
        self.engine.as_ref()
    }

    pub(super) fn limits(&self) -> DeviceLimits {
        self.engine.limits()
    }
}
