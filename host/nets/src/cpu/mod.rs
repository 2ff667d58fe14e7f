//! The networks' forward passes on the CPU, where one image is all there is and nothing is trained.
//!
//! The same networks as in [`crate::model`], from the same weights: tests hold each to the other. They are here again
//! because of time: docs/performance.md has both beside PyTorch.
//!
//! Law: results do not depend on the number of threads, nor on what else is in a batch.

mod activation;
mod conv;
mod estimator;
mod fsrcnn;
mod layers;
mod planes;
mod unet;

pub use estimator::Estimator;
pub use fsrcnn::Fsrcnn;
pub use unet::UNet;

#[cfg(test)]
mod tests;
