//! Which device computes.
//!
//! The one law: absence is an answer, never a crash, and a software device computes only for who asks for it by name.

use super::budget::Limits;
use super::engine::Engine;
use crate::backend::probe::{self, Found};
use crate::omp::{Backend, BackendError};
use cubecl::Runtime;
use cubecl::cuda::CudaRuntime;
use cubecl::wgpu::WgpuRuntime;
use std::fmt;
use std::sync::Arc;

/// A device that is ready to compute.
#[derive(Clone)]
pub struct Device {
    pub(super) engine: Arc<dyn Engine>,
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
    /// The device that a backend names; none for the processor. [`Backend::Auto`] means a GPU through CUDA, else a discrete
    /// or integrated one through wgpu.
    ///
    /// # Errors
    /// [`BackendError::Absent`] if there is none.
    pub fn open(backend: Backend) -> Result<Option<Self>, BackendError> {
        let absent = |why| BackendError::Absent { why };
        match backend {
            Backend::Cpu => Ok(None),
            Backend::Cuda => cuda().map(Some).map_err(absent),
            Backend::Wgpu => wgpu(true).map(Some).map_err(absent),
            Backend::Auto => cuda()
                .or_else(|no_cuda| wgpu(false).map_err(|no_wgpu| format!("{no_wgpu}; {no_cuda}")))
                .map(Some)
                .map_err(absent),
        }
    }

    /// As its driver calls it.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// [`Backend::Wgpu`] or [`Backend::Cuda`].
    #[must_use]
    pub fn backend(&self) -> Backend {
        self.backend
    }

    /// Whether the processor plays the GPU: right results, no speed.
    #[must_use]
    pub fn is_software(&self) -> bool {
        self.software
    }

    pub(super) fn limits(&self) -> Limits {
        self.engine.limits()
    }
}

fn cuda() -> Result<Device, String> {
    let Found { device, name, software } =
        probe::cuda().map_err(|absent| format!("CUDA: {absent}"))?;
    let engine = Arc::new(CudaRuntime::client(&device));
    Ok(Device { engine, name, backend: Backend::Cuda, software })
}

fn wgpu(software_too: bool) -> Result<Device, String> {
    let Found { device, name, software } =
        probe::wgpu(software_too).map_err(|absent| format!("wgpu: {absent}"))?;
    let engine = Arc::new(WgpuRuntime::client(&device));
    Ok(Device { engine, name, backend: Backend::Wgpu, software })
}
