//! Classical deblurring without learning: the baselines that every network has to beat.
//!
//! Three methods remove a Gaussian blur of known width from an image with white noise of known
//! strength: [`wiener`] (linear, one transform), [`richardson_lucy`] (multiplicative, stays
//! positive) and [`total_variation`] (edges). Blur and noise are true values or estimates. All
//! other parameters follow from them, so no result is tuned to a picture.
//!
//! # Invariant
//! An image without blur and noise comes back unchanged
//! (`tests::what_nothing_has_touched_comes_back_as_it_was`).

mod estimated;
pub mod richardson_lucy;
pub mod total_variation;
pub mod wiener;

pub use crate::blur::Blur;
pub use estimated::deblur_all;

use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// A classical deblurring method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// [`wiener`].
    Wiener,
    /// [`richardson_lucy`].
    RichardsonLucy,
    /// [`total_variation`].
    TotalVariation,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 3] = [Self::Wiener, Self::RichardsonLucy, Self::TotalVariation];

    /// The method's name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Wiener => "wiener",
            Self::RichardsonLucy => "rl",
            Self::TotalVariation => "tv",
        }
    }
}

impl Method {
    /// One line about the method.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::Wiener => "Wiener's filter",
            Self::RichardsonLucy => "Richardson-Lucy deconvolution",
            Self::TotalVariation => "Deconvolution with least total variation",
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Method {
    type Err = ClassicalError;

    fn from_str(found: &str) -> Result<Self, ClassicalError> {
        let named = Self::ALL.into_iter().find(|method| method.name() == found);
        named.ok_or_else(|| ClassicalError::Method { found: found.to_owned() })
    }
}

/// Why a stack of images cannot be deblurred.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ClassicalError {
    /// No method has this name.
    #[error("method \"{found}\", expected wiener, rl or tv")]
    Method {
        /// The name that was given.
        found: String,
    },
    /// The values are not a whole number of images with at least one pixel.
    #[error("deblur: {found} values, expected whole images of {height} x {width}, at least one")]
    Shape {
        /// Number of values given.
        found: usize,
        /// Rows of an image.
        height: usize,
        /// Columns of an image.
        width: usize,
    },
    /// A pixel is not in [0, 1].
    #[error("deblur: image {image}, row {row}, column {column} is {value}, expected 0 to 1")]
    Pixel {
        /// Index of the image.
        image: usize,
        /// Row from the top.
        row: usize,
        /// Column from the left.
        column: usize,
        /// The value found.
        value: f32,
    },
    /// The blur is not a width, or is wider than the image.
    #[error("deblur: a blur of sigma {found} px, expected 0 to {most}")]
    Sigma {
        /// The value that was given.
        found: f32,
        /// The longer edge of the image.
        most: usize,
    },
    /// The noise is not a standard deviation of pixels in [0, 1].
    #[error("deblur: noise of {found}, expected 0 to 1")]
    Noise {
        /// The value that was given.
        found: f32,
    },
}

/// Smallest noise that is used, in the image's units. Smaller differences are rounding, and
/// dividing them by a blur's small factor for a fine wave would turn them into a picture.
const LEAST_NOISE: f32 = 1e-4;

/// Removes a Gaussian blur of standard deviation `sigma_px` from each image of a stack (N,
/// `height`, `width`), row-major, with pixels in [0, 1] and white noise of standard deviation
/// `noise`. With `sigma_px` 0 only the noise is reduced. Returns pixels in [0, 1] in the same
/// layout.
///
/// # Errors
/// [`ClassicalError`] if the values are not whole images, a pixel is NaN or outside [0, 1], or the
/// blur or the noise is out of range.
pub fn deblur(
    method: Method,
    stack: &[f32],
    (height, width): (usize, usize),
    sigma_px: f32,
    noise: f32,
) -> Result<Vec<f32>, ClassicalError> {
    let shape = ClassicalError::Shape { found: stack.len(), height, width };
    let pixels = height.checked_mul(width).filter(|&pixels| pixels > 0).ok_or(shape.clone())?;
    if stack.is_empty() || !stack.len().is_multiple_of(pixels) {
        return Err(shape);
    }
    if let Some(at) = stack.iter().position(|v| !(0.0..=1.0).contains(v)) {
        let (image, pixel) = (at / pixels, at % pixels);
        let (row, column) = (pixel / width, pixel % width);
        return Err(ClassicalError::Pixel { image, row, column, value: stack[at] });
    }
    let most = height.max(width);
    if !(0.0..=most as f32).contains(&sigma_px) {
        return Err(ClassicalError::Sigma { found: sigma_px, most });
    }
    if !(0.0..=1.0).contains(&noise) {
        return Err(ClassicalError::Noise { found: noise });
    }
    if sigma_px == 0.0 && noise == 0.0 {
        return Ok(stack.to_vec());
    }
    let (blur, noise) = (Blur::new(height, width, sigma_px), noise.max(LEAST_NOISE));
    let one = |image: &[f32]| match method {
        Method::Wiener => wiener::deblur(image, &blur, noise),
        Method::RichardsonLucy => richardson_lucy::deblur(image, &blur, noise),
        Method::TotalVariation => total_variation::deblur(image, &blur, noise),
    };
    Ok(stack.chunks_exact(pixels).flat_map(one).map(|pixel| pixel.clamp(0.0, 1.0)).collect())
}

/// The squared residual that noise alone explains: `noise`^2 for each pixel that can show its
/// noise. Clipped pixels (0 or 1) have lost theirs and do not count.
fn noise_budget(image: &[f32], noise: f32) -> f32 {
    let free = image.iter().filter(|&&pixel| pixel > 0.0 && pixel < 1.0).count();
    noise * noise * free.max(1) as f32
}

#[cfg(test)]
mod tests;
