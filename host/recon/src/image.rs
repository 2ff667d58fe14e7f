//! A square grey image, row-major.

use crate::Side;

/// An `n x n` image of reflectance in the measurement's own units (not scaled to `[0, 1]`),
/// row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    side: Side,
    pixels: Vec<f32>,
}

impl Image {
    /// Wraps row-major pixels.
    ///
    /// # Panics
    /// If the length of `pixels` is not `side * side`.
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

    /// Row-major pixels: `side * side` values.
    #[must_use]
    pub fn pixels(&self) -> &[f32] {
        &self.pixels
    }

    /// The magnitude of a complex image, pixel by pixel.
    ///
    /// # Panics
    /// If the two parts differ in side: the caller made both from one measurement.
    #[must_use]
    pub fn magnitude(real: &Self, imaginary: &Self) -> Self {
        assert_eq!(real.side, imaginary.side, "the parts of one image");
        let parts = real.pixels.iter().zip(&imaginary.pixels);
        Self { side: real.side, pixels: parts.map(|(re, im)| re.hypot(*im)).collect() }
    }
}
