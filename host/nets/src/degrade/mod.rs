//! A sharp scene as a camera reads it: one half of a training pair. The reading reports its blur
//! and noise, because networks need both. Another crate simulates the camera.

pub mod defocus;

/// Side of the camera's reading, in pixels.
pub const READING_PX: usize = crate::grid::COARSE;
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
