//! Which device computes.
//!
//! The one law: absence is an answer, never a crash. CUDA's libraries are looked for before CubeCL would panic without them, and a
//! software device computes only for who asks for it by name.

use super::budget::Limits;
use super::engine::Engine;
use crate::omp::{Backend, BackendError};
use cubecl::Runtime;
use cubecl::cuda::{CudaDevice, CudaRuntime};
use cubecl::future::block_on;
use cubecl::wgpu::{AutoGraphicsApi, GraphicsApi, WgpuDevice, WgpuRuntime};
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
    cuda_is_installed()?;
    let count = cudarc::driver::CudaContext::device_count();
    match count {
        Ok(count) if count > 0 => {}
        Ok(_) => return Err("CUDA: no device".to_owned()),
        Err(error) => return Err(format!("CUDA: {error}")),
    }
    let first = cudarc::driver::CudaContext::new(0).and_then(|context| context.name());
    let name = first.map_err(|error| format!("CUDA: {error}"))?;
    let engine = Arc::new(CudaRuntime::client(&CudaDevice::new(0)));
    Ok(Device { engine, name, backend: Backend::Cuda, software: false })
}

/// Looks for what CubeCL takes for granted: the driver, the compiler that makes kernels at run time, and its headers.
#[expect(unsafe_code, reason = "looking for a library is loading it, which runs its initialisers")]
fn cuda_is_installed() -> Result<(), String> {
    // SAFETY: NVIDIA's libraries have no preconditions on being loaded; the same ones are loaded to be used.
    let (driver, compiler) = unsafe {
        (cudarc::driver::sys::is_culib_present(), cudarc::nvrtc::sys::is_culib_present())
    };
    if !driver {
        return Err("CUDA: libcuda not found".to_owned());
    }
    if !compiler {
        return Err("CUDA: libnvrtc not found, it comes with the CUDA toolkit".to_owned());
    }
    if cubecl::cuda::install::cuda_path().is_none() {
        return Err("CUDA: no toolkit in /usr/local/cuda, CUDA_PATH is not set".to_owned());
    }
    Ok(())
}

/// The best adapter: discrete before integrated, and others only if they were asked for.
fn wgpu(any: bool) -> Result<Device, String> {
    use wgpu::DeviceType::{Cpu, DiscreteGpu, IntegratedGpu, VirtualGpu};
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: AutoGraphicsApi::backend().into(),
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let adapters = block_on(instance.enumerate_adapters(AutoGraphicsApi::backend().into()));
    let named = |kind, device: WgpuDevice| {
        let adapter = adapters.iter().find(|adapter| adapter.get_info().device_type == kind)?;
        Some((adapter.get_info().name, kind == Cpu, device))
    };
    let real = named(DiscreteGpu, WgpuDevice::DiscreteGpu(0))
        .or_else(|| named(IntegratedGpu, WgpuDevice::IntegratedGpu(0)));
    let found = real.or_else(|| {
        let other =
            named(VirtualGpu, WgpuDevice::VirtualGpu(0)).or_else(|| named(Cpu, WgpuDevice::Cpu));
        if any { other } else { None }
    });
    let Some((name, software, device)) = found else {
        let only = adapters.first().map(|adapter| adapter.get_info().name);
        return Err(match only {
            None => "wgpu: no adapter".to_owned(),
            Some(name) => format!("wgpu: only {name}, which is no GPU"),
        });
    };
    let engine = Arc::new(WgpuRuntime::client(&device));
    Ok(Device { engine, name, backend: Backend::Wgpu, software })
}
