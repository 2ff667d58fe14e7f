//! Enhances reconstructed images to the 64 x 64 output: fusion with depth by FSRCNN, deblurring by
//! a diffusion bridge, and the baselines that both have to beat.
//!
//! Data flows from [`images`] through [`estimate`] (blur and noise), [`fusion`] and [`deblur`];
//! [`enhance`] does all of these. [`Networks`] chooses the weights, [`Sharpen`] is the interface
//! for your own network. [`upscale`] and [`classical`] work without learning.
//!
//! ```
//! use nirspi_nets::{Device, Enhancer, Images, Options};
//!
//! // A bar of 4 pixels, somewhat out of focus; 1 is a white target.
//! let mut reading = vec![0.1_f32; 32 * 32];
//! for line in reading.chunks_mut(32) {
//!     line[12..20].copy_from_slice(&[0.2, 0.5, 0.8, 0.9, 0.9, 0.8, 0.5, 0.2]);
//! }
//! let enhancer = Enhancer::built_in(&Device::cpu())?;
//! let result = enhancer.enhance(Images::new(&reading)?, None, &Options::default(), &mut |_| {})?;
//! assert_eq!(result.images.len(), 64 * 64);
//! assert!(result.estimates[0].sigma_px > 0.5, "blur in pixels of the 64 x 64 grid");
//! assert!(result.inconsistency[0] < 1.2, "the readings support the image");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

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
pub mod metrics;
#[cfg(feature = "train")]
pub mod model;
mod network;
mod random;
mod schema;
mod spread;
#[cfg(feature = "train")]
pub mod train;
pub mod upscale;
pub mod weights;

pub use choice::{Networks, UsedWeights};
pub use consistency::{MeasuredRows, MeasuredRowsError};
pub use deblur::{Blurred, Deblurrer, Method, Sharpen};
pub use device::{Backend, Device, DeviceError};
#[cfg(feature = "gpu")]
pub use enhance::{DeviceEnhancer, DeviceEnhancerError};
pub use enhance::{EnhanceError, Enhanced, Enhancer, Known, KnownEstimate, Options, Sharpener};
pub use estimate::{BlurEstimator, Estimate};
pub use fusion::{DepthError, DepthMaps, Fusion};
pub use images::{Images, ImagesError};
pub use upscale::{UpscaleError, upscale_2x};
pub use weights::{Weights, WeightsError};
