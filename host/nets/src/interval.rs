//! Calibrated intervals: how far a pixel of an enhanced image may be from the truth.
//!
//! A half-width is read from a table, which was made from images that neither training nor judging
//! used. There is a table for each method of reconstruction. The table says how large the error was,
//! in 95 % of the pixels that look alike. Pixels look alike if the same error is expected from what
//! is known without the truth: the share of the patterns and the noise of the readings, the contrast
//! around the pixel, the change by deblurring, the estimated blur, and the texture of the image.
//!
//! The noise is that of the readings, which the camera knows from its sweeps. The noise that the
//! estimator finds in the image says nothing about the error of an image from which a method of
//! reconstruction has removed the noise.
//!
//! # Invariant
//! There is no interval outside of the calibration: other weights, another method, fewer patterns,
//! more noise, or readings of which nothing is known
//! (`tests::other_weights_get_no_interval_and_one_line_says_so`,
//! `tests::other_readings_get_no_interval_and_one_line_says_why`).

mod features;
mod table;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::choice::Networks;
use crate::deblur::Method;
use crate::enhance::{Enhanced, Options};
use crate::estimate::Estimate;
use crate::grid::AREA;
use crate::weights::{Weights, WeightsError};

pub use table::{FLOOR, LEVEL, LEVELS, Sample, Table, TableError, edges};

/// A half-width from which the interval says no more than that the pixel is somewhere between dark
/// and bright: the pixel is the prior's and not the data's.
pub const PRIORS_HALF_WIDTH: f32 = 0.25;

/// The networks whose weights decide about an enhanced image.
pub const NETWORKS: [&str; 3] = ["fsrcnn", "estimator", "diffusion"];

/// One enhanced image, as far as it is known without the truth.
#[derive(Debug, Clone, Copy)]
pub struct Seen<'a> {
    /// The enhanced image, 64 x 64 in [0, 1].
    pub image: &'a [f32],
    /// The image before deblurring, 64 x 64.
    pub fused: &'a [f32],
    /// Blur and noise, as used.
    pub estimate: Estimate,
    /// Inconsistency of the enhanced image.
    pub inconsistency: f32,
}

/// How the readings of an image were taken, and how the image was made of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Readings<'a> {
    /// The method of reconstruction, with its default settings: its word on the command line, for
    /// example `tikhonov`.
    pub method: &'a str,
    /// The share of the patterns that were measured, 0 to 1.
    pub share: f32,
    /// Standard deviation of the noise of a pixel of the plain transform of all patterns; white is 1.
    /// The noise of one reading (pattern minus complement) divided by 32, the side of the image.
    pub noise: f32,
}

/// The readings for which there are intervals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reach {
    /// The least share of the patterns.
    pub least_share: f32,
    /// The most noise of the readings.
    pub most_noise: f32,
}

/// A calibration and its origin: what the file of the calibration contains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// The command that made the file.
    pub made_by: String,
    /// Fingerprint of the weights of each network.
    pub weights: BTreeMap<String, String>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// The calibration images of each stack.
    pub stacks: Vec<CalibrationStack>,
    /// The conditions of the calibration images, in words.
    pub conditions: String,
    /// Number of enhanced images.
    pub images: usize,
    /// The readings for which there are intervals.
    pub reach: Reach,
    /// The table of errors for each method of reconstruction.
    pub methods: BTreeMap<String, Table>,
    /// The reading of characters.
    pub characters: crate::reading::ReadingScale,
}

/// The calibration images of one stack.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CalibrationStack {
    /// The stack's name.
    pub stack: String,
    /// The font families, writers or photographs.
    pub groups: Vec<u32>,
    /// Number of sharp images.
    pub images: usize,
}

/// Why there is no interval. `Display` is one line.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NoIntervals {
    /// The weights are not those of the calibration.
    #[error(
        "no intervals: the weights of {network} are not those that the intervals were calibrated for; \
         `cargo run --release -p nirspi-eval --example trust` calibrates others"
    )]
    OtherWeights {
        /// The network.
        network: String,
    },
    /// The network is not the calibrated one.
    #[error("no intervals: they are calibrated for {expected}, not for {found}")]
    OtherMethod {
        /// The calibrated network and steps.
        expected: &'static str,
        /// The network and steps.
        found: String,
    },
    /// Nothing is known of the readings.
    #[error(
        "no intervals: they need the method that made the image, the share of the patterns, and the noise of the readings \
         as the camera measured it"
    )]
    UnknownReadings,
    /// The image was made by another method, or with other settings than its defaults.
    #[error("no intervals: they are calibrated for images by {expected}, not by {found}")]
    OtherReconstruction {
        /// The calibrated methods.
        expected: String,
        /// The method.
        found: String,
    },
    /// Fewer patterns were measured.
    #[error(
        "no intervals: they are calibrated for {:.0} to 100 % of the patterns, not for {:.1} %",
        100.0 * least, 100.0 * found
    )]
    OtherShare {
        /// The share of the patterns.
        found: f32,
        /// The least share of the calibration.
        least: f32,
    },
    /// The readings have more noise.
    #[error(
        "no intervals: they are calibrated for noise of the readings up to {:.0} % of white, not for {:.1} %",
        100.0 * most, 100.0 * found
    )]
    OtherNoise {
        /// The noise; white is 1.
        found: f32,
        /// The most noise of the calibration.
        most: f32,
    },
    /// The images were not enhanced from 32 x 32 pixels.
    #[error("no intervals: they are calibrated for images enhanced from 32 x 32 pixels")]
    OtherSize,
    /// The calibration cannot be read.
    #[error("the calibration of the intervals cannot be read: {0}")]
    Format(String),
    /// The calibration does not belong to this program.
    #[error(transparent)]
    Table(#[from] TableError),
    /// Weights cannot be read.
    #[error(transparent)]
    Weights(#[from] WeightsError),
}

/// The calibrated intervals of enhanced images.
#[derive(Debug, Clone, PartialEq)]
pub struct Intervals {
    calibration: Calibration,
}

impl Intervals {
    /// The intervals of a calibration.
    ///
    /// # Errors
    /// [`NoIntervals::Table`] if the calibration is of another program.
    pub fn new(calibration: Calibration) -> Result<Self, NoIntervals> {
        calibration.methods.values().try_for_each(Table::checked)?;
        calibration.characters.checked().map_err(|()| TableError::Form)?;
        Ok(Self { calibration })
    }

    /// The shipped calibration.
    ///
    /// # Errors
    /// [`NoIntervals`] if the file is damaged.
    pub fn shipped() -> Result<Self, NoIntervals> {
        Self::parse(nirspi_weights::INTERVALS)
    }

    /// The calibration in a JSON text.
    ///
    /// # Errors
    /// [`NoIntervals`] if the text is no calibration.
    pub fn parse(json: &str) -> Result<Self, NoIntervals> {
        let calibration =
            serde_json::from_str(json).map_err(|error| NoIntervals::Format(error.to_string()))?;
        Self::new(calibration)
    }

    /// The calibration and its origin.
    pub fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// Checks that these weights are those of the calibration.
    ///
    /// # Errors
    /// [`NoIntervals::OtherWeights`] if they are not.
    pub fn expect(&self, network: &str, weights: &Weights) -> Result<(), NoIntervals> {
        match self.calibration.weights.get(network) {
            Some(calibrated) if *calibrated == weights.fingerprint() => Ok(()),
            _ => Err(NoIntervals::OtherWeights { network: network.to_owned() }),
        }
    }

    /// The table for these readings.
    ///
    /// # Errors
    /// [`NoIntervals`] names what the calibration was not made for.
    pub fn table(&self, readings: &Readings<'_>) -> Result<&Table, NoIntervals> {
        let Calibration { methods, reach, .. } = &self.calibration;
        let &Readings { method, share, noise } = readings;
        let table = methods.get(method).ok_or_else(|| {
            let words: Vec<&str> = methods.keys().map(String::as_str).collect();
            NoIntervals::OtherReconstruction {
                expected: words.join(", "),
                found: method.to_owned(),
            }
        })?;
        // NaN is outside of every range.
        if !(reach.least_share..=1.0).contains(&share) {
            return Err(NoIntervals::OtherShare { found: share, least: reach.least_share });
        }
        if !(0.0..=reach.most_noise).contains(&noise) {
            return Err(NoIntervals::OtherNoise { found: noise, most: reach.most_noise });
        }
        Ok(table)
    }

    /// Half-width of the 95 % interval of each pixel.
    ///
    /// # Errors
    /// [`NoIntervals`] if the calibration was not made for these readings.
    pub fn half_widths(
        &self,
        seen: &Seen<'_>,
        readings: &Readings<'_>,
    ) -> Result<Vec<f32>, NoIntervals> {
        Ok(self.table(readings)?.half_widths(seen, readings, LEVEL))
    }

    /// Half-width of the 95 % interval of each pixel of a stack, (N, 64, 64), whose images have the
    /// same kind of readings.
    ///
    /// # Errors
    /// [`NoIntervals`] if the images were not enhanced from 32 x 32 pixels, or the calibration was
    /// not made for these readings.
    pub fn of(
        &self,
        enhanced: &Enhanced,
        readings: &Readings<'_>,
    ) -> Result<Vec<f32>, NoIntervals> {
        let table = self.table(readings)?;
        let seen = enhanced.seen().ok_or(NoIntervals::OtherSize)?;
        Ok(seen.flat_map(|seen| table.half_widths(&seen, readings, LEVEL)).collect())
    }
}

impl Enhanced {
    /// The images one by one; `None` if the input was not 32 x 32.
    pub fn seen(&self) -> Option<impl Iterator<Item = Seen<'_>>> {
        let fused = self.upscaled.as_ref()?.chunks_exact(AREA);
        let numbers = self.estimates.iter().zip(&self.inconsistency);
        let images = self.images.chunks_exact(AREA).zip(fused).zip(numbers);
        Some(images.map(|((image, fused), (&estimate, &inconsistency))| Seen {
            image,
            fused,
            estimate,
            inconsistency,
        }))
    }
}

/// The calibrated network and steps, in words.
const METHOD: &str = "diffusion in 1 step";

impl Networks {
    /// The shipped intervals, if they were calibrated for the chosen weights, this method and these
    /// options.
    ///
    /// # Errors
    /// [`NoIntervals`] names the weights, method or options for which the table was not made.
    pub fn intervals(
        &mut self,
        method: Method,
        options: &Options,
    ) -> Result<Intervals, NoIntervals> {
        let other = |found| Err(NoIntervals::OtherMethod { expected: METHOD, found });
        if method != Method::default() {
            let (name, steps) = (method.model().name(), method.steps());
            return other(format!(
                "{name} in {steps} step{}",
                if steps.get() == 1 { "" } else { "s" }
            ));
        }
        if !options.consistency {
            return other("a result that is not held against the readings".to_owned());
        }
        let intervals = Intervals::shipped()?;
        // The reconstruction's network is not one of these: it is named by `Readings::method`.
        for network in NETWORKS {
            let weights = self.weights(network)?;
            intervals.expect(network, &weights)?;
        }
        Ok(intervals)
    }
}

/// Share of the pixels that are the prior's and not the data's: their half-width is at least
/// [`PRIORS_HALF_WIDTH`].
pub fn share_of_prior(half_widths: &[f32]) -> f32 {
    let wide = half_widths.iter().filter(|width| **width >= PRIORS_HALF_WIDTH).count();
    wide as f32 / half_widths.len().max(1) as f32
}

#[cfg(test)]
mod tests;
