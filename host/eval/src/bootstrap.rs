//! Confidence intervals without an assumed distribution: the sample is drawn again with replacement
//! (Efron, Ann. Stat. 7, 1, 1979). The draws are seeded, so that a report can be repeated.
//!
//! Glyphs, typefaces, writers and font families are drawn again, and never single images: images of
//! one writer are alike, and a hundred of them say less about writing than a hundred writers would.
//! All methods use the same draws, so that a difference of two methods is that of the same images.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use std::collections::BTreeMap;

/// Number of draws for a mean.
pub const DRAWS: usize = 1000;

/// A figure with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// The figure.
    pub value: f64,
    /// The lower end of its interval.
    pub low: f64,
    /// The upper end of its interval.
    pub high: f64,
}

impl Interval {
    /// `28.32 (28.08 to 28.57)`.
    #[must_use]
    pub fn text(&self, digits: usize) -> String {
        let Self { value, low, high } = self;
        format!("{value:.digits$} ({low:.digits$} to {high:.digits$})")
    }

    /// Whether 0 lies outside the interval.
    #[must_use]
    pub fn is_not_zero(&self) -> bool {
        self.low > 0.0 || self.high < 0.0
    }
}

/// Draws with replacement. Each draw is a list of items' indices, in which an item may come more than once or not at all.
#[derive(Debug, Clone, PartialEq)]
pub struct Redraws(Vec<Vec<usize>>);

impl Redraws {
    /// Draws of items in clusters. `of` gives each item's stratum and cluster. In every stratum as
    /// many clusters are drawn as the stratum has, each with all of its items.
    #[must_use]
    pub fn clustered(of: &[(usize, u32)], count: usize) -> Self {
        let mut strata: BTreeMap<usize, BTreeMap<u32, Vec<usize>>> = BTreeMap::new();
        for (item, &(stratum, cluster)) in of.iter().enumerate() {
            strata.entry(stratum).or_default().entry(cluster).or_default().push(item);
        }
        let strata: Vec<Vec<Vec<usize>>> =
            strata.into_values().map(|clusters| clusters.into_values().collect()).collect();
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let mut draw = || {
            let mut picked = Vec::with_capacity(of.len());
            for clusters in &strata {
                for _ in 0..clusters.len() {
                    picked.extend_from_slice(&clusters[rng.random_range(0..clusters.len())]);
                }
            }
            picked
        };
        Self((0..count).map(|_| draw()).collect())
    }

    /// Draws of items with two crossed factors, such as glyph and typeface. `of` gives each item's
    /// level of both factors. The levels of each factor are drawn independently, and an item occurs
    /// as often as the product of its two levels (Owen, *The pigeonhole bootstrap*, Ann. Appl.
    /// Stat. 1, 386, 2007). The interval holds for other glyphs in other typefaces, and is too wide
    /// rather than too narrow.
    #[must_use]
    pub fn crossed(of: &[(usize, usize)], count: usize) -> Self {
        let levels = |each: fn(&(usize, usize)) -> usize| {
            of.iter().map(each).max().map_or(0, |most| most + 1)
        };
        let (first, second) =
            (present(levels(|l| l.0), of, |l| l.0), present(levels(|l| l.1), of, |l| l.1));
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let mut draw = || {
            loop {
                let mut times = [vec![0; levels(|l| l.0)], vec![0; levels(|l| l.1)]];
                for (times, levels) in times.iter_mut().zip([&first, &second]) {
                    for _ in 0..levels.len() {
                        times[levels[rng.random_range(0..levels.len())]] += 1;
                    }
                }
                let often = |&(a, b): &(usize, usize)| times[0][a] * times[1][b];
                let picked: Vec<usize> = of
                    .iter()
                    .enumerate()
                    .flat_map(|(item, levels)| std::iter::repeat_n(item, often(levels)))
                    .collect();
                // A pair of levels may have no item, so a draw can be empty.
                if !picked.is_empty() || of.is_empty() {
                    return picked;
                }
            }
        };
        Self((0..count).map(|_| draw()).collect())
    }

    /// The first draws only, for a statistic that takes long.
    #[must_use]
    pub fn first(&self, count: usize) -> Self {
        Self(self.0.iter().take(count).cloned().collect())
    }

    /// Each draw.
    pub fn iter(&self) -> std::slice::Iter<'_, Vec<usize>> {
        self.0.iter()
    }

    /// The interval of a statistic with the known `value`, from percentiles of the draws. `of`
    /// computes the statistic of drawn items.
    #[must_use]
    pub fn interval(&self, value: f64, of: impl Fn(&[usize]) -> f64) -> Interval {
        let [low, high] = middle(self.0.iter().map(|picked| of(picked)).collect());
        Interval { value, low, high }
    }

    /// The interval of the mean of some values, one for each item.
    #[must_use]
    pub fn of_mean(&self, values: &[f64]) -> Interval {
        let mean = |picked: &[usize]| {
            picked.iter().map(|&at| values[at]).sum::<f64>() / picked.len() as f64
        };
        self.interval(values.iter().sum::<f64>() / values.len() as f64, mean)
    }

    /// The interval of a distance of sets. Distances of drawn sets are larger on average, because
    /// images repeat in them. Therefore only the spread of the `drawn` distances is used, around
    /// `value`.
    #[must_use]
    pub fn around(value: f64, drawn: Vec<f64>) -> Interval {
        let mean = drawn.iter().sum::<f64>() / drawn.len() as f64;
        let [low, high] = middle(drawn);
        Interval { value, low: (value + low - mean).max(0.0), high: value + high - mean }
    }
}

/// The levels that at least one item has.
fn present(levels: usize, of: &[(usize, usize)], each: fn(&(usize, usize)) -> usize) -> Vec<usize> {
    (0..levels).filter(|level| of.iter().any(|item| each(item) == *level)).collect()
}

/// The ends of the middle 95 %.
fn middle(mut drawn: Vec<f64>) -> [f64; 2] {
    drawn.sort_unstable_by(f64::total_cmp);
    let last = drawn.len().saturating_sub(1) as f64;
    [0.025, 0.975]
        .map(|share| drawn.get((share * last).round() as usize).copied().unwrap_or(f64::NAN))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn half_width(interval: &Interval) -> f64 {
        (interval.high - interval.low) / 2.0
    }

    #[test]
    fn the_interval_of_a_mean_is_that_of_its_standard_error() {
        // 400 values of standard deviation sqrt(1/12): the mean's is 0.0144, so 95 % are +- 0.0283.
        let values: Vec<f64> = (0..400).map(|i| (f64::from(i) + 0.5) / 400.0).collect();
        let each: Vec<(usize, u32)> = (0..400).map(|i| (0, i)).collect();
        let interval = Redraws::clustered(&each, DRAWS).of_mean(&values);
        assert!((interval.value - 0.5).abs() < 1e-12);
        assert!((half_width(&interval) / 0.0283 - 1.0).abs() < 0.15, "{interval:?}");
        let one = Redraws::clustered(&each[..5], DRAWS).of_mean(&[0.7; 5]);
        assert!(half_width(&one) < 1e-12);
    }

    #[test]
    fn images_of_one_writer_do_not_count_as_many() {
        // 20 writers with 20 equal images each: the interval is that of 20 values, 4.5 times that
        // of 400.
        let values: Vec<f64> = (0..400).map(|i| f64::from(i / 20)).collect();
        let writers: Vec<(usize, u32)> = (0..400).map(|i| (0, i / 20)).collect();
        let images: Vec<(usize, u32)> = (0..400).map(|i| (0, i)).collect();
        let width =
            |of: &[(usize, u32)]| half_width(&Redraws::clustered(of, DRAWS).of_mean(&values));
        let ratio = width(&writers) / width(&images);
        assert!((ratio / 20_f64.sqrt() - 1.0).abs() < 0.15, "{ratio}");
    }

    #[test]
    fn fixed_strata_are_not_drawn() {
        // Two stacks far apart, each of equal images: the mean is the same in every draw.
        let values: Vec<f64> = (0..40).map(|i| if i < 20 { 10.0 } else { 30.0 }).collect();
        let of: Vec<(usize, u32)> = (0..40).map(|i| (usize::from(i >= 20), i)).collect();
        let interval = Redraws::clustered(&of, DRAWS).of_mean(&values);
        assert_eq!((interval.low, interval.value, interval.high), (20.0, 20.0, 20.0));
    }

    #[test]
    fn of_crossed_factors_each_brings_its_own_spread() {
        // 62 glyphs in 6 typefaces. A value that depends only on the typeface has the interval of 6
        // values, not of 372.
        let of: Vec<(usize, usize)> = (0..372).map(|i| (i % 62, (i % 62 + i / 62) % 6)).collect();
        let redraws = Redraws::crossed(&of, DRAWS);
        let by_face: Vec<f64> = of.iter().map(|&(_, face)| face as f64).collect();
        let by_glyph: Vec<f64> = of.iter().map(|&(glyph, _)| glyph as f64).collect();
        // Standard deviations of 0..6 and 0..62, divided by the roots of 6 and 62, times 1.96.
        for (values, expected) in
            [(by_face, 1.96 * 1.708 / 6_f64.sqrt()), (by_glyph, 1.96 * 17.9 / 62_f64.sqrt())]
        {
            let found = half_width(&redraws.of_mean(&values));
            assert!((found / expected - 1.0).abs() < 0.2, "{found} {expected}");
        }
        // With few items, draws without any item are repeated.
        let few = Redraws::crossed(&[(0, 0), (1, 1)], 100);
        assert!(few.iter().all(|picked| !picked.is_empty()));
    }

    #[test]
    fn the_interval_of_a_set_is_around_its_value_though_draws_are_biased() {
        let drawn = (0..200).map(|k| 7.0 + f64::from(k) / 50.0).collect();
        let interval = Redraws::around(3.0, drawn);
        assert!(interval.low < 3.0 && 3.0 < interval.high && interval.high < 14.0, "{interval:?}");
    }
}
