//! Confidence intervals without an assumed distribution: images are drawn again, with replacement.
//!
//! Percentile bootstrap (Efron, Ann. Stat. 7, 1979); seeded, so that a report is the same again.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;

/// Draws of the images.
const DRAWS: usize = 1000;

/// A figure with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// The figure.
    pub value: f64,
    /// The lower end of its interval.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

impl Interval {
    /// The mean of independent values.
    #[must_use]
    pub fn of_mean(values: &[f64]) -> Self {
        let count = values.len() as f64;
        let value = values.iter().sum::<f64>() / count;
        let draw = |picked: &[usize]| picked.iter().map(|&at| values[at]).sum::<f64>() / count;
        let drawn = redrawn(values.len(), DRAWS, draw);
        let [low, high] = middle(drawn);
        Self { value, low, high }
    }

    /// A statistic of a whole set, whose `value` is known and which `of` computes for images drawn again. A distance of drawn sets
    /// is larger on the whole, since images repeat in them: only its spread is taken, around `value`.
    ///
    /// # Errors
    /// Those of `of`.
    pub fn of_set<E>(
        value: f64,
        images: usize,
        draws: usize,
        of: impl Fn(&[usize]) -> Result<f64, E>,
    ) -> Result<Self, E> {
        let drawn = redrawn(images, draws, of).into_iter().collect::<Result<Vec<f64>, E>>()?;
        let mean = drawn.iter().sum::<f64>() / drawn.len() as f64;
        let [low, high] = middle(drawn);
        Ok(Self { value, low: (value + low - mean).max(0.0), high: value + high - mean })
    }
}

fn redrawn<T>(images: usize, draws: usize, of: impl Fn(&[usize]) -> T) -> Vec<T> {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut picked = vec![0; images];
    (0..draws)
        .map(|_| {
            picked.iter_mut().for_each(|at| *at = rng.random_range(0..images));
            of(&picked)
        })
        .collect()
}

/// The ends of the middle 95 %.
fn middle(mut drawn: Vec<f64>) -> [f64; 2] {
    drawn.sort_unstable_by(f64::total_cmp);
    let last = (drawn.len() - 1) as f64;
    [0.025, 0.975].map(|share| drawn[(share * last).round() as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_of_a_mean_is_that_of_its_standard_error() {
        // 400 values of standard deviation sqrt(1/12): the mean's is 0.0144, so 95 % are +- 0.0283.
        let values: Vec<f64> = (0..400).map(|i| (f64::from(i) + 0.5) / 400.0).collect();
        let interval = Interval::of_mean(&values);
        assert!((interval.value - 0.5).abs() < 1e-12);
        for half in [interval.value - interval.low, interval.high - interval.value] {
            assert!((half / 0.0283 - 1.0).abs() < 0.15, "{half}");
        }
        let one = Interval::of_mean(&[0.7; 5]);
        assert!((one.low - 0.7).abs() < 1e-12 && (one.high - 0.7).abs() < 1e-12);
    }

    #[test]
    fn the_interval_of_a_set_is_around_its_value_though_draws_are_biased() {
        let of = |picked: &[usize]| Ok::<f64, ()>(7.0 + picked.iter().sum::<usize>() as f64 / 50.0);
        let interval = Interval::of_set(3.0, 50, 200, of).unwrap();
        assert!(interval.low < 3.0 && 3.0 < interval.high && interval.high < 14.0, "{interval:?}");
    }
}
