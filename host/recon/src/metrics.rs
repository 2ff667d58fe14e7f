//! Compares two images by a number.
//!
//! # Invariant
//! A number is returned only where it is defined: images of different shapes, values that are not
//! finite, and images too small for the window are errors, never a NaN
//! (`tests::what_is_not_defined_is_an_error`).
//!
//! [`ssim`] follows Z. Wang et al., *Image quality assessment: from error visibility to structural
//! similarity* (2004), with the window of their reference code: an 11-pixel Gaussian, population
//! covariance, averaged over the pixels whose whole window lies in the image. Its results are those
//! of scikit-image's
//! `structural_similarity(gaussian_weights=True, sigma=1.5, use_sample_covariance=False)`
//! (`tests::numbers_are_those_of_scikit_image`).

use thiserror::Error;

/// Why no metric is defined for two images.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum MetricError {
    /// A slice is not `width * height` long.
    #[error("the {which} image has {found} pixels, expected {width} x {height}")]
    Shape {
        /// `reference` or `test`.
        which: &'static str,
        /// Number of its pixels.
        found: usize,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// A pixel is NaN or infinite.
    #[error("pixel {index} of the {which} image is {found}, expected a finite number")]
    NotFinite {
        /// `reference` or `test`.
        which: &'static str,
        /// Index of the pixel, row-major.
        index: usize,
        /// The pixel's value.
        found: f32,
    },
    /// The image is smaller than the window, or empty.
    #[error("an image of {width} x {height} pixels, expected at least {least} x {least}")]
    TooSmall {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Least columns and rows.
        least: usize,
    },
    /// The span of values is not a positive number.
    #[error("a data range of {found}, expected a positive finite number")]
    DataRange {
        /// The span that was given.
        found: f64,
    },
    /// An image of one value has no correlation.
    #[error("the {which} image is flat: correlation is not defined")]
    Flat {
        /// `reference` or `test`.
        which: &'static str,
    },
}

/// Two images that can be compared, row-major.
struct Pair<'a> {
    reference: &'a [f32],
    test: &'a [f32],
    width: usize,
    height: usize,
}

impl<'a> Pair<'a> {
    fn new(
        reference: &'a [f32],
        test: &'a [f32],
        width: usize,
        height: usize,
        least: usize,
    ) -> Result<Self, MetricError> {
        for (which, image) in [("reference", reference), ("test", test)] {
            if Some(image.len()) != width.checked_mul(height) {
                return Err(MetricError::Shape { which, found: image.len(), width, height });
            }
            if let Some(index) = image.iter().position(|p| !p.is_finite()) {
                return Err(MetricError::NotFinite { which, index, found: image[index] });
            }
        }
        if width < least || height < least {
            return Err(MetricError::TooSmall { width, height, least });
        }
        Ok(Self { reference, test, width, height })
    }

    fn pixels(&self) -> impl Iterator<Item = (f64, f64)> + Clone + '_ {
        self.reference.iter().zip(self.test).map(|(&r, &t)| (f64::from(r), f64::from(t)))
    }
}

/// Peak signal-to-noise ratio in dB, `10 log10(data_range^2 / mean squared error)`; infinite for
/// equal images. Both images are `width x height`, row-major.
///
/// # Errors
/// [`MetricError`] if a length is wrong, a value is not finite, there are no pixels, or
/// `data_range` is not positive.
pub fn psnr(
    reference: &[f32],
    test: &[f32],
    width: usize,
    height: usize,
    data_range: f64,
) -> Result<f64, MetricError> {
    let pair = Pair::new(reference, test, width, height, 1)?;
    check_data_range(data_range)?;
    let squared: f64 = pair.pixels().map(|(r, t)| (r - t).powi(2)).sum();
    Ok(10.0 * (data_range.powi(2) * reference.len() as f64 / squared).log10())
}

/// Pearson correlation of the pixels, -1 to 1. Brightness and contrast do not change it. Both
/// images are `width x height`, row-major.
///
/// # Errors
/// [`MetricError`] if a length is wrong, a value is not finite, there are no pixels, or an image is
/// flat.
pub fn correlation(
    reference: &[f32],
    test: &[f32],
    width: usize,
    height: usize,
) -> Result<f64, MetricError> {
    let pair = Pair::new(reference, test, width, height, 1)?;
    let count = reference.len() as f64;
    let (r_sum, t_sum) = pair.pixels().fold((0.0, 0.0), |(a, b), (r, t)| (a + r, b + t));
    let (r_mean, t_mean) = (r_sum / count, t_sum / count);
    let (mut rr, mut tt, mut rt) = (0.0, 0.0, 0.0);
    for (r, t) in pair.pixels().map(|(r, t)| (r - r_mean, t - t_mean)) {
        rr += r * r;
        tt += t * t;
        rt += r * t;
    }
    for (which, image) in [("reference", reference), ("test", test)] {
        if image.iter().all(|&p| p == image[0]) {
            return Err(MetricError::Flat { which });
        }
    }
    Ok((rt / (rr.sqrt() * tt.sqrt())).clamp(-1.0, 1.0))
}

/// Pixels from the middle of the window to its edge: 3.5 sigma, so 11 pixels in all.
const WINDOW_RADIUS: usize = 5;
const WINDOW: usize = 2 * WINDOW_RADIUS + 1;
const WINDOW_SIGMA: f64 = 1.5;
const K1: f64 = 0.01;
const K2: f64 = 0.03;

/// Structural similarity, at most 1. Both images are `width x height`, row-major, of values that
/// span `data_range`.
///
/// # Errors
/// [`MetricError`] if a length is wrong, a value is not finite, an image is smaller than the 11 x
/// 11 window, or `data_range` is not positive.
pub fn ssim(
    reference: &[f32],
    test: &[f32],
    width: usize,
    height: usize,
    data_range: f64,
) -> Result<f64, MetricError> {
    let pair = Pair::new(reference, test, width, height, WINDOW)?;
    check_data_range(data_range)?;
    let local_mean =
        |value: fn((f64, f64)) -> f64| smoothed(pair.pixels().map(value), pair.width, pair.height);
    let means = local_mean(|(r, _)| r).zip(local_mean(|(_, t)| t));
    let squares = local_mean(|(r, _)| r * r).zip(local_mean(|(_, t)| t * t));
    let products = local_mean(|(r, t)| r * t);
    let (c1, c2) = ((K1 * data_range).powi(2), (K2 * data_range).powi(2));
    let (mut sum, mut count) = (0.0, 0.0);
    for (((r, t), (rr, tt)), rt) in means.zip(squares).zip(products) {
        let variances = (rr - r * r) + (tt - t * t);
        let covariance = rt - r * t;
        sum += (2.0 * r * t + c1) * (2.0 * covariance + c2)
            / ((r * r + t * t + c1) * (variances + c2));
        count += 1.0;
    }
    Ok(sum / count)
}

/// Gaussian means of every whole window, row-major.
fn smoothed(
    image: impl Iterator<Item = f64>,
    width: usize,
    height: usize,
) -> impl Iterator<Item = f64> {
    let kernel = gaussian();
    let image: Vec<f64> = image.collect();
    let columns = width - 2 * WINDOW_RADIUS;
    let across: Vec<f64> = image
        .chunks_exact(width)
        .flat_map(|row| {
            row.windows(WINDOW).map(|w| w.iter().zip(&kernel).map(|(p, k)| p * k).sum())
        })
        .collect();
    (0..height - 2 * WINDOW_RADIUS).flat_map(move |r| {
        let down = |c: usize| {
            kernel.iter().enumerate().map(|(i, k)| k * across[(r + i) * columns + c]).sum::<f64>()
        };
        (0..columns).map(down).collect::<Vec<_>>()
    })
}

fn gaussian() -> [f64; WINDOW] {
    let weight = |i: usize| {
        let x = i as f64 - WINDOW_RADIUS as f64;
        (-x * x / (2.0 * WINDOW_SIGMA * WINDOW_SIGMA)).exp()
    };
    let kernel: [f64; WINDOW] = std::array::from_fn(weight);
    let total: f64 = kernel.iter().sum();
    kernel.map(|k| k / total)
}

fn check_data_range(found: f64) -> Result<(), MetricError> {
    if found > 0.0 && found.is_finite() { Ok(()) } else { Err(MetricError::DataRange { found }) }
}

#[cfg(test)]
mod tests;
