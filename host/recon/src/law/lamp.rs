//! How steady the light was: pattern and complement together collect the light of the whole scene.

use super::robust::{deviation, median};

/// The least error of a drift, as a share of the differences, that is told.
const LEAST: f64 = 0.01;
/// Fewest pairs that say how steady a lamp is.
const FEWEST: usize = 16;

/// The lamp during a sweep of pairs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lamp {
    /// Standard deviation of the sums of pattern and complement about their level, as a share of the level. It holds the noise
    /// of both readings, and flicker.
    pub spread: f64,
    /// From the lowest to the highest level during the sweep, as a share of the middle one.
    pub drift: f64,
    /// Whether the error of the differences by the drift is larger than their noise: it limits the image.
    pub limits: bool,
}

impl Lamp {
    /// The lamp of pairs, of which `whole` are whole, with their level; `all_on` is the pattern whose difference is its sum.
    pub(super) fn of(
        pairs: &[[f64; 2]],
        level: &[f64],
        whole: &[usize],
        all_on: Option<usize>,
    ) -> Option<Self> {
        if whole.len() < FEWEST {
            return None;
        }
        let middle = median(whole.iter().map(|&k| level[k]).collect());
        if middle <= 0.0 {
            return None;
        }
        let off = |k: usize| (pairs[k][0] + pairs[k][1] - level[k]).abs();
        let noise = deviation(whole.iter().map(|&k| off(k)));
        // Light that noise hides says nothing of its lamp.
        if noise >= middle {
            return None;
        }
        let least = whole.iter().map(|&k| level[k]).fold(f64::INFINITY, f64::min);
        let most = whole.iter().map(|&k| level[k]).fold(f64::NEG_INFINITY, f64::max);
        let others = || whole.iter().copied().filter(|&k| Some(k) != all_on);
        let difference = |k: usize| pairs[k][0] - pairs[k][1];
        let squares = |of: &dyn Fn(usize) -> f64| others().map(|k| of(k).powi(2)).sum::<f64>();
        let signal = squares(&difference);
        let error = squares(&|k| difference(k) * (level[k] / middle - 1.0));
        let limits =
            error > others().count() as f64 * noise * noise && error > LEAST * LEAST * signal;
        Some(Self { spread: noise / middle, drift: (most - least) / middle, limits })
    }
}
