//! The networks on a GPU: one kernel source for CUDA, Vulkan, Metal and DirectX, through CubeCL.
//!
//! # Invariant
//! A GPU gives the processor's results to within 1e-4
//! (`device::networks::tests::every_device_of_this_machine_gives_what_pytorch_gives`), and to within 5e-3 in
//! [`Arithmetic::F16`](crate::Arithmetic::F16)
//! (`tests::products::the_unet_by_products_is_the_unet_in_both_precisions`).
//!
//! | module | contents |
//! |---|---|
//! | `pack` | weights in the order in which the kernel reads them: pure functions |
//! | `layer` | a convolution whose weights are on a device |
//! | `multiplier` | tensor cores for the UNet |
//! | `unet`, `fsrcnn`, `estimator` | the networks |
//!
//! The kernels, and how they compute a convolution, are in [`nirspi_gpu::network`].

mod estimator;
mod fsrcnn;
mod layer;
mod multiplier;
mod pack;
mod unet;

#[cfg(test)]
mod tests;

use nirspi_gpu::{Buffer, Kernels};

pub(crate) use estimator::Estimator;
pub(crate) use fsrcnn::Fsrcnn;
pub(crate) use multiplier::Multiplier;
pub(crate) use unet::UNet;

/// The numbers of each buffer.
///
/// # Panics
/// If the GPU or its driver fails while it computes.
fn read(engine: &dyn Kernels, buffers: &[&Buffer]) -> Vec<Vec<f32>> {
    match engine.read(buffers) {
        Ok(all) => all.iter().map(|numbers| numbers.floats().to_vec()).collect(),
        Err(error) => panic!("{error}"),
    }
}
