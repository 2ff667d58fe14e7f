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

    /// The image stretched to `[0, 1]` for display. The darkest and the brightest half per cent of
    /// the pixels saturate, so that a few outliers (for example the pixel that takes the offset of
    /// a non-differential measurement) do not reduce the contrast of the rest. A flat image becomes
    /// 0.
    #[must_use]
    pub fn stretched(&self) -> Self {
        let mut sorted = self.pixels.clone();
        sorted.sort_unstable_by(f32::total_cmp);
        let tail = sorted.len() / 200;
        let (low, high) = (sorted[tail], sorted[sorted.len() - 1 - tail]);
        let span = high - low;
        let scale = if span > 0.0 { 1.0 / span } else { 0.0 };
        let pixels = self.pixels.iter().map(|p| ((p - low) * scale).clamp(0.0, 1.0)).collect();
        Self { side: self.side, pixels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_outlier_does_not_grey_out_the_rest() {
        let side = Side::INSTRUMENT;
        let mut pixels: Vec<f32> = (0..1024).map(|p| (p % 32) as f32).collect();
        pixels[0] = 1e6;
        let shown = Image::new(side, pixels).stretched();
        assert_eq!((shown.pixels()[1], shown.pixels()[31]), (1.0 / 31.0, 1.0));
        assert_eq!(shown.pixels()[0], 1.0);
        assert!(Image::new(side, vec![3.0; 1024]).stretched().pixels().iter().all(|&p| p == 0.0));
    }
}
