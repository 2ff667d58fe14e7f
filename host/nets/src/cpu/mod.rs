//! The networks' forward passes on the CPU, for a few images.
//!
//! Tests compare each network with PyTorch's outputs for the same weights.
//!
//! # Invariant
//! A result depends neither on the number of threads nor on the other images of a batch
//! (`enhance::tests::an_image_is_enhanced_alike_alone_and_among_others`).

mod activation;
mod aligned;
mod classifier;
mod conv;
pub(crate) mod estimator;
mod fsrcnn;
mod layers;
mod on_cpu;
mod pixels;
mod planes;
mod pointwise;
mod prior;
mod product;
mod unet;
mod winograd;

pub use classifier::Classifier;
pub use estimator::Estimator;
pub use fsrcnn::Fsrcnn;
pub(crate) use on_cpu::OnCpu;
pub use prior::Prior;
pub use unet::UNet;

#[cfg(test)]
mod tests;
