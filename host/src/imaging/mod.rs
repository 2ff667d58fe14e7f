//! From a reconstructed image to an enhanced one, with its quality and the warnings that belong on it.
//!
//! ```text
//! Image (ADC counts) ──white──> [0, 1] ──Enhance──> 64 x 64 in [0, 1] ──> Warning, Quality
//! ```
//!
//! `demo`, `reconstruct`, `capture`, `serve` and `eval` all go this way: white level, the larger of lens and estimator as
//! blur, networks, and the rule for warnings stand here once.

#[cfg(feature = "enhance")]
mod enhance;
mod method_report;
mod quality;
#[cfg(feature = "enhance")]
mod warning;
mod white;

#[cfg(feature = "enhance")]
pub use enhance::{Enhance, EnhanceError, EnhancedImage, ImageContext, White};
pub use method_report::MethodReport;
pub use quality::{Fit, Fitted, Quality, compare};
#[cfg(feature = "enhance")]
pub use warning::{Warning, warnings};
pub use white::{SteadyWhite, brightest};
