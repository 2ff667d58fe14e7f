//! Finds GPUs.
//!
//! # Invariant
//! [`find`] is the only function that turns a [`Backend`] into a device. A backend requested by
//! name is found, or the error says what is missing
//! (`tests::a_backend_by_name_is_that_one_or_missing`). [`Backend::Auto`] never gives a software
//! device (`tests::auto_gives_a_real_gpu_or_says_what_is_missing`).
//!
//! A missing library is an error and never a panic: [`cuda`] looks for CUDA's libraries before
//! CubeCL, which would panic without them.

use super::Backend;
use cubecl::cuda::{CudaDevice, install::cuda_path};
#[cfg(feature = "wgpu")]
use cubecl::wgpu::WgpuDevice;
use cudarc::driver::{self, CudaContext, DriverError};
use thiserror::Error;

/// A device that was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found<D> {
    /// The device's identifier in CubeCL and burn.
    pub device: D,
    /// The device's name in its driver.
    pub name: String,
    /// Whether the processor emulates this GPU: right results without the speed of a GPU.
    pub software: bool,
}

/// What was looked for and not found. `Display` gives one line, which does not name the backend.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum Absent {
    /// NVIDIA's driver is missing.
    #[error("libcuda not found")]
    Driver,
    /// The compiler for kernels at run time is missing.
    #[error("libnvrtc not found, it comes with the CUDA toolkit")]
    Compiler,
    /// The headers that kernels include are missing.
    #[error("no toolkit in /usr/local/cuda, CUDA_PATH is not set")]
    Toolkit,
    /// All libraries are there, but no GPU that they can use.
    #[error("no GPU")]
    Device,
    /// This build can use no such device.
    #[error("this build is without the feature {0}")]
    NotBuilt(&'static str),
    /// The driver refused, for this reason.
    #[error("{0}")]
    Refused(String),
    /// No graphics adapter.
    #[error("no graphics adapter")]
    Adapter,
    /// Only an adapter that computes on the processor, or no faster.
    #[error("only {0}, which is no GPU")]
    NoGpu(String),
}

/// A device that a backend names.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Gpu {
    /// Through CUDA.
    Cuda(Found<CudaDevice>),
    /// Through Vulkan, Metal or DirectX.
    #[cfg(feature = "wgpu")]
    Wgpu(Found<WgpuDevice>),
}

/// The device of a backend was not found. `Display` gives one line with everything that was looked
/// for.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{}", .looked_for.iter().map(|(kind, absent)| format!("{kind}: {absent}")).collect::<Vec<_>>().join("; "))]
pub struct Missing {
    /// The backends that were tried (CUDA, wgpu or both), each with what is missing.
    pub looked_for: Vec<(&'static str, Absent)>,
}

/// The device of a backend; `None` for the processor. [`Backend::Auto`] means a GPU through CUDA,
/// else a discrete or integrated GPU through wgpu. Only [`Backend::Wgpu`] gives a software device.
///
/// # Errors
/// [`Missing`] names the backends that were tried, and why each is not usable.
pub fn find(backend: Backend) -> Result<Option<Gpu>, Missing> {
    let through_cuda = || cuda().map(Gpu::Cuda).map_err(|absent| ("CUDA", absent));
    let through_wgpu = |software_too| any_adapter(software_too).map_err(|absent| ("wgpu", absent));
    let found = match backend {
        Backend::Cpu => return Ok(None),
        Backend::Cuda => through_cuda().map_err(|absent| vec![absent]),
        Backend::Wgpu => through_wgpu(true).map_err(|absent| vec![absent]),
        Backend::Auto => through_cuda()
            .or_else(|no_cuda| through_wgpu(false).map_err(|no_wgpu| vec![no_wgpu, no_cuda])),
    };
    found.map(Some).map_err(|looked_for| Missing { looked_for })
}

/// The first GPU that CUDA can use.
///
/// # Errors
/// [`Absent`] if the driver, the run-time compiler, its headers, or a GPU is missing.
pub fn cuda() -> Result<Found<CudaDevice>, Absent> {
    installed()?;
    let refused = |error: DriverError| Absent::Refused(error.to_string());
    if CudaContext::device_count().map_err(refused)? < 1 {
        return Err(Absent::Device);
    }
    let name = CudaContext::new(0).and_then(|context| context.name()).map_err(refused)?;
    Ok(Found { device: CudaDevice::new(0), name, software: false })
}

/// Checks for the libraries that CubeCL needs.
#[expect(unsafe_code, reason = "looking for a library is loading it, which runs its initialisers")]
fn installed() -> Result<(), Absent> {
    // SAFETY: NVIDIA's libraries may be loaded at any time; CubeCL loads the same libraries later.
    let (driver, compiler) =
        unsafe { (driver::sys::is_culib_present(), cudarc::nvrtc::sys::is_culib_present()) };
    match (driver, compiler, cuda_path()) {
        (false, ..) => Err(Absent::Driver),
        (_, false, _) => Err(Absent::Compiler),
        (.., None) => Err(Absent::Toolkit),
        (true, true, Some(_)) => Ok(()),
    }
}

#[cfg(feature = "wgpu")]
fn any_adapter(software_too: bool) -> Result<Gpu, Absent> {
    wgpu(software_too).map(Gpu::Wgpu)
}

#[cfg(not(feature = "wgpu"))]
fn any_adapter(_software_too: bool) -> Result<Gpu, Absent> {
    Err(Absent::NotBuilt("wgpu"))
}

/// The best adapter of Vulkan, Metal or DirectX: discrete before integrated, and any other only if
/// `software_too`.
///
/// # Errors
/// [`Absent`] if no GPU answers.
#[cfg(feature = "wgpu")]
pub fn wgpu(software_too: bool) -> Result<Found<WgpuDevice>, Absent> {
    use cubecl::future::block_on;
    use cubecl::wgpu::{AutoGraphicsApi, GraphicsApi};
    use wgpu::DeviceType;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn auto_gives_a_real_gpu_or_says_what_is_missing() {
        match find(Backend::Auto) {
            Ok(None) => panic!("the processor is no answer to a search for a GPU"),
            Ok(Some(Gpu::Cuda(found))) => assert!(!found.software),
            #[cfg(feature = "wgpu")]
            Ok(Some(Gpu::Wgpu(found))) => assert!(!found.software),
            Err(missing) => {
                let line = missing.to_string();
                assert!(line.contains("wgpu: ") && line.contains("; CUDA: "), "{line}");
                assert!(!line.contains('\n'), "{line}");
            }
        }
        assert_eq!(find(Backend::Cpu), Ok(None));
    }

    #[test]
    fn a_backend_by_name_is_that_one_or_missing() {
        match find(Backend::Cuda) {
            Ok(found) => assert!(matches!(found, Some(Gpu::Cuda(_))), "{found:?}"),
            Err(missing) => assert!(missing.to_string().starts_with("CUDA: "), "{missing}"),
        }
        match find(Backend::Wgpu) {
            #[cfg(feature = "wgpu")]
            Ok(found) => assert!(matches!(found, Some(Gpu::Wgpu(_))), "{found:?}"),
            #[cfg(not(feature = "wgpu"))]
            Ok(found) => panic!("a build without wgpu found {found:?}"),
            Err(missing) => assert!(missing.to_string().starts_with("wgpu: "), "{missing}"),
        }
    }
}
