//! Random numbers that depend on a seed and on an image's index, and never on the image's batch.

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// White noise of standard deviation 1, for one image.
#[derive(Debug, Clone)]
pub(crate) struct Noise(Pcg64);

impl Noise {
    /// The noise of image `index`.
    pub(crate) fn of(seed: u64, index: usize) -> Self {
        // A step of the golden ratio separates the seeds of neighbouring images.
        let step = (index as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        Self(Pcg64::seed_from_u64(seed.wrapping_add(step)))
    }

    /// Draws one number.
    pub(crate) fn draw(&mut self) -> f32 {
        StandardNormal.sample(&mut self.0)
    }

    /// Draws one number, even between 0 and 1.
    pub(crate) fn uniform(&mut self) -> f32 {
        self.0.random()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_white_and_every_image_has_its_own() {
        let draws = |seed, index| -> Vec<f32> {
            let mut noise = Noise::of(seed, index);
            (0..4096).map(|_| noise.draw()).collect()
        };
        let first = draws(3, 6);
        assert_eq!(first, draws(3, 6));
        assert_ne!(first, draws(3, 7));
        assert_ne!(first, draws(4, 6));
        let moment = |power| first.iter().map(|v| v.powi(power)).sum::<f32>() / 4096.0;
        assert!(moment(1).abs() < 0.05 && (moment(2) - 1.0).abs() < 0.1);
    }
}
