//! The networks on a GPU: one kernel source for CUDA, Vulkan, Metal and DirectX, through CubeCL.
//!
//! # Invariant
//! A GPU gives what the processor gives, to 1e-4 (`network::tests::every_device_of_this_machine_gives_what_pytorch_gives`).
//!
//! | module | holds |
//! |---|---|
//! | `plan` | how a convolution is dealt out to workgroups, and what a device's limits allow: pure functions |
//! | `pack` | weights in the order in which the kernel reads them: pure functions |
//! | `kernels` | what runs on the device |
//! | `engine` | launches kernels on one device, whatever its runtime |
//! | `layer` | a convolution whose weights are on a device |
//! | `unet`, `fsrcnn`, `estimator` | the networks |
//! | `chain` | the three networks one after another, for images that are on the device already |
//!
//! # How
//! Activations are `frame x row x column x channel`. Nearly all work is in one kernel, `convolve`: a convolution as a product of
//! matrices, pixels by taps and taps by channels, tile by tile through shared memory. What follows a convolution (bias,
//! modulation by the conditions, activation, residual, pixel shuffle) is done in its registers before anything is
//! written. Fully connected layers are convolutions of 1 x 1 over images of one pixel.

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
use cubecl::wgpu::{WgpuDevice, WgpuRuntime};

pub(crate) use chain::Chain;
pub(crate) use engine::Engine;
pub(crate) use estimator::Estimator;
pub(crate) use fsrcnn::Fsrcnn;
pub(crate) use unet::UNet;

/// The engine of a device of wgpu.
pub(crate) fn wgpu(device: &WgpuDevice) -> Arc<dyn Engine> {
    Arc::new(WgpuRuntime::client(device))
}

/// The engine of a device of CUDA.
pub(crate) fn cuda(device: &CudaDevice) -> Arc<dyn Engine> {
    Arc::new(CudaRuntime::client(device))
}
