//! From a sharp scene to what the camera gives of it: the other half of every training pair.
//!
//! The one law: whatever degrades a scene says how much it did (blur, noise), so that a network can be told, and
//! draws everything random from the stream that it is given.
//!
//! [`AnalyticCamera`] is formulas alone and fast. A camera that is simulated from light to frames is the business of
//! the crate that has one; it implements [`Degrade`] too.

mod analytic;
pub mod defocus;

pub use analytic::{AnalyticCamera, Limits};

use crate::data::SIDE_PX;
use rand_pcg::Pcg64Mcg;
use thiserror::Error;

/// Side of what the camera reads, in pixels.
pub const READING_PX: usize = SIDE_PX / 2;
/// Zones along one edge of a depth map.
pub const DEPTH_SIDE: usize = 8;

/// One scene as a camera gave it.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// 32 x 32 values in `[0, 1]`, row-major: 1 is what a white target gives.
    pub image: Vec<f32>,
    /// The scene as light showed it, 64 x 64: blurred, before it was sampled and before noise.
    pub optical: Vec<f32>,
    /// Standard deviation of the blur in pixels of the 64 x 64 grid.
    pub sigma_px: f32,
    /// Standard deviation of the image's noise.
    pub noise_std: f32,
    /// Share of the patterns that were shown.
    pub sampling: f32,
    /// Depth beside it, if there is any.
    pub depth: Option<Depth>,
}

/// An 8 x 8 depth map.
#[derive(Debug, Clone, PartialEq)]
pub struct Depth {
    /// Metres, row-major; anything where there is none.
    pub metres: [f32; DEPTH_SIDE * DEPTH_SIDE],
    /// Whether the zone gave a distance.
    pub valid: [bool; DEPTH_SIDE * DEPTH_SIDE],
}

/// Something that takes pictures of scenes.
pub trait Degrade: Sync {
    /// A picture of `scene`, 64 x 64 values in `[0, 1]`.
    ///
    /// # Errors
    /// [`DegradeError`] if no picture can be taken.
    fn degrade(&self, scene: &[f32], rng: &mut Pcg64Mcg) -> Result<Reading, DegradeError>;
}

/// Why a scene could not be degraded. `Display` is one line.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum DegradeError {
    /// The scene is not 64 x 64.
    #[error("a scene of {found} pixels, expected 64 x 64")]
    Shape {
        /// Its pixels.
        found: usize,
    },
    /// A limit is no range of numbers that can be.
    #[error("{name} from {from} to {to}, expected {expected}")]
    Limit {
        /// Which.
        name: &'static str,
        /// Lower end, as text.
        from: String,
        /// Upper end.
        to: String,
        /// What it may be.
        expected: &'static str,
    },
    /// A simulated camera refused.
    #[error("{0}")]
    Camera(String),
}

/// The scene averaged over squares of 2 x 2 pixels.
#[must_use]
pub fn sampled(scene: &[f32]) -> Vec<f32> {
    let at = |row: usize, column: usize| scene[row * SIDE_PX + column];
    (0..READING_PX * READING_PX)
        .map(|pixel| {
            let (row, column) = (2 * (pixel / READING_PX), 2 * (pixel % READING_PX));
            let sum = at(row, column)
                + at(row, column + 1)
                + at(row + 1, column)
                + at(row + 1, column + 1);
            sum / 4.0
        })
        .collect()
}
