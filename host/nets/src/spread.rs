//! The spread of a result: its standard deviation, pixel by pixel, over repeated measurements of
//! the same scene.
//!
//! The readings get fresh noise of the size estimated in them (a parametric bootstrap), and all
//! stages run again. The spread says how well a result repeats. It is no error bar: what the
//! network gets wrong in every copy (bias, or a stroke that it invents each time) is not in it.
//! `docs/log/quality.md` says how often the truth lies within it.

use crate::estimate::Estimate;
use crate::random::Noise;

/// Readings (N, side, side) as in another measurement, in [0, 1]; `first` is the index of the first
/// image.
pub(crate) fn measured_again(
    readings: &[f32],
    estimates: &[Estimate],
    seed: u64,
    first: usize,
) -> Vec<f32> {
    let area = readings.len() / estimates.len().max(1);
    let mut copy = readings.to_vec();
    for (i, (image, estimate)) in copy.chunks_exact_mut(area).zip(estimates).enumerate() {
        let mut noise = Noise::of(seed, first + i);
        for value in image {
            *value = (*value + estimate.noise * noise.draw()).clamp(0.0, 1.0);
        }
    }
    copy
}

/// The estimates for copies with added noise: the noise of the measurement and as much again, so its standard deviation
/// is larger by the square root of two.
pub(crate) fn doubled(estimates: &[Estimate]) -> Vec<Estimate> {
    let twice = |e: &Estimate| Estimate { noise: e.noise * 2.0_f32.sqrt(), ..*e };
    estimates.iter().map(twice).collect()
}

/// Running mean and variance of arrays (Welford).
#[derive(Debug)]
pub(crate) struct Moments {
    count: u32,
    mean: Vec<f32>,
    squares: Vec<f32>,
}

impl Moments {
    pub(crate) fn new(length: usize) -> Self {
        Self { count: 0, mean: vec![0.0; length], squares: vec![0.0; length] }
    }

    pub(crate) fn add(&mut self, values: &[f32]) {
        self.count += 1;
        let share = 1.0 / self.count as f32;
        for ((mean, square), value) in self.mean.iter_mut().zip(&mut self.squares).zip(values) {
            let off = value - *mean;
            *mean += share * off;
            *square += off * (value - *mean);
        }
    }

    /// Standard deviations from the unbiased variance; zero for a single sample.
    pub(crate) fn deviation(self) -> Vec<f32> {
        let degrees = self.count.saturating_sub(1).max(1) as f32;
        self.squares.into_iter().map(|square| (square / degrees).max(0.0).sqrt()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_deviation_is_that_of_the_samples() {
        let mut moments = Moments::new(2);
        for values in [[0.1, 0.5], [0.3, 0.5], [0.8, 0.5]] {
            moments.add(&values);
        }
        let deviation = moments.deviation();
        assert!((deviation[0] - 0.360_555).abs() < 1e-5 && deviation[1] < 1e-6, "{deviation:?}");
    }

    #[test]
    fn a_copy_has_the_estimated_noise_and_a_seed_gives_it_again() {
        let readings = vec![0.5; 2 * 4096];
        let estimates =
            [Estimate { sigma_px: 1.0, noise: 0.02 }, Estimate { sigma_px: 1.0, noise: 0.0 }];
        let copy = measured_again(&readings, &estimates, 7, 0);
        let square: f32 = copy[..4096].iter().map(|v| (v - 0.5).powi(2)).sum();
        assert!(((square / 4096.0).sqrt() - 0.02).abs() < 1e-3);
        assert_eq!(copy[4096..], readings[4096..]);
        assert_eq!(copy, measured_again(&readings, &estimates, 7, 0));
        assert_ne!(copy, measured_again(&readings, &estimates, 8, 0));
    }
}
