#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! Enhances reconstructed images to the 64 x 64 output: fusion with depth by FSRCNN, deblurring by
//! a diffusion bridge, and the baselines that both have to beat.
//!
//! Data flows from [`images`] through [`estimate`] (blur and noise), [`fusion`] and [`deblur`];
//! [`enhance`] does all of these. [`Networks`] chooses the weights, [`Sharpen`] is the interface
//! for your own network. [`interval`] says how far a pixel may be from the truth, and [`reading`]
//! which character an image shows. [`upscale`] and [`classical`] work without learning. [`prior`] is apart from that line: the
//! network of a reconstruction method of `nirspi_recon`.

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
mod filter;
pub mod fusion;
mod gate;
#[cfg(feature = "gpu")]
mod gpu;
pub mod images;
pub mod interval;
pub mod metrics;
mod network;
pub mod prior;
mod random;
pub mod reading;
mod schema;
mod separable;
mod spread;
pub mod upscale;
pub mod weights;
pub mod zones;

pub use choice::{Networks, UsedWeights};
pub use consistency::{MeasuredRows, MeasuredRowsError};
pub use deblur::{Blurred, Deblurrer, Method, Sharpen};
pub use device::{Arithmetic, Backend, Device, DeviceError, Note, ParseArithmeticError};
#[cfg(feature = "gpu")]
pub use enhance::{DeviceEnhancer, DeviceEnhancerError};
pub use enhance::{EnhanceError, Enhanced, Enhancer, Known, KnownEstimate, Options, Sharpener};
pub use estimate::{BlurEstimator, Estimate};
pub use fusion::{DepthError, DepthMaps, Fusion};
pub use images::{Images, ImagesError};
pub use interval::{Intervals, NoIntervals};
pub use nirspi_weights::HELD_OUT;
pub use upscale::{UpscaleError, upscale_2x};
pub use weights::{Weights, WeightsError};
pub use zones::BlurZones;
