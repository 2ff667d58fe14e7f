//! The networks on a GPU: one kernel source for CUDA, Vulkan, Metal and DirectX, through CubeCL.
//!
//! # Invariant
//! A GPU gives the processor's results to within 1e-4
//! (`network::tests::every_device_of_this_machine_gives_what_pytorch_gives`).
//!
//! | module | contents |
//! |---|---|
//! | `plan` | distribution of a convolution to workgroups within a device's limits: pure functions |
//! | `pack` | weights in the order in which the kernel reads them: pure functions |
//! | `kernels` | the kernels |
//! | `engine` | launches kernels on one device, for any runtime |
//! | `layer` | a convolution whose weights are on a device |
//! | `unet`, `fsrcnn`, `estimator` | the networks |
//! | `chain` | the three networks one after another, for images that are already on the device |
//!
//! # How
//! Activations are `frame x row x column x channel`. Nearly all work is in one kernel, `convolve`:
//! a convolution as a product of matrices (pixels by taps, and taps by channels), tile by tile
//! through shared memory. The operations after a convolution (bias, modulation by the conditions,
//! activation, residual, pixel shuffle) are done in registers before the output is stored. Fully
//! connected layers are convolutions of 1 x 1 over images of one pixel.

mod chain;
mod engine;
mod estimator;
mod fsrcnn;
mod kernels;
mod layer;
mod pack;
mod plan;
mod unet;

#[cfg(test)]
mod tests;

use std::sync::Arc;

use cubecl::Runtime;
use cubecl::cuda::{CudaDevice, CudaRuntime};
#[cfg(feature = "wgpu")]
use cubecl::wgpu::{WgpuDevice, WgpuRuntime};

pub(crate) use chain::Chain;
pub(crate) use engine::Engine;
pub(crate) use estimator::Estimator;
pub(crate) use fsrcnn::Fsrcnn;
pub(crate) use unet::UNet;

/// The engine of a wgpu device.
#[cfg(feature = "wgpu")]
pub(crate) fn wgpu(device: &WgpuDevice) -> Arc<dyn Engine> {
    Arc::new(WgpuRuntime::client(device))
}

/// The engine of a CUDA device.
pub(crate) fn cuda(device: &CudaDevice) -> Arc<dyn Engine> {
    Arc::new(CudaRuntime::client(device))
}
