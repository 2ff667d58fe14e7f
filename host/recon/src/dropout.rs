//! Dropouts: stretches of a recording in which the detector or its logger delivered nothing.
//!
//! The one law: light is conserved. A pattern and its complement together always collect the whole scene,
//! so the pair sum `y+ + y-` is constant up to noise and slow drift *whatever the scene*; a reading near
//! zero alone proves nothing (the complement of the all-ones pattern is dark, and a point-like scene
//! makes half of all readings dark). A pair is lost if its sum falls far below the local level of pair
//! sums, measured in their own spread, *and* one of its readings is near zero. A lamp that dims
//! without going out therefore is no dropout, and losing a reading that was dark anyway is none either: it
//! cannot be seen and does no harm.
//!
//! Pairs beside a lost one that are down by less (a run that starts or ends inside a reading's
//! integration time) go with it.

use std::ops::Range;

/// A run of raw readings in which the detector or its logger fell out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Dropout {
    /// First raw reading of the run, an index into `y`.
    pub start: usize,
    /// Raw readings of the run.
    pub length: usize,
    /// Natural rows whose pair the run touches; they are left out of the measurements.
    pub rows: Vec<u32>,
}

impl Dropout {
    /// The pairs that the run touches.
    pub(crate) fn pairs(&self) -> Range<usize> {
        self.start / 2..(self.start + self.length).div_ceil(2)
    }
}

/// Pairs over which a first level is taken: more than twice the longest run (200 readings) that must not pass
/// for the level itself, at either end of the recording too.
const COARSE_PAIRS: usize = 513;
/// A pair that is under the first level by this share of it, and by more than noise, says nothing about the level.
const SUSPECT_SHARE: f64 = 0.5;
const SUSPECT_SIGMAS: f64 = 4.0;
/// Pairs, of those that are not suspect, through which the level is then laid as a line: few, so that it
/// follows drift, at both ends of the recording too.
const FINE_PAIRS: usize = 63;
/// How many standard deviations (robust) under the local level a lost pair's sum is at least.
const LOST_SIGMAS: f64 = 8.0;
/// A lost pair is down by at least this share of the level, however quiet the recording.
const LOST_SHARE: f64 = 0.03;
/// The same two for a pair beside a lost one, partly down.
const EDGE_SIGMAS: f64 = 5.0;
const EDGE_SHARE: f64 = 0.005;
/// A reading is near zero if it keeps less than this share of the local mean reading.
const NEAR_ZERO_SHARE: f64 = 0.25;
/// Of normally distributed values above the mean, 90 % are within this many standard deviations.
const SIGMAS_OF_NINE_TENTHS: f64 = 1.645;

/// Finds the dropouts in finite readings `y = [+, -, +, -, ...]` of `rows`, in time order.
pub(crate) fn find(rows: &[u32], y: &[f64]) -> Vec<Dropout> {
    let pairs = y.as_chunks::<2>().0;
    let mut sums: Vec<f64> = pairs.iter().map(|[plus, minus]| plus + minus).collect();
    // A detector of negative polarity is the same thing upside down.
    let sign = if median(sums.clone()) < 0.0 { -1.0 } else { 1.0 };
    sums.iter_mut().for_each(|sum| *sum *= sign);

    let dark = dark_level(rows, pairs, sign);
    let level = local_level(&sums, 2.0 * dark);
    let fall: Vec<f64> = level.iter().zip(&sums).map(|(level, sum)| level - sum).collect();
    let sigma = spread(&fall);

    let near_zero = |reading: f64, level: f64| {
        let mean = level / 2.0;
        let under = |zero: f64| sign * reading - zero < NEAR_ZERO_SHARE * (mean - zero);
        under(0.0) || under(dark)
    };
    let fell_by = |k: usize, sigmas: f64, share: f64| {
        fall[k] > (sigmas * sigma).max(share * (level[k] - 2.0 * dark).abs())
    };
    let lost = |k: usize| {
        fell_by(k, LOST_SIGMAS, LOST_SHARE) && pairs[k].iter().any(|&y| near_zero(y, level[k]))
    };
    let partly = |k: usize| fell_by(k, EDGE_SIGMAS, EDGE_SHARE);

    let mut found = Vec::new();
    let mut k = 0;
    while k < pairs.len() {
        if !lost(k) {
            k += 1;
            continue;
        }
        let (mut first, mut last) = (k, k);
        while last + 1 < pairs.len() && lost(last + 1) {
            last += 1;
        }
        if first > 0 && partly(first - 1) {
            first -= 1;
        }
        if last + 1 < pairs.len() && partly(last + 1) {
            last += 1;
        }
        // Only the outermost pairs can be half lost: their other reading is whole if it is not near zero
        // and a near-zero one explains the fall.
        let whole = |k: usize, reading: usize| {
            let [this, other] = [pairs[k][reading], pairs[k][1 - reading]];
            !near_zero(this, level[k]) && near_zero(other, level[k])
        };
        let start = 2 * first + usize::from(whole(first, 0));
        let end = 2 * last + 2 - usize::from(whole(last, 1));
        found.push(Dropout { start, length: end - start, rows: rows[first..=last].to_vec() });
        k = last + 1;
    }
    found
}

/// What each pair would sum to were it whole: the line through the medians of the first and the last third of its
/// nearest whole neighbours. `dark` is the sum without light.
fn local_level(sums: &[f64], dark: f64) -> Vec<f64> {
    let coarse = running_median(sums, COARSE_PAIRS);
    let fall: Vec<f64> = coarse.iter().zip(sums).map(|(coarse, sum)| coarse - sum).collect();
    let sigma = spread(&fall);
    let suspect =
        |k: usize| fall[k] > SUSPECT_SIGMAS * sigma && fall[k] > SUSPECT_SHARE * (coarse[k] - dark);
    let whole: Vec<usize> = (0..sums.len()).filter(|&k| !suspect(k)).collect();
    let window = FINE_PAIRS.min(whole.len());
    let third = window / 3;
    if third == 0 {
        return coarse;
    }
    let whole_sums: Vec<f64> = whole.iter().map(|&k| sums[k]).collect();
    let medians = running_median(&whole_sums, third);
    (0..sums.len())
        .map(|k| {
            let nearest = whole.partition_point(|&w| w < k);
            let start = nearest.saturating_sub(window / 2).min(whole.len() - window);
            let (first, last) = (start + third / 2, start + window - third + third / 2);
            let slope = (medians[last] - medians[first]) / (whole[last] - whole[first]) as f64;
            medians[first] + slope * (k as f64 - whole[first] as f64)
        })
        .collect()
}

/// What the detector reads without light: the complement of the all-ones pattern shows it, if it was
/// recorded; the lowest reading stands in for it otherwise.
fn dark_level(rows: &[u32], pairs: &[[f64; 2]], sign: f64) -> f64 {
    let lowest = pairs.iter().flatten().map(|y| sign * y).fold(f64::INFINITY, f64::min);
    let recorded = rows.iter().position(|&row| row == 0).map(|k| sign * pairs[k][1]);
    recorded.unwrap_or(lowest)
}

/// Standard deviation of the pair sums about their level, from those *above* it: no dropout is among them, and
/// nine tenths, not half, because single photons leave most sums equal to their median.
fn spread(fall: &[f64]) -> f64 {
    let mut above: Vec<f64> = fall.iter().filter(|fall| **fall <= 0.0).map(|fall| -fall).collect();
    if above.is_empty() {
        return 0.0;
    }
    let nine_tenths = above.len() * 9 / 10;
    *above.select_nth_unstable_by(nine_tenths, f64::total_cmp).1 / SIGMAS_OF_NINE_TENTHS
}

fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Median of the `window` values nearest to each, the window staying inside the data at both ends.
fn running_median(values: &[f64], window: usize) -> Vec<f64> {
    let window = window.min(values.len());
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

#[cfg(test)]
mod tests;
