//! The flat field: the brightness of each LED, the dead LEDs, and the reading of each pixel without
//! light.
//!
//! Unequal LEDs, vignetting lenses and dead LEDs leave the same pattern in every image. A pixel of
//! a reconstructed image is linear in the light of its own LED, so the pattern is removed after
//! reconstruction: `(pixel - dark) / gain`. A dead LED gives no information about its pixel, which
//! becomes the mean of its nearest live neighbours.
//!
//! Gain belongs to the LED array and the lens, so a flat field holds at any distance, for any
//! scene, order of patterns and method. A flat field is measured against a white sheet that fills
//! the field (`nirspi camera calibrate --white`), kept by serial number next to the calibration, and
//! applied by `capture --picture`, `serve` and `reconstruct`.
//!
//! # Invariant
//! A corrected image of the white sheet is white: the remaining pattern is at least ten times
//! smaller with LEDs that differ by 10 % (`a_flat_field_takes_the_pattern_of_unequal_leds_away` in
//! `host/virtual/tests/flat_field.rs`).

mod kept;
mod measured;

pub use kept::KeptFlatField;
pub use measured::{Measured, Sweeps};

use nirspi_recon::{Image, Side};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Number of pixels of the instrument's image, and of LEDs of its array.
const PIXELS: usize = Side::INSTRUMENT.area();
/// An LED with less than this share of the median light counts as dead.
const DEAD_BELOW: f32 = 0.2;
/// A reading in the dark below this many standard deviations of noise counts as 0.
const SIGMA: f32 = 4.0;

/// Gain, dark frame and dead LEDs of a camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Frames", into = "Frames")]
pub struct FlatField {
    frames: Frames,
    /// Light of each LED divided by the mean of the live LEDs; 0 for a dead LED.
    gain: Vec<f32>,
}

/// The measured frames as kept in the file. Images are row-major, 32 x 32, in ADC counts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Frames {
    /// The image of a white sheet.
    white_counts: Vec<f32>,
    /// The rms noise of one pixel of the white image.
    white_noise_counts: f32,
    /// The image with the lens covered; `None` if not measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    dark_counts: Option<Vec<f32>>,
    /// Row and column of each dead LED, 0 to 31. Dead LEDs are found again when the frames are
    /// read.
    dead_leds: Vec<[u8; 2]>,
}

/// Why frames do not give a flat field. `Display` is one line.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum FramesError {
    /// A frame is not of the instrument's size.
    #[error("{name} holds {found} pixels, expected {PIXELS}")]
    Length {
        /// The name of the frame.
        name: &'static str,
        /// Its number of pixels.
        found: usize,
    },
    /// A pixel is NaN or infinite.
    #[error("{name}[{at}] is {found}, expected a finite number")]
    NotFinite {
        /// The name of the frame.
        name: &'static str,
        /// The index of the pixel.
        at: usize,
        /// The value.
        found: f32,
    },
    /// The sheet reflects no light in most of the field.
    #[error(
        "the white sheet shows in {live} of {PIXELS} pixels, expected at least {least}: hold it so that it fills the field",
        least = PIXELS * 3 / 4
    )]
    NotFilled {
        /// Number of pixels with light.
        live: usize,
    },
}

impl TryFrom<Frames> for FlatField {
    type Error = FramesError;

    fn try_from(frames: Frames) -> Result<Self, FramesError> {
        finite("white_counts", &frames.white_counts)?;
        let (name, found) = ("white_noise_counts", frames.white_noise_counts);
        if !found.is_finite() {
            return Err(FramesError::NotFinite { name, at: 0, found });
        }
        frames.dark_counts.as_deref().map_or(Ok(()), |dark| finite("dark_counts", dark))?;
        let light: Vec<f32> = match &frames.dark_counts {
            Some(dark) => frames.white_counts.iter().zip(dark).map(|(w, d)| w - d).collect(),
            None => frames.white_counts.clone(),
        };
        let median = median(&light);
        let live = |value: f32| median > 0.0 && value > DEAD_BELOW * median;
        let shining: Vec<f32> = light.iter().copied().filter(|&value| live(value)).collect();
        if shining.len() < PIXELS * 3 / 4 {
            return Err(FramesError::NotFilled { live: shining.len() });
        }
        let mean = shining.iter().sum::<f32>() / shining.len() as f32;
        let gain: Vec<f32> =
            light.iter().map(|&value| if live(value) { value / mean } else { 0.0 }).collect();
        let side = Side::INSTRUMENT.pixels();
        let dead_leds = (0..PIXELS)
            .filter(|&at| gain[at] == 0.0)
            .map(|at| [(at / side) as u8, (at % side) as u8])
            .collect();
        Ok(Self { frames: Frames { dead_leds, ..frames }, gain })
    }
}

impl From<FlatField> for Frames {
    fn from(flat: FlatField) -> Self {
        flat.frames
    }
}

fn finite(name: &'static str, frame: &[f32]) -> Result<(), FramesError> {
    if frame.len() != PIXELS {
        return Err(FramesError::Length { name, found: frame.len() });
    }
    match frame.iter().position(|value| !value.is_finite()) {
        Some(at) => Err(FramesError::NotFinite { name, at, found: frame[at] }),
        None => Ok(()),
    }
}

fn median(values: &[f32]) -> f32 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f32::total_cmp);
    sorted[sorted.len() / 2]
}

impl FlatField {
    /// A flat field from an image of a white sheet that fills the field, 32 x 32, and the rms noise
    /// of one of its pixels.
    ///
    /// # Errors
    /// [`FramesError`] if the image does not have the instrument's size or is not that of a white
    /// sheet.
    pub fn of_white(white: &Image, noise: f32) -> Result<Self, FramesError> {
        let white_counts = white.pixels().to_vec();
        let (dark_counts, dead_leds) = (None, Vec::new());
        Frames { white_counts, white_noise_counts: noise, dark_counts, dead_leds }.try_into()
    }

    /// The same flat field with a dark frame: an image taken with the lens covered, and the rms
    /// noise of one of its pixels. Pixels that read no more than their noise count as 0, so that a
    /// camera without a pattern in the dark gets no noise from the dark frame.
    ///
    /// # Errors
    /// [`FramesError`] if the image does not have the instrument's size, or is brighter than the
    /// white sheet.
    pub fn with_dark(self, dark: &Image, noise: f32) -> Result<Self, FramesError> {
        let reading = |&value: &f32| if value.abs() > SIGMA * noise { value } else { 0.0 };
        let dark_counts = Some(dark.pixels().iter().map(reading).collect());
        Frames { dark_counts, ..self.frames }.try_into()
    }

    /// Light of each LED divided by the mean of the live LEDs, row-major; 0 where an image takes the mean of the neighbours.
    #[must_use]
    pub fn gain(&self) -> &[f32] {
        &self.gain
    }

    /// Row and column of each dead LED, 0 to 31.
    #[must_use]
    pub fn dead_leds(&self) -> &[[u8; 2]] {
        &self.frames.dead_leds
    }

    /// Number of pixels with a reading in the dark; `None` if the dark was not measured.
    #[must_use]
    pub fn dark_pixels(&self) -> Option<usize> {
        let dark = self.frames.dark_counts.as_ref()?;
        Some(dark.iter().filter(|&&value| value != 0.0).count())
    }

    /// The image of a camera, corrected by the flat field that is kept for it, if there is one. Every
    /// command that makes an image of a camera's frames calls this function.
    #[must_use]
    pub fn corrected(kept: Option<&Self>, image: Image) -> Image {
        match kept {
            Some(flat) => flat.correct(&image),
            None => image,
        }
    }

    /// Corrects an image, as if all LEDs were equal. An image of another size does not come from
    /// this array and stays unchanged.
    #[must_use]
    pub fn correct(&self, image: &Image) -> Image {
        if image.side() != Side::INSTRUMENT {
            return image.clone();
        }
        let dark = |at: usize| self.frames.dark_counts.as_ref().map_or(0.0, |dark| dark[at]);
        let mut pixels: Vec<f32> = image
            .pixels()
            .iter()
            .zip(&self.gain)
            .enumerate()
            .map(|(at, (value, gain))| if *gain > 0.0 { (value - dark(at)) / gain } else { 0.0 })
            .collect();
        let side = image.side().pixels();
        for at in (0..PIXELS).filter(|&at| self.gain[at] == 0.0) {
            pixels[at] = self.around(&pixels, at / side, at % side);
        }
        Image::new(image.side(), pixels)
    }

    /// Mean of the nearest live pixels around a pixel.
    fn around(&self, pixels: &[f32], row: usize, column: usize) -> f32 {
        let side = Side::INSTRUMENT.pixels();
        for reach in 1..side {
            let near = |at: usize| at.saturating_sub(reach)..(at + reach + 1).min(side);
            let live: Vec<f32> = near(row)
                .flat_map(|y| near(column).map(move |x| y * side + x))
                .filter(|&at| self.gain[at] > 0.0)
                .map(|at| pixels[at])
                .collect();
            if !live.is_empty() {
                return live.iter().sum::<f32>() / live.len() as f32;
            }
        }
        0.0
    }
}

/// The fixed pattern in two images of the same white sheet: standard deviation divided by mean. The
/// pattern's variance is the covariance of the two images, so noise, which differs from image to
/// image, does not contribute.
#[must_use]
pub fn pattern_noise(a: &Image, b: &Image) -> f64 {
    let mean = |image: &Image| {
        image.pixels().iter().map(|&v| f64::from(v)).sum::<f64>() / image.pixels().len() as f64
    };
    let (mean_a, mean_b) = (mean(a), mean(b));
    let products = a.pixels().iter().zip(b.pixels());
    let covariance =
        products.map(|(&a, &b)| (f64::from(a) - mean_a) * (f64::from(b) - mean_b)).sum::<f64>()
            / a.pixels().len() as f64;
    covariance.max(0.0).sqrt() / ((mean_a + mean_b) / 2.0).abs()
}

#[cfg(test)]
mod tests;
