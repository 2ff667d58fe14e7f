//! How close an image comes to what it shows.

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
    /// Pearson's correlation, which needs no fit; none of a flat image.
    pub correlation: Option<f64>,
}

/// An image in ADC counts, brought to the reference's scale by the gain and offset of least squares. A
/// single-pixel camera has no absolute scale: illumination and gain are not known to it.
pub struct Fitted {
    /// The image on the reference's scale, clamped to `[0, 1]`.
    pub values: Vec<f32>,
    /// Its quality.
    pub quality: Quality,
}

/// Fits `image` to `reference`, of the same size, and compares.
pub fn compare(image: &Image, reference: &[f32]) -> Result<Fitted, MetricError> {
    let n = reference.len() as f64;
    let mean = |values: &[f32]| values.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
    let (mx, my) = (mean(image.pixels()), mean(reference));
    let (mut xx, mut xy) = (0.0, 0.0);
    for (&x, &y) in image.pixels().iter().zip(reference) {
        let x = f64::from(x) - mx;
        xx += x * x;
        xy += x * (f64::from(y) - my);
    }
    let gain = if xx > 0.0 { xy / xx } else { 0.0 };
    let fit = |x: &f32| ((f64::from(*x) - mx) * gain + my).clamp(0.0, 1.0) as f32;
    let values: Vec<f32> = image.pixels().iter().map(fit).collect();
    let side = image.side().pixels();
    let quality = Quality {
        psnr_db: metrics::psnr(reference, &values, side, side, 1.0)?,
        ssim: metrics::ssim(reference, &values, side, side, 1.0)?,
        correlation: match metrics::correlation(reference, image.pixels(), side, side) {
            Err(MetricError::Flat { .. }) => None,
            other => Some(other?),
        },
    };
    Ok(Fitted { values, quality })
}
