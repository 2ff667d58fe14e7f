//! What held-back readings say of a picture: of every reading, how well it is predicted without it.
//!
//! # Invariant
//! A prediction is compared only with readings that it was not made from.

use super::selection::Miss;
use crate::Rows;

/// How well readings are predicted by the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldBack {
    /// Absolute and squared error of the predictions, each relative to that of zero filling: 2 is as
    /// bad as zero filling, 0 is perfect.
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

    /// Judges predictions, one for each reading. `trust` is the factor that the picture uses them
    /// with. `None` if there are no readings beside the all-ones pattern's, or all are 0.
    pub(super) fn of(rows: &Rows, values: &[f32], predicted: &[f32], trust: f32) -> Option<Self> {
        let (mut miss, mut zero) = (Miss::default(), Miss::default());
        let (mut signs, mut squares) = (0.0, 0.0);
        let readings = rows.iter().zip(values).zip(predicted).filter(|((row, _), _)| **row != 0);
        for ((_, &value), &predicted) in readings {
            let (value, predicted) = (f64::from(value), f64::from(predicted));
            miss.add(Miss::of(value - f64::from(trust) * predicted));
            zero.add(Miss::of(value));
            let both = value * predicted;
            signs += both.signum() * both.abs().sqrt();
            squares += both.abs();
        }
        if zero.squared() <= 0.0 {
            return None;
        }
        Some(Self {
            miss: miss.relative_to(zero),
            confirmed: (1.0 - miss.squared() / zero.squared()).clamp(0.0, 1.0),
            score: if squares > 0.0 { signs / squares.sqrt() } else { 0.0 },
        })
    }

    /// Whether the readings are predicted no better than readings of other patterns would be.
    #[must_use]
    pub fn is_by_chance(&self) -> bool {
        self.score < Self::BY_CHANCE
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
