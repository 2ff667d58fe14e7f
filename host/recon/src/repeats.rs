//! The noise of measurements that repeat: what differs between one and the next.
//!
//! Noise is the same in every pattern, and slow drift of the light hardly counts. Where the scene moves,
//! coarse patterns differ more than noise does. So the median over the patterns tells the noise.

use crate::Measurements;
use crate::order::positions_by_sequency;

/// Least correlation of the coarse readings of a measurement and the next, where both are of one scene.
const SAME_SCENE: f64 = 0.8;

/// Part of the rows that are coarse: those that noise hides last.
const COARSE: usize = 8;

/// Squared differences between one repetition and the next, pattern by pattern.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Repeats {
    /// The sum of the squares for each pattern, scaled to the variance of one repetition.
    squares: Vec<f64>,
    pairs: u64,
}

impl Repeats {
    /// No differences yet, for this number of patterns.
    #[must_use]
    pub fn of(patterns: usize) -> Self {
        Self { squares: vec![0.0; patterns], pairs: 0 }
    }

    /// Adds the differences between one repetition and the next, one for each pattern. `scale` is the
    /// variance of one repetition over that of such a difference: a half if both have the same noise.
    ///
    /// # Panics
    /// If there is not one difference for each pattern.
    pub fn add(&mut self, differences: impl ExactSizeIterator<Item = f64>, scale: f64) {
        assert_eq!(differences.len(), self.squares.len(), "a difference for each pattern");
        for (square, difference) in self.squares.iter_mut().zip(differences) {
            *square += difference * difference * scale;
        }
        self.pairs += 1;
    }

    /// Standard deviation of one repetition; `None` without a difference.
    #[must_use]
    pub fn noise(&self) -> Option<f64> {
        if self.pairs == 0 || self.squares.is_empty() {
            return None;
        }
        let mut squares = self.squares.clone();
        let middle = squares.len() / 2;
        let median = *squares.select_nth_unstable_by(middle, f64::total_cmp).1;
        // Neighbouring differences share a repetition, so `pairs` of them have about two thirds as many
        // degrees of freedom. The median of a sum of squares is below its mean (E. Wilson and M.
        // Hilferty, *The distribution of chi-square*, 1931).
        let freedom = (self.pairs as f64 * 2.0 / 3.0).max(1.0);
        let below = (1.0 - 2.0 / (9.0 * freedom)).powi(3);
        Some((median / self.pairs as f64 / below).sqrt())
    }
}

/// The noise of measurements of the same rows that repeat, as the frames of a video do; `None` if they show
/// different scenes: if less than half of them agree with the next in the coarsest rows.
///
/// # Panics
/// If the measurements have different rows.
pub(crate) fn noise_of_repeats(measurements: &[Measurements]) -> Option<f64> {
    let rows = measurements.first()?.rows();
    let coarse = positions_by_sequency(rows);
    let coarse = &coarse[..coarse.len().div_ceil(COARSE)];
    let pairs = || measurements.windows(2).map(|pair| (pair[0].values(), pair[1].values()));
    let alike = pairs().filter(|(one, next)| correlation(coarse, one, next) >= SAME_SCENE).count();
    if coarse.is_empty() || 2 * alike < measurements.len() - 1 {
        return None;
    }
    let mut repeats = Repeats::of(rows.len());
    for (one, next) in pairs() {
        // A cut between two scenes is no repetition.
        if correlation(coarse, one, next) >= SAME_SCENE {
            // Another gain or lamp is no noise.
            let gain = product(coarse, one, next) / product(coarse, one, one);
            let differences = one.iter().zip(next).map(|(one, next)| next - gain * one);
            repeats.add(differences, 1.0 / (1.0 + gain * gain));
        }
    }
    repeats.noise()
}

fn product(positions: &[usize], one: &[f64], next: &[f64]) -> f64 {
    positions.iter().map(|&k| one[k] * next[k]).sum()
}

/// Correlation of two readings at these positions, around 0.
fn correlation(positions: &[usize], one: &[f64], next: &[f64]) -> f64 {
    let energies = product(positions, one, one) * product(positions, next, next);
    if energies > 0.0 { product(positions, one, next) / energies.sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{figure, noisy, scene, side};
    use crate::{Order, Rows};

    fn rows() -> Rows {
        Order::ZigZag.rows(side(32)).unwrap().first(512)
    }

    #[test]
    fn repeated_measurements_tell_their_noise_and_different_scenes_do_not() {
        let still: Vec<Measurements> =
            (0..20).map(|seed| noisy(&rows(), &scene(side(32), 1), 5.0, seed)).collect();
        let found = noise_of_repeats(&still).unwrap();
        assert!((found / 5.0 - 1.0).abs() < 0.05, "{found}");
        // A lamp that drifts.
        let brighter = |seed: u64| {
            let bright: Vec<f64> =
                scene(side(32), 1).iter().map(|v| v * (1.0 + 0.03 * seed as f64)).collect();
            noisy(&rows(), &bright, 5.0, seed)
        };
        let found = noise_of_repeats(&(0..20).map(brighter).collect::<Vec<_>>()).unwrap();
        assert!((found / 5.0 - 1.0).abs() < 0.08, "{found}");
        // A figure that moves by a pixel every other frame, and a cut to another scene.
        let moving = (0..10).map(|k| noisy(&rows(), &figure(side(32), 0, k / 2), 5.0, k as u64));
        let cut: Vec<Measurements> = moving.chain(still.iter().cloned()).collect();
        let found = noise_of_repeats(&cut).unwrap();
        assert!((found / 5.0 - 1.0).abs() < 0.25, "{found}");
        let scenes = [0, 1, 2, 3].map(|kind| noisy(&rows(), &scene(side(32), kind), 5.0, 1));
        assert_eq!(noise_of_repeats(&scenes), None);
        assert_eq!(noise_of_repeats(&still[..1]), None);
        assert_eq!(noise_of_repeats(&[]), None);
    }
}
