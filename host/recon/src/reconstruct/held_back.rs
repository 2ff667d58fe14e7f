//! What held-back readings say of a picture: of every reading, how well it is predicted without it.
//!
//! # Invariant
//! A prediction is compared only with readings that it was not made from.

use super::selection::Miss;
use crate::{Rows, order};

/// How well readings are predicted by the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldBack {
    /// Absolute and squared error of the predictions, each relative to that of zero filling: 2 is as
    /// bad as zero filling, 0 is perfect. Where patterns were left out it is that of the finer half
    /// of the measured patterns, which are the nearest to those that were left out.
    pub miss: f64,
    /// Share of the readings' variation (squares, without the all-ones pattern) that the predictions
    /// explain, 0 to 1.
    pub confirmed: f64,
    /// Agreement in sign of readings and predictions, in standard errors: the sum of
    /// `sign(y p) sqrt(abs(y p))` over what such a sum of random signs has. Readings that belong to
    /// other patterns have signs of their own, whatever their sizes. The root keeps a few large
    /// readings from deciding alone.
    pub score: f64,
}

impl HeldBack {
    /// The most standard errors that are put down to chance.
    pub const BY_CHANCE: f64 = 3.0;

    /// Standard errors from which one of many tries is named: the best of some twenty is above
    /// [`Self::BY_CHANCE`] by chance now and then.
    pub const AMONG_MANY: f64 = 5.0;

    /// Deviation of the readings, in standard deviations of their noise, below which a scene is even, as a white sheet: it
    /// has nothing to predict.
    pub const EVEN: f64 = 1.5;

    /// Judges predictions, one for each reading. `trust` is the factor that the picture uses them
    /// with. `None` if there are no readings beside the all-ones pattern's, or all of those that
    /// [`Self::miss`] counts are 0.
    pub(super) fn of(rows: &Rows, values: &[f32], predicted: &[f32], trust: f32) -> Option<Self> {
        let positions = order::positions_by_sequency(rows);
        let (mut miss, mut zero) = (Miss::default(), Miss::default());
        let (mut finer_miss, mut finer_zero) = (Miss::default(), Miss::default());
        let mut signs = Signs::default();
        let left_out = rows.len() < rows.side().area();
        let first_finer = if left_out { positions.len() / 2 } else { 0 };
        for (at, &k) in positions.iter().enumerate() {
            let (value, predicted) = (f64::from(values[k]), f64::from(predicted[k]));
            let (missed, unpredicted) =
                (Miss::of(value - f64::from(trust) * predicted), Miss::of(value));
            miss.add(missed);
            zero.add(unpredicted);
            if at >= first_finer {
                finer_miss.add(missed);
                finer_zero.add(unpredicted);
            }
            signs.add(value, predicted);
        }
        if finer_zero.squared() <= 0.0 {
            return None;
        }
        Some(Self {
            miss: finer_miss.relative_to(finer_zero),
            confirmed: confirmed(miss, zero),
            score: signs.score(),
        })
    }

    /// Judges predictions of measurements by any patterns, all of which count alike: each measurement with its prediction.
    /// `None` if there are no measurements, or all are 0.
    #[must_use]
    pub fn of_pairs(pairs: impl Iterator<Item = (f64, f64)>) -> Option<Self> {
        let (mut miss, mut zero, mut signs) = (Miss::default(), Miss::default(), Signs::default());
        for (value, predicted) in pairs {
            miss.add(Miss::of(value - predicted));
            zero.add(Miss::of(value));
            signs.add(value, predicted);
        }
        (zero.squared() > 0.0).then(|| Self {
            miss: miss.relative_to(zero),
            confirmed: confirmed(miss, zero),
            score: signs.score(),
        })
    }

    /// The mean of several judgements; `None` for an empty list.
    pub(super) fn mean(all: &[Self]) -> Option<Self> {
        let of = |part: fn(&Self) -> f64| all.iter().map(part).sum::<f64>() / all.len() as f64;
        let mean = || Self {
            miss: of(|h| h.miss),
            confirmed: of(|h| h.confirmed),
            score: of(|h| h.score),
        };
        (!all.is_empty()).then(mean)
    }

    /// Whether the readings are predicted no better than readings of other patterns would be.
    #[must_use]
    pub fn is_by_chance(&self) -> bool {
        self.score < Self::BY_CHANCE
    }
}

/// Share of the squares of `zero` that predictions with this miss explain.
fn confirmed(miss: Miss, zero: Miss) -> f64 {
    (1.0 - miss.squared() / zero.squared()).clamp(0.0, 1.0)
}

/// Agreement in sign of values and predictions.
#[derive(Default)]
struct Signs {
    sum: f64,
    squares: f64,
}

impl Signs {
    fn add(&mut self, value: f64, predicted: f64) {
        let both = value * predicted;
        self.sum += both.signum() * both.abs().sqrt();
        self.squares += both.abs();
    }

    fn score(&self) -> f64 {
        if self.squares > 0.0 { self.sum / self.squares.sqrt() } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Order;
    use crate::testing::{normal, side};
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    #[test]
    fn a_perfect_prediction_and_none_have_the_figures_of_their_definitions() {
        let rows = Rows::natural(side(2));
        let values = [9.0, 1.0, -2.0, 2.0];
        let perfect = HeldBack::of(&rows, &values, &values, 1.0).unwrap();
        assert_eq!((perfect.miss, perfect.confirmed), (0.0, 1.0));
        assert!((perfect.score - 5.0 / 3.0).abs() < 1e-12, "{perfect:?}");
        let zeros = HeldBack::of(&rows, &values, &[0.0; 4], 1.0).unwrap();
        assert_eq!((zeros.miss, zeros.confirmed, zeros.score), (2.0, 0.0, 0.0));
        assert_eq!(HeldBack::of(&rows, &[9.0, 0.0, 0.0, 0.0], &values, 1.0), None);
        // The score is of the prediction itself, the miss of what the picture uses of it.
        let half = HeldBack::of(&rows, &values, &values, 0.5).unwrap();
        assert_eq!((half.miss, half.score), (0.75, perfect.score));
    }

    #[test]
    fn the_finer_half_counts_where_patterns_were_left_out() {
        // Two coarse rows are predicted, two fine ones are not.
        let zig_zag: Vec<i64> =
            Order::ZigZag.rows(side(4)).unwrap().iter().map(|&row| row.into()).collect();
        let predicted = [9.0, 4.0, 3.0, 0.0, 0.0];
        let values = [9.0, 4.0, 3.0, 2.0, 1.0];
        let some = Rows::new(side(4), zig_zag[..5].to_vec()).unwrap();
        let found = HeldBack::of(&some, &values, &predicted, 1.0).unwrap();
        assert_eq!((found.miss, found.confirmed), (2.0, 1.0 - 5.0 / 30.0));
        // Of all patterns, each counts.
        let mut values = values.to_vec();
        let mut predicted = predicted.to_vec();
        values.resize(16, 0.0);
        predicted.resize(16, 0.0);
        let all = Rows::new(side(4), zig_zag).unwrap();
        let found = HeldBack::of(&all, &values, &predicted, 1.0).unwrap();
        assert!((found.miss - (3.0 / 10.0 + 5.0 / 30.0)).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn signs_by_chance_are_told_from_signs_that_agree() {
        let mut random = Pcg64::seed_from_u64(3);
        let rows = Rows::natural(side(16));
        let mut draw = || -> Vec<f32> {
            // Sizes that fall as those of a scene, so that few readings have most of the energy.
            (0..256).map(|k| (normal(&mut random) / (1.0 + k as f64 / 8.0)) as f32).collect()
        };
        let (values, others, noise) = (draw(), draw(), draw());
        let chance = HeldBack::of(&rows, &values, &others, 1.0).unwrap();
        assert!(chance.is_by_chance(), "{chance:?}");
        let near: Vec<f32> = values.iter().zip(&noise).map(|(v, n)| v + n).collect();
        let agrees = HeldBack::of(&rows, &values, &near, 1.0).unwrap();
        assert!(!agrees.is_by_chance() && agrees.confirmed < 0.9, "{agrees:?}");
    }
}
