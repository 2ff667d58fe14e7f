//! Readings of patterns alone, and differences: one value a pattern.

use super::ends::ends;
use super::robust::{deviation, median, step};
use super::{
    Broken, Claim, Doubt, Explanation, Extreme, Form, Impossible, OVERLOAD, Outlier, Places,
    Reading, few, repeats, trend,
};
use crate::measurements::{MeasurementError, Measurements};
use crate::{Rows, order};

/// Share of the all-on value by which a value must break the law, and number of standard deviations of
/// the finest patterns.
const LAW_SHARE: f64 = 0.05;
const LAW_SIGMAS: f64 = 8.0;

/// The same number of standard deviations where a tenth of the values breaks the law.
const MANY_SIGMAS: f64 = 5.0;

/// How many times more the all-on difference is than any other where an order is named.
const STANDS_OUT: f64 = 1.5;

/// Whether these differences of `rows` surely keep the law, at the cost of one look at each. If not,
/// [`read`](super::read) says whether they break it.
#[must_use]
pub fn keeps_the_law(rows: &[u32], d: &[f64]) -> bool {
    let largest = d.iter().fold(0.0_f64, |most, d| most.max(d.abs()));
    match rows.iter().position(|&row| row == 0) {
        Some(first) => largest < OVERLOAD && largest <= d[first],
        None => largest < OVERLOAD,
    }
}

/// Standard deviation of the finer half of the patterns, an upper bound of the noise. It is known to a
/// [`step`] only.
fn noise(rows: &Rows, values: &[f64]) -> f64 {
    let fine = order::positions_by_sequency(rows);
    let fine: Vec<f64> = fine[fine.len() / 2..].iter().map(|&k| values[k]).collect();
    let middle = median(fine.clone());
    let step = step(&fine);
    deviation(fine.iter().map(|v| (v - middle).abs() + step))
}

pub(super) fn read_single(
    rows: &Rows,
    y: &[f64],
    claim: Claim,
    places: Option<Places<'_>>,
) -> Result<Reading, MeasurementError> {
    let mut doubts = Vec::new();
    let mut outliers = Vec::new();
    let first = rows.iter().position(|&row| row == 0);
    doubts.extend(repeated(y, first, claim, places));
    if let (Some(first), true) = (first, doubts.is_empty()) {
        let on = y[first];
        let usual = median(y.to_vec());
        let (share, sigma) = (LAW_SHARE * 2.0 * (on - usual).abs(), noise(rows, y));
        let beyond = |sigmas: f64| {
            let limit = on + share.max(sigmas * sigma);
            (0..y.len()).filter(|&k| k != first && y[k] > limit).collect::<Vec<usize>>()
        };
        let below = y.iter().filter(|&&y| y < on - share.max(MANY_SIGMAS * sigma)).count();
        let many = beyond(MANY_SIGMAS).len();
        let above = beyond(LAW_SIGMAS);
        if above.len() <= few(y.len()) && many <= y.len() / 10 {
            outliers = above_all_on(rows, y, &above, on);
            doubts.extend(clipped(y, on));
        } else {
            let broken = Broken { readings: y.len(), above: many, below: 0 };
            let explanation = match below <= few(y.len()) {
                true => Explanation::Inverted,
                false => Explanation::Unknown,
            };
            doubts.push(Doubt::Form { claimed: Form::Single, broken, explanation });
        }
    }
    let (rows, y) = without(rows, y, &outliers);
    let mut measurements = Measurements::from_single(&rows, &y)?;
    let (mut dark_level, mut lamp) = (None, None);
    if doubts.is_empty() {
        let mut lifted = measurements.clone();
        if let Some(level) = lifted.remove_dark_level() {
            // Every reading has the dark level in it.
            let least = y.iter().copied().fold(f64::INFINITY, f64::min);
            let greatest = y.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let tolerance = (LAW_SHARE * (greatest - least)).max(LAW_SIGMAS * noise(&rows, &y));
            if level <= least + tolerance {
                (measurements, dark_level) = (lifted, Some(level));
            } else {
                doubts.push(Doubt::NoDarkLevel { level, least });
            }
        }
        lamp = trend::lamp(&y);
    }
    Ok(Reading { dark_level, lamp, ..Reading::of(measurements, outliers, doubts) })
}

pub(super) fn read_differences(
    rows: &Rows,
    d: &[f64],
    claim: Claim,
    places: Option<Places<'_>>,
) -> Result<Reading, MeasurementError> {
    let mut doubts = Vec::new();
    let mut outliers = Vec::new();
    let first = rows.iter().position(|&row| row == 0);
    if !keeps_the_law(rows, d) || claim.side_guessed {
        doubts.extend(repeated(d, first, claim, places));
    }
    if let (Some(first), true) = (first, doubts.is_empty() && !keeps_the_law(rows, d)) {
        let on = d[first];
        let tolerance = (LAW_SHARE * on.abs()).max(LAW_SIGMAS * noise(rows, d));
        let beyond = |limit: f64| {
            (0..d.len())
                .filter(|&k| k != first && d[k].abs() > limit + tolerance)
                .collect::<Vec<_>>()
        };
        let larger = beyond(on.abs());
        let opposite = on < -tolerance && larger.len() <= few(d.len());
        let broken = Broken { readings: d.len(), above: larger.len(), below: 0 };
        let says = |explanation| Doubt::Form { claimed: Form::Differences, broken, explanation };
        let others =
            (0..d.len()).filter(|k| *k != first && !larger.contains(k)).map(|k| d[k].abs());
        let is_all_on = on.abs() * (1.0 + LAW_SHARE) >= others.fold(0.0, f64::max);
        if larger.len() > few(d.len())
            || (!larger.is_empty() && !is_all_on && d.len() > super::FEWEST_EQUAL)
        {
            doubts.push(says(
                brightest(d, first)
                    .map_or(Explanation::Unknown, |all_on| Explanation::Order { all_on }),
            ));
        } else if opposite && d.len() > few(d.len()) + 1 {
            let broken = Broken { above: d.len() - 1, ..broken };
            let explanation = Explanation::Inverted;
            doubts.push(Doubt::Form { claimed: Form::Differences, broken, explanation });
        } else {
            outliers = above_all_on(rows, d, &larger, on);
        }
    }
    let (rows, d) = without(rows, d, &outliers);
    let measurements = Measurements::from_differential(&rows, &d)?;
    Ok(Reading::of(measurements, outliers, doubts))
}

/// Values that are above that of the all-on pattern.
fn above_all_on(rows: &Rows, values: &[f64], which: &[usize], all_on: f64) -> Vec<Outlier> {
    let why = Impossible::AboveAllOn { all_on };
    let of =
        |&reading: &usize| Outlier { reading, value: values[reading], row: rows[reading], why };
    which.iter().map(of).collect()
}

/// The position of a difference that stands out from all others, if there is one.
fn brightest(d: &[f64], first: usize) -> Option<usize> {
    let at = (0..d.len()).max_by(|&a, &b| d[a].total_cmp(&d[b]))?;
    let others = (0..d.len()).filter(|&k| k != at).map(|k| d[k].abs()).fold(0.0, f64::max);
    (at != first && d[at] > STANDS_OUT * others).then_some(at)
}

/// What repeats itself in values whose number gave the side of the image.
fn repeated(
    values: &[f64],
    first: Option<usize>,
    claim: Claim,
    places: Option<Places<'_>>,
) -> Option<Doubt> {
    let first = Places::of(places, first.filter(|_| claim.side_guessed)?);
    let recorded = Places::filled(places, values);
    let explanation = match repeats::sweeps(&recorded, 1, first) {
        Some(count) => Explanation::Sweeps { count },
        None => Explanation::Samples { each: repeats::samples(&recorded, true)? },
    };
    Some(Doubt::Repeated { readings: values.len(), explanation })
}

/// Whether many readings are equal to that of the all-on pattern, and no scene of a single point explains
/// that.
fn clipped(y: &[f64], on: f64) -> Option<Doubt> {
    let [least, most] = ends(y);
    let is_cut = on == most.value && most.is_pile && most.equal + least.equal < y.len();
    is_cut.then(|| most.clipped(y.len(), Extreme::Greatest))
}

/// Rows and values without outliers.
fn without(rows: &Rows, values: &[f64], outliers: &[Outlier]) -> (Rows, Vec<f64>) {
    if outliers.is_empty() {
        return (rows.clone(), values.to_vec());
    }
    let kept = |k: &usize| outliers.iter().all(|outlier| outlier.reading != *k);
    let kept: Vec<usize> = (0..values.len()).filter(kept).collect();
    let side = rows.side();
    let values = kept.iter().map(|&k| values[k]).collect();
    (Rows::trusted(side, kept.iter().map(|&k| rows[k]).collect()), values)
}
