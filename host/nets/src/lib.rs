//! Enhancement of reconstructed images on the way to the 64 x 64 output: fusion with depth by FSRCNN, deblurring
//! by a diffusion bridge, and the baselines that they have to beat.
//!
//! Data flows from [`images`] through [`estimate`] (blur and noise), [`fusion`] and [`deblur`], all of it in [`enhance`].
//! Without learning anything: [`upscale`] and [`classical`].
//!
//! ```
//! let image = vec![0.25_f32; 32 * 32];
//! let enlarged = nirspi_nets::upscale_2x(&image, 1, 32, 32)?;
//! assert_eq!(enlarged.len(), 64 * 64);
//! # Ok::<(), nirspi_nets::UpscaleError>(())
//! ```

mod blur;
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
mod spread;
#[cfg(feature = "train")]
pub mod train;
pub mod upscale;
pub mod weights;

pub use deblur::{Deblurrer, Method};
pub use device::{Backend, Device, DeviceError};
#[cfg(feature = "gpu")]
pub use enhance::{DeviceEnhancer, DeviceEnhancerError};
pub use enhance::{Enhanced, Enhancer, KnownEstimate, Options, Sharpener};
pub use estimate::{BlurEstimator, Estimate};
pub use fusion::{DepthError, DepthMaps, Fusion};
pub use images::{Images, ImagesError};
pub use upscale::{UpscaleError, upscale_2x};
pub use weights::{Weights, WeightsError};
