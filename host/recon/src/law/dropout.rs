//! Finds drop-outs: runs of a recording in which the detector or its logger delivered no signal.
//!
//! Light is conserved: a pattern and its complement together collect the whole scene, so the pair
//! sum `y+ + y-` is constant up to noise and slow drift, *whatever the scene*. A reading near zero
//! is not enough evidence: the complement of the all-ones pattern is dark, and a point-like scene
//! makes half of all readings dark. A pair is lost if its sum falls far below the local level of
//! pair sums, measured in their own spread, *and* one of its readings is near zero. So a lamp that
//! dims without going out is no drop-out. A lost reading that would have been dark anyway is not
//! found and does no harm.
//!
//! The dark level is the reading of the complement of the all-ones pattern. In a recording without
//! that pattern the lowest reading counts as dark, so the readings of a lamp that dims by far may
//! be taken for a drop-out.
//!
//! Next to a lost pair, a pair that is down by less is lost too: the run started or ended inside
//! the integration time of a reading.

use super::robust::{self, median, running_median};
use std::ops::Range;

/// A run of raw readings in which the detector or its logger delivered no signal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Dropout {
    /// First raw reading of the run, an index into `y`.
    pub start: usize,
    /// Number of raw readings in the run.
    pub length: usize,
    /// Natural rows whose pair the run touches. The measurements leave these rows out.
    pub rows: Vec<u32>,
}

impl Dropout {
    /// The pairs that the run touches.
    pub(super) fn pairs(&self) -> Range<usize> {
        self.start / 2..(self.start + self.length).div_ceil(2)
    }
}

/// Number of pairs for the first estimate of the level. The number is more than twice the longest
/// run (200 readings) that must not count as the level itself, also at both ends of the recording.
const COARSE_PAIRS: usize = 513;
/// A pair below the first level by this share of the level, and by more than noise, is left out of
/// the second estimate.
const SUSPECT_SHARE: f64 = 0.5;
const SUSPECT_SIGMAS: f64 = 4.0;
/// Number of unsuspicious pairs to which the level is then fitted as a line. The number is small,
/// so that the level follows drift, also at both ends of the recording.
const FINE_PAIRS: usize = 63;
/// Least number of (robust) standard deviations by which a lost pair's sum is below the local
/// level.
const LOST_SIGMAS: f64 = 8.0;
/// Least share of the level by which a lost pair is down, however quiet the recording.
const LOST_SHARE: f64 = 0.03;
/// Least number of standard deviations, and least share, for a partly lost pair next to a lost one.
const EDGE_SIGMAS: f64 = 5.0;
const EDGE_SHARE: f64 = 0.005;
/// A reading is near zero if it keeps less than this share of the local mean reading.
const NEAR_ZERO_SHARE: f64 = 0.25;

/// Finds the drop-outs in finite pairs of readings of `rows`, in time order.
pub(super) fn find(rows: &[u32], pairs: &[[f64; 2]]) -> Vec<Dropout> {
    let mut sums: Vec<f64> = pairs.iter().map(|[plus, minus]| plus + minus).collect();
    // A detector of negative polarity gives the same readings with the opposite sign.
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
    // The complement of the all-ones pattern is dark in every recording: its reading near zero says
    // nothing.
    let shows_loss = |k: usize| if rows[k] == 0 { &pairs[k][..1] } else { &pairs[k][..] };
    let lost = |k: usize| {
        fell_by(k, LOST_SIGMAS, LOST_SHARE) && shows_loss(k).iter().any(|&y| near_zero(y, level[k]))
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
        // Only the outermost pairs can be half lost. The other reading of such a pair is whole if
        // it is not near zero and a near-zero reading explains the fall.
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

/// The sum that each pair would have without a drop-out: the line through the medians of the first
/// and the last third of its nearest whole neighbours. `dark` is the sum without light.
pub(super) fn local_level(sums: &[f64], dark: f64) -> Vec<f64> {
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

/// The detector's reading without light: the complement of the all-ones pattern, if it was
/// recorded, else the lowest reading.
pub(super) fn dark_level(rows: &[u32], pairs: &[[f64; 2]], sign: f64) -> f64 {
    let lowest = pairs.iter().flatten().map(|y| sign * y).fold(f64::INFINITY, f64::min);
    let recorded = rows.iter().position(|&row| row == 0).map(|k| sign * pairs[k][1]);
    recorded.unwrap_or(lowest)
}

/// Standard deviation of the pair sums about their level, from the sums *above* the level, because
/// no drop-out is among those.
fn spread(fall: &[f64]) -> f64 {
    robust::deviation(fall.iter().filter(|fall| **fall <= 0.0).map(|fall| -fall))
}

#[cfg(test)]
mod tests;
