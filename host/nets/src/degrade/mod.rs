//! Degrades a sharp scene as a camera does, to make training pairs.
//!
//! Every degradation reports its blur and noise, because networks need both. Random numbers come
//! only from the generator passed as an argument.
//!
//! [`AnalyticCamera`] uses formulas alone and is fast. Another crate simulates a camera from light
//! to frames, and implements [`Degrade`] too.

mod analytic;
pub mod defocus;

pub use analytic::{AnalyticCamera, Limits};

use crate::data::SIDE_PX;
use rand_pcg::Pcg64Mcg;
use thiserror::Error;

/// Side of the camera's reading, in pixels.
pub const READING_PX: usize = crate::fusion::SIDE;
/// Number of zones along one edge of a depth map.
pub const DEPTH_SIDE: usize = 8;

/// One scene as a camera reads it.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// 32 x 32 values in `[0, 1]`, row-major: 1 is what a white target gives.
    pub image: Vec<f32>,
    /// The scene after the optics, 64 x 64: blurred, before sampling and noise.
    pub optical: Vec<f32>,
    /// Standard deviation of the blur in pixels of the 64 x 64 grid.
    pub sigma_px: f32,
    /// Standard deviation of the image's noise.
    pub noise_std: f32,
    /// Share of the patterns that were shown.
    pub sampling: f32,
    /// Depth of the scene, if there is any.
    pub depth: Option<Depth>,
}

/// An 8 x 8 depth map.
#[derive(Debug, Clone, PartialEq)]
pub struct Depth {
    /// Distances in metres, row-major; undefined in zones without a distance.
    pub metres: [f32; DEPTH_SIDE * DEPTH_SIDE],
    /// Whether the zone has a distance.
    pub valid: [bool; DEPTH_SIDE * DEPTH_SIDE],
}

/// A camera that takes pictures of scenes.
pub trait Degrade: Sync {
    /// A picture of `scene`, 64 x 64 values in `[0, 1]`.
    ///
    /// # Errors
    /// [`DegradeError`] if the camera can take no picture.
    fn degrade(&self, scene: &[f32], rng: &mut Pcg64Mcg) -> Result<Reading, DegradeError>;
}

/// Why a scene cannot be degraded. `Display` is one line.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum DegradeError {
    /// The scene is not 64 x 64.
    #[error("a scene of {found} pixels, expected 64 x 64")]
    Shape {
        /// Number of its pixels.
        found: usize,
    },
    /// A limit is not a valid range.
    #[error("{name} from {from} to {to}, expected {expected}")]
    Limit {
        /// Name of the limit.
        name: &'static str,
        /// Lower end, as text.
        from: String,
        /// Upper end.
        to: String,
        /// The accepted range.
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
