//! Every kernel of this crate, on a device of the caller's choice.

use crate::agreement::Agree;
use crate::network::Convolve;
use crate::probe::Gpu;
use crate::pursuit::Pursue;
#[cfg(feature = "source")]
use crate::source::SourceRuntime;
use cubecl::cuda::CudaRuntime;
use cubecl::prelude::*;
#[cfg(feature = "wgpu")]
use cubecl::wgpu::WgpuRuntime;
use std::sync::Arc;

/// Every kernel of this crate.
pub trait Kernels: Pursue + Convolve + Agree {}

impl<E: Pursue + Convolve + Agree> Kernels for E {}

/// The engine of a device. CubeCL has one client for each device, so buffers of one engine can be
/// used with every other engine of the same device.
#[must_use]
pub fn open(gpu: &Gpu) -> Arc<dyn Kernels> {
    match gpu {
        Gpu::Cuda(found) => Arc::new(CudaRuntime::client(&found.device)),
        #[cfg(feature = "wgpu")]
        Gpu::Wgpu(found) => Arc::new(WgpuRuntime::client(&found.device)),
        #[cfg(feature = "source")]
        Gpu::Source(found) => Arc::new(SourceRuntime::client(&found.device)),
    }
}
