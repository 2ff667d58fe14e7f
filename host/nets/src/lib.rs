//! Enhancement of reconstructed images on the way to the 64 x 64 output.
//!
//! Classical: [`upscale`] and [`classical`] deblurring. FSRCNN, the diffusion deblurrer and the GAN
//! baseline come with their own issue.
//!
//! ```
//! let image = vec![0.25_f32; 32 * 32];
//! let enlarged = nirspi_nets::upscale_2x(&image, 1, 32, 32)?;
//! assert_eq!(enlarged.len(), 64 * 64);
//! # Ok::<(), nirspi_nets::UpscaleError>(())
//! ```

pub mod classical;
pub mod cpu;
pub mod model;
pub mod upscale;
pub mod weights;

pub use upscale::{UpscaleError, upscale_2x};
pub use weights::{Weights, WeightsError};
