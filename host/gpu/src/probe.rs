//! Finds GPUs.
//!
//! A missing library is an error and never a panic: [`cuda`] looks for CUDA's libraries before
//! CubeCL, which would panic without them.

use crate::cache::{self, Compiled};
#[cfg(feature = "source")]
use crate::card::Card;
use cubecl::cuda::{CudaDevice, install::cuda_path};
#[cfg(feature = "wgpu")]
use cubecl::wgpu::WgpuDevice;
use cudarc::driver::{self, CudaContext, DriverError};
use thiserror::Error;

/// A device that was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found<D> {
    /// The device's identifier in CubeCL.
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

/// A GPU.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Gpu {
    /// Through CUDA.
    Cuda(Found<CudaDevice>),
    /// Through Vulkan, Metal or DirectX.
    #[cfg(feature = "wgpu")]
    Wgpu(Found<WgpuDevice>),
    /// None: kernels are written as CUDA source.
    #[cfg(feature = "source")]
    Source(Found<Card>),
}

impl Gpu {
    /// The device's name in its driver.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Cuda(found) => &found.name,
            #[cfg(feature = "wgpu")]
            Self::Wgpu(found) => &found.name,
            #[cfg(feature = "source")]
            Self::Source(found) => &found.name,
        }
    }

    /// Whether the processor emulates this GPU: right results without the speed of a GPU.
    #[must_use]
    pub fn is_software(&self) -> bool {
        match self {
            Self::Cuda(found) => found.software,
            #[cfg(feature = "wgpu")]
            Self::Wgpu(found) => found.software,
            #[cfg(feature = "source")]
            Self::Source(found) => found.software,
        }
    }

    /// Whether the device computes through CUDA.
    #[must_use]
    pub fn is_cuda(&self) -> bool {
        match self {
            Self::Cuda(_) => true,
            #[cfg(feature = "wgpu")]
            Self::Wgpu(_) => false,
            #[cfg(feature = "source")]
            Self::Source(_) => true,
        }
    }
}

#[cfg(feature = "source")]
impl From<Card> for Gpu {
    fn from(card: Card) -> Self {
        Self::Source(Found { device: card, name: card.to_string(), software: true })
    }
}

/// The first GPU that CUDA can use. The first call has CubeCL keep compiled kernels
/// ([`cache`]).
///
/// # Errors
/// [`Absent`] if the driver, the run-time compiler, its headers, or a GPU is missing.
pub fn cuda() -> Result<Found<CudaDevice>, Absent> {
    installed()?;
    let refused = |error: DriverError| Absent::Refused(error.to_string());
    if CudaContext::device_count().map_err(refused)? < 1 {
        return Err(Absent::Device);
    }
    let context = CudaContext::new(0).map_err(refused)?;
    let name = context.name().map_err(refused)?;
    let capability = context.compute_capability().map_err(refused)?;
    cache::enable(Compiled { capability, compiler: compiler() });
    Ok(Found { device: CudaDevice::new(0), name, software: false })
}

/// NVRTC's version, (0, 0) if it does not say.
#[expect(unsafe_code, reason = "a function of NVIDIA's library")]
fn compiler() -> (i32, i32) {
    let (mut major, mut minor) = (0, 0);
    // SAFETY: the library is there, and writes two numbers.
    let _ = unsafe { cudarc::nvrtc::sys::nvrtcVersion(&raw mut major, &raw mut minor) };
    (major, minor)
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

/// The kinds of adapters that a search may give.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Adapters {
    /// Discrete and integrated GPUs.
    Gpus,
    /// GPUs first, then virtual and software adapters.
    All,
}

/// The best adapter of Vulkan, Metal or DirectX: discrete before integrated, and any other only
/// with [`Adapters::All`].
///
/// # Errors
/// [`Absent`] if no adapter of these kinds answers.
#[cfg(feature = "wgpu")]
pub fn adapter(kinds: Adapters) -> Result<Gpu, Absent> {
    wgpu(kinds).map(Gpu::Wgpu)
}

/// This build looks for no adapter.
///
/// # Errors
/// [`Absent::NotBuilt`] always.
#[cfg(not(feature = "wgpu"))]
pub fn adapter(_: Adapters) -> Result<Gpu, Absent> {
    Err(Absent::NotBuilt("wgpu"))
}

#[cfg(feature = "wgpu")]
fn wgpu(kinds: Adapters) -> Result<Found<WgpuDevice>, Absent> {
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
        .chain(other.into_iter().filter(|_| kinds == Adapters::All))
        .find_map(|(kind, device)| {
            let info = infos.iter().find(|info| info.device_type == kind)?;
            Some(Found { device, name: info.name.clone(), software: kind == DeviceType::Cpu })
        })
        .ok_or_else(|| match infos.first() {
            None => Absent::Adapter,
            Some(info) => Absent::NoGpu(info.name.clone()),
        })
}
