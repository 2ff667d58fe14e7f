//! The images that a page shows, and what it says of them.

use super::Shared;
use super::look::{DepthImage, Look, MeasuredError};
use super::settings::Settings;
use nirspi::account::LossCounters;
use nirspi::clock::{self, Instant};
use nirspi::imaging::EnhanceError;
use nirspi_nets::WeightsError;
#[cfg(not(target_family = "wasm"))]
use nirspi_own::MatrixError;
use nirspi_recon::reconstruct::ReconstructError;
use nirspi_recon::{Image, Shape};
use serde::Serialize;
use std::sync::Arc;
use thiserror::Error;

/// The images of one state, and their properties.
#[derive(Debug, Serialize)]
pub struct Picture {
    /// The first image has number 1, each further one the next number.
    pub number: u64,
    /// Side of the reconstructed image of Hadamard patterns: 32 for a camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n: Option<usize>,
    /// Height of the reconstructed image.
    pub height: usize,
    /// Width of the reconstructed image.
    pub width: usize,
    /// The unit of readings and pixels; may be empty for a feed.
    pub unit: String,
    /// The reconstructed image, (height, width).
    #[serde(skip)]
    pub counts: Vec<f32>,
    /// The enhanced image, (64, 64) in [0, 1], with white at 1.
    #[serde(skip)]
    pub enhanced: Option<Vec<f32>>,
    /// Half-width of the 95 % interval of each pixel of the enhanced image; `None` for a network
    /// without calibrated intervals.
    #[serde(skip)]
    pub half_width: Option<Vec<f32>>,
    /// The readings, (n, n): that of Hadamard row `n r + c` at (r, c); NaN for a row
    /// that was not measured. `None` for other patterns.
    #[serde(skip)]
    pub readings: Option<Vec<f32>>,
    /// The depth map that was fused.
    #[serde(skip)]
    pub depth: Option<Arc<DepthImage>>,
    /// When the newest frame came out of the link.
    #[cfg(not(target_family = "wasm"))]
    #[serde(skip)]
    pub arrived: Instant,
    /// The same on the clock of the computer that reads the camera, in milliseconds since 1970.
    pub arrived_unix_ms: u64,
    pub method: &'static str,
    /// Name of the patterns' order.
    pub order: String,
    /// Number of patterns shown.
    pub patterns: usize,
    /// Sweeps summed into one frame.
    pub sweeps: u32,
    /// The loss counters of the image's run, with its newest frame.
    pub run_frames: LossCounters,
    /// What the image takes from the images before, in words; `null` if it takes nothing.
    pub past: Option<String>,
    /// Number of summed frames.
    pub frames: u64,
    /// ADC counts of one pixel that were used as white.
    pub white_counts: f32,
    pub reconstruct_ms: f64,
    /// The results of the learned stages; `null` if they are switched off.
    pub enhancement: Option<Enhancement>,
    /// Reasons not to trust the images: the frames' flags, and the results of the learned stages.
    pub warnings: Vec<String>,
    /// The warnings of the frames' flags, for the image itself.
    pub frame_warnings: Vec<String>,
    /// Short forms of the learned stages' warnings, for the enhanced image itself.
    pub short_warnings: Vec<&'static str>,
}

impl Picture {
    /// The reconstructed image, (height, width) in [0, 1], with white at 1.
    #[cfg(not(target_family = "wasm"))]
    pub fn shares_of_white(&self) -> Vec<f32> {
        let scale = if self.white_counts > 0.0 { 1.0 / self.white_counts } else { 0.0 };
        self.counts.iter().map(|value| (value * scale).clamp(0.0, 1.0)).collect()
    }
}

/// Why the newest frames gave no picture.
#[derive(Debug, Error)]
pub(super) enum PictureError {
    /// The settings name a method that does not exist.
    #[error("there is no method {0}")]
    Method(&'static str),
    /// The frames give no measurements.
    #[error(transparent)]
    Measurements(#[from] MeasuredError),
    /// The method gives no image.
    #[error(transparent)]
    Reconstruct(#[from] ReconstructError),
    /// The patterns of a feed, or a setting, give no image.
    #[cfg(not(target_family = "wasm"))]
    #[error(transparent)]
    Matrix(#[from] MatrixError),
    /// The image has a pixel that is not finite.
    #[error("the frames gave no image of finite numbers")]
    NotFinite,
    /// The weights of the network are damaged.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// The networks refuse the image.
    #[error(transparent)]
    Enhance(#[from] EnhanceError),
}

/// Number of pictures after which a method that chooses among others chooses again: some seconds of a
/// live view.
pub(super) const CHOSEN_EVERY: u32 = 100;

/// The picture of an image, without what networks and Hadamard patterns add.
pub(super) fn made_of(
    look: &Look,
    settings: &Settings,
    shared: &Shared,
    image: &Image<impl Shape>,
    white_counts: f32,
    reconstruct_ms: f64,
) -> Picture {
    let (order, patterns, sweeps) = look.patterns();
    Picture {
        number: shared.slot.ledger().images.shown + 1,
        counts: image.pixels().to_vec(),
        enhanced: None,
        half_width: None,
        readings: None,
        depth: look.depth().cloned(),
        #[cfg(not(target_family = "wasm"))]
        arrived: look.arrived,
        arrived_unix_ms: (clock::since_1970().saturating_sub(look.arrived.elapsed())).as_millis()
            as u64,
        method: settings.method,
        n: None,
        height: image.size().height(),
        width: image.size().width(),
        unit: look.unit(),
        order,
        patterns,
        sweeps,
        run_frames: look.counters,
        past: None,
        frames: look.frames(),
        white_counts,
        reconstruct_ms,
        enhancement: None,
        warnings: Vec::new(),
        frame_warnings: Vec::new(),
        short_warnings: Vec::new(),
    }
}

pub(super) fn ms_since(started: Instant) -> f64 {
    started.elapsed().as_secs_f64() * 1e3
}

#[cfg(fuzzing)]
impl Picture {
    /// A picture of these counts, of which 2 are white.
    pub fn of_counts(number: u64, counts: Vec<f32>, enhanced: Option<Vec<f32>>) -> Self {
        Self {
            number,
            n: Some(32),
            height: 32,
            width: 32,
            unit: "ADC counts".to_owned(),
            counts,
            enhanced,
            half_width: None,
            readings: None,
            depth: None,
            arrived: Instant::now(),
            arrived_unix_ms: clock::since_1970().as_millis() as u64,
            method: "hadamard",
            order: String::new(),
            patterns: 1024,
            sweeps: 1,
            run_frames: LossCounters::default(),
            past: None,
            frames: 1,
            white_counts: 2.0,
            reconstruct_ms: 0.0,
            enhancement: None,
            warnings: Vec::new(),
            frame_warnings: Vec::new(),
            short_warnings: Vec::new(),
        }
    }
}

/// The results of the learned stages.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Enhancement {
    /// The network that deblurred.
    pub model: &'static str,
    /// Estimated blur in pixels of the 64 x 64 grid.
    pub blur_px: f32,
    /// Estimated noise of a pixel; white is 1.
    pub noise: f32,
    /// Distance of the image from that of the result, divided by its noise. A value near 1 or below
    /// means that the readings support the result.
    pub inconsistency: f32,
    /// Whether a depth map was fused.
    pub depth: bool,
    pub enhance_ms: f64,
}
