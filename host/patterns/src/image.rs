//! A grey image, row-major.

use crate::{Shape, Side, Size};

/// An image of reflectance in the measurement's own units (not scaled to `[0, 1]`), row-major: a
/// square by default, or an `Image<Size>` of any height and width.
#[derive(Debug, Clone, PartialEq)]
pub struct Image<S = Side> {
    shape: S,
    pixels: Vec<f32>,
}

impl<S: Shape> Image<S> {
    /// Wraps row-major pixels.
    ///
    /// # Panics
    /// If the length of `pixels` is not that of the shape.
    #[must_use]
    pub fn new(shape: S, pixels: Vec<f32>) -> Self {
        let size: Size = shape.into();
        assert_eq!(pixels.len(), size.area(), "pixels of a {size} image");
        Self { shape, pixels }
    }

    /// Height and width of the image.
    #[must_use]
    pub fn size(&self) -> Size {
        self.shape.into()
    }

    /// Row-major pixels: `height * width` values.
    #[must_use]
    pub fn pixels(&self) -> &[f32] {
        &self.pixels
    }
}

impl Image {
    /// Side of the image.
    #[must_use]
    pub fn side(&self) -> Side {
        self.shape
    }

    /// The magnitude of a complex image, pixel by pixel.
    ///
    /// # Panics
    /// If the two parts differ in side: the caller made both from one measurement.
    #[must_use]
    pub fn magnitude(real: &Self, imaginary: &Self) -> Self {
        assert_eq!(real.shape, imaginary.shape, "the parts of one image");
        let parts = real.pixels.iter().zip(&imaginary.pixels);
        Self { shape: real.shape, pixels: parts.map(|(re, im)| re.hypot(*im)).collect() }
    }
}
