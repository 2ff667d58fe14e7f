#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! Enhances reconstructed images to the 64 x 64 output: fusion with depth by FSRCNN, deblurring by
//! a diffusion bridge, and the baselines that both have to beat.
//!
//! [`Networks`] chooses the weights, [`Sharpen`] is the interface for your own network. [`interval`]
//! says how far a pixel may be from the truth, and [`reading`] which character an image shows.
//! [`upscale`] and [`classical`] work without learning. [`prior`] is apart: the network of a
//! reconstruction method of `nirspi_recon`.
//!
//! # Layers
//! A module uses only modules of the layers before its own: shapes and weights of networks come
//! first, then what runs them (processor, GPU), then the choice of the device, then the stages, then
//! all stages together, then what is said about their results.
//!
//! | layer | modules |
//! |---|---|
//! | grids and arithmetic | `grid`, [`images`], `arithmetic`, `note` and other small ones |
//! | shapes and weights of networks, and what a network does on any device | [`weights`], `schema`, `network` |
//! | blur and noise of an image, and agreement with the readings | [`estimate`], [`consistency`] |
//! | what runs networks | [`cpu`], `gpu` |
//! | the device | [`device`] |
//! | stages | [`estimator`] (blur and noise), [`fusion`] (with depth), [`deblur`] |
//! | all stages | [`enhance`] |
//! | results | `choice`, [`interval`] |

mod arithmetic;
mod blur;
mod choice;
pub mod classical;
pub mod consistency;
mod cosine;
pub mod cpu;
pub mod data;
pub mod deblur;
pub mod degrade;
pub mod device;
pub mod embedded;
pub mod enhance;
pub mod estimate;
pub mod estimator;
mod filter;
pub mod fusion;
mod gate;
#[cfg(feature = "gpu")]
mod gpu;
mod grid;
pub mod images;
pub mod interval;
pub mod metrics;
mod network;
mod note;
pub mod prior;
mod random;
pub mod reading;
mod rounding;
mod schema;
mod separable;
mod spread;
pub mod upscale;
pub mod weights;

pub use arithmetic::{Arithmetic, ParseArithmeticError};
pub use choice::{Networks, UsedWeights};
pub use consistency::{MeasuredRows, MeasuredRowsError};
pub use deblur::{Blurred, Deblurrer, Method, Sharpen};
pub use device::{Backend, Device, DeviceError};
#[cfg(feature = "gpu")]
pub use enhance::{DeviceEnhancer, DeviceEnhancerError};
pub use enhance::{EnhanceError, Enhanced, Enhancer, Options, Sharpener};
pub use estimate::{Estimate, Known, KnownEstimate};
pub use estimator::BlurEstimator;
pub use fusion::{DepthError, DepthMaps, Fusion};
pub use images::{Images, ImagesError};
pub use interval::{Intervals, NoIntervals};
pub use nirspi_weights::HELD_OUT;
pub use note::Note;
pub use upscale::{UpscaleError, upscale_2x};
pub use weights::{Weights, WeightsError};
