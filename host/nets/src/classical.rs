//! Deblurring without learning anything: the rows that every network has to beat.
//!
//! Three methods undo a Gaussian blur of known width from an image with white noise of known strength: [`wiener`]
//! (linear, one transform), [`richardson_lucy`] (multiplicative, stays positive) and [`total_variation`] (edges). Each
//! is told the truth or an estimate of it, and sets everything else by itself, so that no row is tuned to a picture.
//!
//! The law: what no blur and no noise has touched comes back as it was.

pub mod richardson_lucy;
pub mod total_variation;
pub mod wiener;

pub use crate::blur::Blur;

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
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Wiener, Self::RichardsonLucy, Self::TotalVariation];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Wiener => "wiener",
            Self::RichardsonLucy => "rl",
            Self::TotalVariation => "tv",
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
pub enum ClassicalError {
    /// No such method.
    #[error("method \"{found}\", expected wiener, rl or tv")]
    Method {
        /// What was asked for.
        found: String,
    },
    /// The stack is no whole number of images of at least one pixel.
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
    /// The blur is no width, or wider than the image.
    #[error("deblur: a blur of sigma {found} px, expected 0 to {most}")]
    Sigma {
        /// What was given.
        found: f32,
        /// The longer edge of the image.
        most: usize,
    },
    /// The noise is no standard deviation of pixels in [0, 1].
    #[error("deblur: noise of {found}, expected 0 to 1")]
    Noise {
        /// What was given.
        found: f32,
    },
}

/// Least noise that is reckoned with, in the image's units: finer differences are rounding, and dividing them by what
/// a blur has left of a fine wave would make a picture of them.
const LEAST_NOISE: f32 = 1e-4;

/// Undoes a Gaussian blur of standard deviation `sigma_px` (0: none, then the noise alone is reduced) in each image of
/// a stack (N, `height`, `width`), row-major, pixels in [0, 1], with white noise of standard deviation `noise`. Pixels
/// in [0, 1] in the same layout.
///
/// # Errors
/// [`ClassicalError`] if the values are no whole images, a pixel is NaN or outside [0, 1], or the blur or the noise is
/// out of range.
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

/// The squared residual that noise alone explains: `noise`^2 for each pixel that could show it. What a clipped pixel
/// (0 or 1) has lost of its noise cannot be counted on.
fn noise_budget(image: &[f32], noise: f32) -> f32 {
    let free = image.iter().filter(|&&pixel| pixel > 0.0 && pixel < 1.0).count();
    noise * noise * free.max(1) as f32
}

#[cfg(test)]
mod tests;
