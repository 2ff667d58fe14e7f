//! Conditions, and readings under a condition.
//!
//! # Invariant
//! The noise of image k is the same in every condition except for its strength, and the same for
//! every method (`tests::readings_have_the_noise_that_was_asked_for_and_its_pattern_stays`).

use super::characters::Characters;
use nirspi_nets::classical::Blur;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use std::fmt;

/// Side of an image.
pub const SIDE: usize = nirspi_nets::deblur::SIDE;
/// Side of its readings.
pub(super) const READINGS: usize = SIDE / 2;

/// The degradation of an image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Condition {
    /// Gaussian blur, standard deviation in pixels of 64 x 64.
    pub sigma_px: f32,
    /// White noise of the readings, standard deviation; white is 1.
    pub noise: f32,
}

/// Variance in px^2 that averaging pairs of pixels adds to the blur: each pixel is half a pixel
/// from the middle of its pair.
pub fn sampling_variance() -> f32 {
    0.25
}

impl Condition {
    /// Readings (N, 32, 32) in [0, 1] of all characters.
    #[must_use]
    pub fn readings(self, characters: &Characters, seed: u64) -> Vec<f32> {
        let images = characters.iter().enumerate();
        images.flat_map(|(k, character)| self.read(&character.sharp, seed, k as u64)).collect()
    }

    /// Readings of one image. The noise follows from `seed` and the image's `number`.
    #[must_use]
    pub fn read(self, sharp: &[f32], seed: u64, number: u64) -> Vec<f32> {
        let blurred = Blur::new(SIDE, SIDE, self.sigma_px).apply(sharp);
        let mut rng = Pcg64Mcg::seed_from_u64(seed ^ number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        halved(&blurred)
            .into_iter()
            .map(|mean| {
                let noise: f32 = StandardNormal.sample(&mut rng);
                (mean + self.noise * noise).clamp(0.0, 1.0)
            })
            .collect()
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "sigma {} px, noise {}", self.sigma_px, self.noise)
    }
}

/// Means of 2 x 2 pixels of a 64 x 64 image.
pub fn halved(image: &[f32]) -> Vec<f32> {
    let at = |r: usize, c: usize| image[r * SIDE + c];
    let mean = |r: usize, c: usize| {
        (at(2 * r, 2 * c) + at(2 * r, 2 * c + 1) + at(2 * r + 1, 2 * c) + at(2 * r + 1, 2 * c + 1))
            / 4.0
    };
    (0..READINGS * READINGS).map(|k| mean(k / READINGS, k % READINGS)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bar() -> Vec<f32> {
        (0..SIDE * SIDE).map(|at| if (24..40).contains(&(at % SIDE)) { 0.6 } else { 0.3 }).collect()
    }

    #[test]
    fn readings_have_the_noise_that_was_asked_for_and_its_pattern_stays() {
        let clean = Condition { sigma_px: 1.5, noise: 0.0 }.read(&bar(), 3, 0);
        let noise = |strength: f32, number| -> Vec<f32> {
            let noisy = Condition { sigma_px: 1.5, noise: strength }.read(&bar(), 3, number);
            noisy.iter().zip(&clean).map(|(a, b)| (a - b) / strength).collect()
        };
        let (weak, strong, other) = (noise(0.01, 0), noise(0.05, 0), noise(0.05, 1));
        let power = weak.iter().map(|v| v * v).sum::<f32>() / weak.len() as f32;
        assert!((power - 1.0).abs() < 0.1, "{power}");
        assert!(weak.iter().zip(&strong).all(|(a, b)| (a - b).abs() < 1e-3));
        assert!(weak.iter().zip(&other).any(|(a, b)| (a - b).abs() > 0.5));
    }

    #[test]
    fn sampling_adds_the_blur_that_is_reckoned() {
        // The second moment of the slope of an edge along one row.
        let edge: Vec<f32> =
            (0..SIDE * SIDE).map(|at| f32::from(u8::from(at % SIDE >= 32))).collect();
        let row = Blur::new(SIDE, SIDE, 2.0).apply(&edge);
        let moment = |line: &[f32], pitch: f32| {
            let slopes: Vec<f32> = line.windows(2).map(|w| w[1] - w[0]).collect();
            let total: f32 = slopes.iter().sum();
            let places = || slopes.iter().enumerate().map(|(k, s)| (pitch * k as f32, s / total));
            let mean: f32 = places().map(|(x, s)| x * s).sum();
            places().map(|(x, s)| (x - mean).powi(2) * s).sum::<f32>()
        };
        let fine = moment(&row[..SIDE], 1.0);
        let coarse = moment(&halved(&row)[..READINGS], 2.0);
        // Slopes are differences over one pixel and over two, whose own variance is 1/12 of the
        // pitch squared.
        let found = (coarse - 4.0 / 12.0) - (fine - 1.0 / 12.0);
        assert!((found - sampling_variance()).abs() < 0.02, "{found}");
    }
}
