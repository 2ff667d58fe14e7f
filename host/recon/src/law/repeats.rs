//! Readings that repeat themselves: several samples of each reading, or several sweeps one after
//! another.

use super::robust::median;

/// The most samples of a reading, and the most sweeps, that are looked for.
const MOST: usize = 64;

/// How many times more readings change between blocks of samples than within them.
const STEADY: f64 = 5.0;

/// Changes of less than this share of the greatest reading may be rounding.
const ROUNDING: f64 = 1e-12;

/// Fewest readings that a sweep is left with.
const FEWEST: usize = 8;

/// The number of samples of each reading, if readings come in blocks of equal values. Whole sweeps of two
/// sides differ by a power of 4.
pub(super) fn samples(y: &[f64], whole_sweeps: bool) -> Option<usize> {
    let fits = |each: usize| {
        let is_power_of_four = each.is_power_of_two() && each.trailing_zeros().is_multiple_of(2);
        y.len().is_multiple_of(each)
            && y.len() / each >= FEWEST
            && (is_power_of_four || !whole_sweeps)
    };
    let changes: Vec<f64> = y.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let share_of = |chosen: &dyn Fn(usize) -> bool, share: f64| {
        let mut chosen: Vec<f64> =
            (0..changes.len()).filter(|&at| chosen(at)).map(|at| changes[at]).collect();
        let place = ((chosen.len() as f64 * share) as usize).min(chosen.len().saturating_sub(1));
        *chosen.select_nth_unstable_by(place, f64::total_cmp).1
    };
    let rounding = ROUNDING * y.iter().fold(0.0, |most: f64, y| most.max(y.abs()));
    // Most blocks differ, and within blocks is noise. Of a number of samples and its multiples, the
    // smallest one has no block twice.
    (2..=MOST).filter(|&each| fits(each)).find(|each| {
        let between = share_of(&|at| (at + 1) % each == 0, 0.4);
        let within = share_of(&|at| (at + 1) % each != 0, 0.9);
        between > rounding.max(STEADY * within)
    })
}

/// Every `each` readings as their mean.
pub(super) fn averaged(y: &[f64], each: usize) -> Vec<f64> {
    y.chunks_exact(each).map(|block| block.iter().sum::<f64>() / each as f64).collect()
}

/// Correlation of two sweeps from which they count as the same sweep.
const SAME: f64 = 0.5;

/// Part of the range of readings within which the greatest readings of all sweeps are.
const AS_BRIGHT: f64 = 0.1;

/// The number of whole sweeps of a smaller image, if readings are such sweeps one after another. The
/// all-on pattern is the `first` one, each pattern has `readings` readings.
pub(super) fn sweeps(y: &[f64], readings: usize, first: usize) -> Option<usize> {
    // The side is a power of two, so the smaller image has a quarter of the pixels, or a quarter of that.
    let counts = [64, 16, 4].into_iter().filter(|&count| y.len().is_multiple_of(count));
    counts.filter(|count| y.len() / count >= FEWEST.max(readings * (first + 1))).find(|count| {
        let blocks: Vec<&[f64]> = y.chunks_exact(y.len() / count).collect();
        blocks[1..].iter().all(|block| {
            correlation(blocks[0], block) > SAME
                && all_on_is_alike(blocks[0], block, readings * first)
        })
    })
}

/// Whether the reading at `at` is the greatest of both sweeps, and as great in both.
fn all_on_is_alike(one: &[f64], other: &[f64], at: usize) -> bool {
    let range = AS_BRIGHT * (one[at] - median(one.to_vec()));
    let is_greatest =
        |sweep: &[f64]| sweep.iter().enumerate().all(|(k, v)| k == at || *v < sweep[at] + range);
    range > 0.0 && (one[at] - other[at]).abs() < range && is_greatest(one) && is_greatest(other)
}

/// Correlation of two sweeps without the tenth of the readings that is farthest from the median, above
/// all the all-on reading.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let middle = median(a.to_vec());
    let mut far: Vec<f64> = a.iter().map(|v| (v - middle).abs()).collect();
    let nine_tenths = far.len() * 9 / 10;
    let limit = *far.select_nth_unstable_by(nine_tenths, f64::total_cmp).1;
    let kept: Vec<(f64, f64)> = a
        .iter()
        .zip(b)
        .filter(|(v, _)| (**v - middle).abs() <= limit)
        .map(|(v, w)| (*v, *w))
        .collect();
    let count = kept.len().max(1) as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| kept.iter().map(of).sum::<f64>() / count;
    let (ma, mb) = (mean(|v| v.0), mean(|v| v.1));
    let sum =
        |of: &dyn Fn(f64, f64) -> f64| kept.iter().map(|(v, w)| of(v - ma, w - mb)).sum::<f64>();
    let scale = (sum(&|v, _| v * v) * sum(&|_, w| w * w)).sqrt();
    if scale > 0.0 { sum(&|v, w| v * w) / scale } else { 0.0 }
}
