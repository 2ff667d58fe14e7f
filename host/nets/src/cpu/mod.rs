//! The networks' forward passes on the CPU, where one image is all there is and nothing is trained.
//!
//! Tests hold each network to PyTorch's outputs for the same weights. The networks that are trained (`crate::model`, feature
//! `train`) read the same files and are held to the same outputs.
//!
//! # Invariant
//! A result does not depend on the number of threads, nor on what else is in a batch
//! (`enhance::tests::an_image_is_enhanced_alike_alone_and_among_others`).

mod activation;
mod classifier;
mod conv;
pub(crate) mod estimator;
mod fsrcnn;
mod layers;
mod planes;
mod unet;

pub use classifier::Classifier;
pub use estimator::Estimator;
pub use fsrcnn::Fsrcnn;
pub use unet::UNet;

#[cfg(test)]
mod tests;
