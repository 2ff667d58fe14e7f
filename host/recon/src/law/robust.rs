//! Robust statistics of readings in time order.

/// 90 % of normally distributed values above the mean are within this many standard deviations.
const SIGMAS_OF_NINE_TENTHS: f64 = 1.645;

/// Standard deviation, from the magnitudes of deviations. Nine tenths of them are used, not half,
/// because single photons leave most values equal to their median.
pub(super) fn deviation(magnitudes: impl Iterator<Item = f64>) -> f64 {
    let mut magnitudes: Vec<f64> = magnitudes.collect();
    if magnitudes.is_empty() {
        return 0.0;
    }
    let nine_tenths = magnitudes.len() * 9 / 10;
    *magnitudes.select_nth_unstable_by(nine_tenths, f64::total_cmp).1 / SIGMAS_OF_NINE_TENTHS
}

/// The least difference between two values that differ by more than rounding: one photon, or one count of a
/// converter. Where single photons are counted, most deviations are 0 or 1 of them.
pub(super) fn step(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let largest = values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let rounding = 8.0 * f64::EPSILON * largest;
    let steps = sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|&step| step > rounding);
    steps.reduce(f64::min).unwrap_or(0.0)
}

/// The median, or the upper of the two middle values; 0 of none.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Median of the `window` values nearest to each value; the window stays inside the data at both
/// ends.
pub(super) fn running_median(values: &[f64], window: usize) -> Vec<f64> {
    let window = window.min(values.len());
    if window == 0 {
        return Vec::new();
    }
    let mut sorted = values[..window].to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let mut start = 0;
    (0..values.len())
        .map(|k| {
            let wanted = k.saturating_sub(window / 2).min(values.len() - window);
            while start < wanted {
                let place =
                    |sorted: &[f64], v: f64| sorted.partition_point(|s| s.total_cmp(&v).is_lt());
                sorted.remove(place(&sorted, values[start]));
                let new = values[start + window];
                sorted.insert(place(&sorted, new), new);
                start += 1;
            }
            sorted[window / 2]
        })
        .collect()
}

/// Correlation of the changes of two series from one value to the next. Changes do not know slow
/// drift, and the largest hundredth of them (at least three) counts as the next largest one, so that
/// single wild readings have no weight.
pub(super) fn correlation_of_changes(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (tamed_changes(a), tamed_changes(b));
    let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let scale = (sum(&a, &a) * sum(&b, &b)).sqrt();
    if scale > 0.0 { sum(&a, &b) / scale } else { 0.0 }
}

fn tamed_changes(values: &[f64]) -> Vec<f64> {
    let mut changes: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let wild = (changes.len() / 100).max(3);
    if changes.len() <= 2 * wild {
        return changes;
    }
    let mut sorted = changes.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let (least, most) = (sorted[wild], sorted[sorted.len() - 1 - wild]);
    let unit = (most - least).abs().max(f64::MIN_POSITIVE);
    changes.iter_mut().for_each(|change| *change = change.clamp(least, most) / unit);
    let mean = changes.iter().sum::<f64>() / changes.len() as f64;
    changes.iter_mut().for_each(|change| *change -= mean);
    changes
}
