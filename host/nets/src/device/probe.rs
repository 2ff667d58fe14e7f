//! Is there a GPU? Looked at before burn would panic without one.

use burn::backend::wgpu::WgpuDevice;
use burn::backend::wgpu::graphics::{AutoGraphicsApi, GraphicsApi};

/// Name of the first GPU that CUDA can use: driver, run-time compiler and its headers are all needed.
pub(super) fn cuda() -> Result<String, String> {
    installed()?;
    match cudarc::driver::CudaContext::device_count() {
        Ok(count) if count > 0 => {}
        Ok(_) => return Err("CUDA finds no GPU".to_owned()),
        Err(error) => return Err(format!("CUDA: {error}")),
    }
    let name = cudarc::driver::CudaContext::new(0).and_then(|context| context.name());
    name.map_err(|error| format!("CUDA: {error}"))
}

#[expect(unsafe_code, reason = "looking for a library is loading it, which runs its initialisers")]
fn installed() -> Result<(), String> {
    // SAFETY: NVIDIA's libraries have no preconditions on being loaded; the same ones are loaded to be used.
    let (driver, compiler) = unsafe {
        (cudarc::driver::sys::is_culib_present(), cudarc::nvrtc::sys::is_culib_present())
    };
    match (driver, compiler, cubecl::cuda::install::cuda_path()) {
        (false, ..) => Err("no CUDA driver (libcuda)".to_owned()),
        (_, false, _) => Err("no CUDA toolkit (libnvrtc)".to_owned()),
        (.., None) => Err("no CUDA toolkit in /usr/local/cuda, and no CUDA_PATH".to_owned()),
        (true, true, Some(_)) => Ok(()),
    }
}

/// The best adapter: discrete before integrated, others only if wanted.
pub(super) fn wgpu(software_too: bool) -> Result<(WgpuDevice, String), String> {
    use ::wgpu::DeviceType::{Cpu, DiscreteGpu, IntegratedGpu, VirtualGpu};
    let backends = AutoGraphicsApi::backend().into();
    let instance = ::wgpu::Instance::new(::wgpu::InstanceDescriptor {
        backends,
        ..::wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let adapters = cubecl::future::block_on(instance.enumerate_adapters(backends));
    let real =
        [(DiscreteGpu, WgpuDevice::DiscreteGpu(0)), (IntegratedGpu, WgpuDevice::IntegratedGpu(0))];
    let other = [(VirtualGpu, WgpuDevice::VirtualGpu(0)), (Cpu, WgpuDevice::Cpu)];
    real.into_iter()
        .chain(other.into_iter().filter(|_| software_too))
        .find_map(|(kind, device)| {
            let mut infos = adapters.iter().map(::wgpu::Adapter::get_info);
            infos.find(|info| info.device_type == kind).map(|info| (device, info.name))
        })
        .ok_or_else(|| match adapters.first() {
            None => "no graphics adapter".to_owned(),
            Some(adapter) => format!("only {}, which is no GPU", adapter.get_info().name),
        })
}
