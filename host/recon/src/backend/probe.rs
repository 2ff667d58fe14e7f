//! Is there a GPU?
//!
//! The one law: absence is an answer, never a crash. CUDA's libraries are looked for before CubeCL would panic without
//! them.

use cubecl::cuda::{CudaDevice, install::cuda_path};
use cubecl::future::block_on;
use cubecl::wgpu::{AutoGraphicsApi, GraphicsApi, WgpuDevice};
use cudarc::driver::{self, CudaContext, DriverError};
use thiserror::Error;
use wgpu::DeviceType;

/// A device that is there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found<D> {
    /// What CubeCL, and burn with it, calls it.
    pub device: D,
    /// What its driver calls it.
    pub name: String,
    /// Whether the processor plays the GPU: right results, no speed.
    pub software: bool,
}

/// What was looked for and not found. `Display` is one line, which leaves it to the caller to name the backend.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum Absent {
    /// No driver of NVIDIA's.
    #[error("libcuda not found")]
    Driver,
    /// No compiler for kernels at run time.
    #[error("libnvrtc not found, it comes with the CUDA toolkit")]
    Compiler,
    /// None of the headers that kernels include.
    #[error("no toolkit in /usr/local/cuda, CUDA_PATH is not set")]
    Toolkit,
    /// All libraries, and nothing that they could use.
    #[error("no GPU")]
    Device,
    /// The driver says no.
    #[error("{0}")]
    Refused(String),
    /// Nothing that draws.
    #[error("no graphics adapter")]
    Adapter,
    /// Only what computes no faster than the processor, or is it.
    #[error("only {0}, which is no GPU")]
    NoGpu(String),
}

/// The first GPU that CUDA can use.
///
/// # Errors
/// [`Absent`] if the driver, the compiler that makes kernels at run time or its headers are missing, or the GPU is.
pub fn cuda() -> Result<Found<CudaDevice>, Absent> {
    installed()?;
    let refused = |error: DriverError| Absent::Refused(error.to_string());
    if CudaContext::device_count().map_err(refused)? < 1 {
        return Err(Absent::Device);
    }
    let name = CudaContext::new(0).and_then(|context| context.name()).map_err(refused)?;
    Ok(Found { device: CudaDevice::new(0), name, software: false })
}

/// Looks for what CubeCL takes for granted.
#[expect(unsafe_code, reason = "looking for a library is loading it, which runs its initialisers")]
fn installed() -> Result<(), Absent> {
    // SAFETY: NVIDIA's libraries have no preconditions on being loaded; the same ones are loaded to be used.
    let (driver, compiler) =
        unsafe { (driver::sys::is_culib_present(), cudarc::nvrtc::sys::is_culib_present()) };
    match (driver, compiler, cuda_path()) {
        (false, ..) => Err(Absent::Driver),
        (_, false, _) => Err(Absent::Compiler),
        (.., None) => Err(Absent::Toolkit),
        (true, true, Some(_)) => Ok(()),
    }
}

/// The best adapter of Vulkan, Metal or DirectX: discrete before integrated, and others only if `software_too`.
///
/// # Errors
/// [`Absent`] if there is none.
pub fn wgpu(software_too: bool) -> Result<Found<WgpuDevice>, Absent> {
    let backends = AutoGraphicsApi::backend().into();
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let adapters = block_on(instance.enumerate_adapters(backends));
    let infos: Vec<_> = adapters.iter().map(wgpu::Adapter::get_info).collect();
    let real = [
        (DeviceType::DiscreteGpu, WgpuDevice::DiscreteGpu(0)),
        (DeviceType::IntegratedGpu, WgpuDevice::IntegratedGpu(0)),
    ];
    let other =
        [(DeviceType::VirtualGpu, WgpuDevice::VirtualGpu(0)), (DeviceType::Cpu, WgpuDevice::Cpu)];
    real.into_iter()
        .chain(other.into_iter().filter(|_| software_too))
        .find_map(|(kind, device)| {
            let info = infos.iter().find(|info| info.device_type == kind)?;
            Some(Found { device, name: info.name.clone(), software: kind == DeviceType::Cpu })
        })
        .ok_or_else(|| match infos.first() {
            None => Absent::Adapter,
            Some(info) => Absent::NoGpu(info.name.clone()),
        })
}
