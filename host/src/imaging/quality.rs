//! The quality of an image against a reference.

use nirspi_recon::Image;
use nirspi_recon::metrics::{self, MetricError};
use serde::Serialize;

/// Quality against a reference in `[0, 1]`.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Quality {
    /// Peak signal-to-noise ratio, data range 1.
    pub psnr_db: f64,
    /// Structural similarity, Gaussian window of 11 px.
    pub ssim: f64,
    /// Pearson's correlation of the image itself, which needs no fit; `None` for a flat image.
    pub correlation: Option<f64>,
    /// Whether the image is darker where the reference is brighter. An inverted image is wrong, not
    /// dim, so it is scored as a blank image.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub inverted: bool,
}

/// An image in ADC counts, scaled to the reference by the gain and offset of least squares. A
/// single-pixel camera has no absolute scale, because it knows neither illumination nor gain.
///
/// # Invariant
/// The gain is never negative: a fit must not turn a wrong picture into a right one
/// (`tests::an_inverted_image_is_scored_as_blank`).
#[derive(Debug)]
pub struct Fitted {
    /// The image on the reference's scale, clamped to `[0, 1]`; flat if the image is inverted.
    pub values: Vec<f32>,
    /// Its quality.
    pub quality: Quality,
}

/// The gain and offset of least squares that scale an image to a reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Gain, 0 or more.
    pub gain: f64,
    /// The offset, added after the gain.
    pub offset: f64,
    /// Whether the image is darker where the reference is brighter. The gain is then 0.
    pub inverted: bool,
}

impl Fit {
    /// Fits pixels to a reference with the same number of pixels.
    #[must_use]
    pub fn of(image: &[f32], reference: &[f32]) -> Self {
        let n = reference.len() as f64;
        let mean = |values: &[f32]| values.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
        let (mx, my) = (mean(image), mean(reference));
        let (mut xx, mut xy) = (0.0, 0.0);
        for (&x, &y) in image.iter().zip(reference) {
            let x = f64::from(x) - mx;
            xx += x * x;
            xy += x * (f64::from(y) - my);
        }
        let inverted = xy < 0.0;
        let gain = if xx > 0.0 && !inverted { xy / xx } else { 0.0 };
        Self { gain, offset: my - gain * mx, inverted }
    }

    /// A pixel on the reference's scale.
    #[must_use]
    pub fn apply(&self, pixel: f32) -> f32 {
        (f64::from(pixel) * self.gain + self.offset) as f32
    }
}

/// Fits `image` to `reference` of the same size, and compares them.
///
/// # Errors
/// [`MetricError`] if the sizes differ, or a value is NaN or infinite.
pub fn compare(image: &Image, reference: &[f32]) -> Result<Fitted, MetricError> {
    let fit = Fit::of(image.pixels(), reference);
    let inverted = fit.inverted;
    let values: Vec<f32> =
        image.pixels().iter().map(|&pixel| fit.apply(pixel).clamp(0.0, 1.0)).collect();
    let side = image.side().pixels();
    let quality = Quality {
        psnr_db: metrics::psnr(reference, &values, side, side, 1.0)?,
        ssim: metrics::ssim(reference, &values, side, side, 1.0)?,
        correlation: match metrics::correlation(reference, image.pixels(), side, side) {
            Err(MetricError::Flat { .. }) => None,
            other => Some(other?),
        },
        inverted,
    };
    Ok(Fitted { values, quality })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_recon::Side;

    fn half() -> Vec<f32> {
        (0..256).map(|at| if at % 16 < 8 { 0.2 } else { 0.9 }).collect()
    }

    #[test]
    fn gain_and_offset_do_not_matter() {
        let image = half().iter().map(|v| 700.0 * v - 40.0).collect();
        let fitted = compare(&Image::new(Side::new(16).unwrap(), image), &half()).unwrap();
        assert!(fitted.quality.psnr_db > 90.0 && !fitted.quality.inverted);
    }

    #[test]
    fn an_inverted_image_is_scored_as_blank() {
        let side = Side::new(16).unwrap();
        let inverted = Image::new(side, half().iter().map(|v| -700.0 * v).collect());
        let blank = Image::new(side, vec![0.0; 256]);
        let (inverted, blank) =
            (compare(&inverted, &half()).unwrap(), compare(&blank, &half()).unwrap());
        assert!(inverted.quality.inverted && !blank.quality.inverted);
        assert_eq!(inverted.values, blank.values);
        assert_eq!(inverted.quality.psnr_db, blank.quality.psnr_db);
        assert!(inverted.quality.correlation.unwrap() < -0.99);
    }
}
