//! Enhances a reconstructed image, and gives its quality and its warnings.
//!
//! ```text
//! Image (ADC counts) ──white──> shares of white ──Enhance──> 64 x 64 in [0, 1] ──> Warning, Quality
//! ```
//!
//! `demo`, `reconstruct`, `capture`, `serve` and `eval` all use this module for the white level,
//! the blur (the larger of lens and estimate), the networks, and the rule for warnings.

#[cfg(feature = "enhance")]
mod enhance;
#[cfg(feature = "enhance")]
mod frames;
mod method_report;
mod quality;
#[cfg(feature = "enhance")]
mod readings;
#[cfg(all(feature = "pictures", not(target_family = "wasm")))]
pub mod stack;
#[cfg(feature = "enhance")]
mod stack_report;
#[cfg(feature = "enhance")]
mod warning;
mod white;

#[cfg(feature = "enhance")]
pub use enhance::{Enhance, EnhanceError, EnhancedImage, ImageContext, SPREAD_COPIES, White};
#[cfg(feature = "enhance")]
pub use frames::{
    FrameReport, FramesError, enhance_alike, enhance_frame, enhance_frames, enhance_frames_by,
};
#[cfg(all(feature = "enhance", not(target_family = "wasm")))]
pub(crate) use method_report::by_chance;
pub use method_report::{HeldBackReport, MethodReport};
pub use quality::{Fit, Noise, Quality, score};
#[cfg(feature = "enhance")]
pub use readings::KnownReadings;
#[cfg(feature = "enhance")]
pub use stack_report::{Deblurring, StackReport};
#[cfg(feature = "enhance")]
pub use warning::{Warning, warnings};
pub use white::{SteadyWhite, share_of_white};
