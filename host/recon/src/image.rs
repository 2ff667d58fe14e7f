//! A square grey image, row-major.

use crate::Side;

/// An `n x n` image of reflectance in the measurement's own units (not scaled to `[0, 1]`), row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    side: Side,
    pixels: Vec<f32>,
}

impl Image {
    /// Wraps row-major pixels.
    ///
    /// # Panics
    /// If `pixels` is not `side * side` long: the caller made both.
    #[must_use]
    pub fn new(side: Side, pixels: Vec<f32>) -> Self {
        assert_eq!(pixels.len(), side.area(), "pixels of a {0} x {0} image", side.pixels());
        Self { side, pixels }
    }

    /// Side of the image.
    #[must_use]
    pub fn side(&self) -> Side {
        self.side
    }

    /// Row-major pixels, `side * side` of them.
    #[must_use]
    pub fn pixels(&self) -> &[f32] {
        &self.pixels
    }

    /// The image stretched to `[0, 1]` by its own minimum and maximum; a flat image becomes 0.
    #[must_use]
    pub fn stretched(&self) -> Self {
        let (low, high) = self
            .pixels
            .iter()
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &p| (l.min(p), h.max(p)));
        let span = high - low;
        let scale = if span > 0.0 { 1.0 / span } else { 0.0 };
        Self { side: self.side, pixels: self.pixels.iter().map(|p| (p - low) * scale).collect() }
    }
}
