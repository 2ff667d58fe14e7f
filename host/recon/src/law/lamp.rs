//! How steady the light was.
//!
//! Pattern and complement together collect the light of the whole scene. Of readings without complements, the
//! all-on pattern says the same, if it is shown again and again.

use super::Form;
use super::robust::{deviation, median, running_median};

/// The least error of a drift, as a share of the differences, that is told.
const LEAST: f64 = 0.01;
/// Fewest pairs that say how steady a lamp is.
const FEWEST: usize = 16;
/// Window of a running median that follows the steps of a lamp.
const STEPPED: usize = 63;
/// Fewest all-on readings that do.
const FEWEST_ALL_ON: usize = 4;

/// The lamp during a sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lamp {
    /// What says so.
    pub by: Witness,
    /// Standard deviation of the sums of pattern and complement, or of the all-on readings, about their level, as a share
    /// of the level. It holds the noise of the readings, and flicker.
    pub spread: f64,
    /// From the lowest to the highest level during the sweep, as a share of the middle one.
    pub drift: f64,
    /// Whether the error of the differences by the drift is larger than their noise: it limits the image.
    pub limits: bool,
}

/// What tells how steady a lamp was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Witness {
    /// The sums of pattern and complement.
    Sums,
    /// Readings of the all-on pattern among the others: their number.
    AllOn(usize),
    /// The level of readings of patterns alone, where it drifts.
    Level,
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
        let sums: Vec<f64> = whole.iter().map(|&k| pairs[k][0] + pairs[k][1]).collect();
        // The level has no steps. A running median has them, and no slope at the ends.
        let stepped = running_median(&sums, STEPPED);
        let off = |by: &dyn Fn(usize) -> f64| {
            deviation(sums.iter().enumerate().map(|(at, sum)| (sum - by(at)).abs()))
        };
        let noise = off(&|at| level[whole[at]]).min(off(&|at| stepped[at]));
        // Light that noise hides says nothing of its lamp.
        if noise >= middle {
            return None;
        }
        let levels = || whole.iter().map(|&k| level[k]);
        let others = || whole.iter().copied().filter(|&k| Some(k) != all_on);
        let difference = |k: usize| pairs[k][0] - pairs[k][1];
        let squares = |of: &dyn Fn(usize) -> f64| others().map(|k| of(k).powi(2)).sum::<f64>();
        let signal = squares(&difference);
        let error = squares(&|k| difference(k) * (level[k] / middle - 1.0));
        let limits = is_limit(error, signal, others().count() as f64 * noise * noise);
        let drift = range(levels()) / middle;
        Some(Self { by: Witness::Sums, spread: noise / middle, drift, limits })
    }
}

/// Whether the energy of an error is more than that of the noise, and is seen in the signal.
fn is_limit(error: f64, signal: f64, noise: f64) -> bool {
    error > noise && error > LEAST * LEAST * signal
}

fn range(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let least = values.clone().fold(f64::INFINITY, f64::min);
    values.fold(f64::NEG_INFINITY, f64::max) - least
}

/// Readings of the all-on pattern among readings without complements: they follow the lamp.
#[derive(Debug, Clone, PartialEq)]
pub struct LampReadings {
    /// Their places in time order.
    places: Vec<usize>,
    readings: Vec<f64>,
    middle: f64,
}

impl LampReadings {
    /// Whether the all-on pattern is shown often enough, at these places of `count`: four times or more, from the first
    /// quarter of the sweep to the last one.
    #[must_use]
    pub fn are_enough(places: &[usize], count: usize) -> bool {
        places.len() >= FEWEST_ALL_ON
            && places.first().is_some_and(|&first| 4 * first < count)
            && places.last().is_some_and(|&last| 4 * last >= 3 * count)
    }

    /// The readings at these places, which rise, of all readings in time order; `None` if they are not enough, or are no
    /// light.
    #[must_use]
    pub fn new(places: Vec<usize>, y: &[f64]) -> Option<Self> {
        if !Self::are_enough(&places, y.len()) {
            return None;
        }
        let readings: Vec<f64> = places.iter().map(|&at| y[at]).collect();
        let middle = median(readings.clone());
        (middle > 0.0).then_some(Self { places, readings, middle })
    }

    /// The lamp's level at this place, 1 in the middle: between two readings on the line from one to the next.
    #[must_use]
    pub fn level(&self, at: usize) -> f64 {
        let after = self.places.partition_point(|&place| place < at).min(self.places.len() - 1);
        let before = after.saturating_sub(1);
        let (from, to) = (self.places[before], self.places[after]);
        let share = match to > from {
            true => (at.clamp(from, to) - from) as f64 / (to - from) as f64,
            false => 0.0,
        };
        let level = self.readings[before] + share * (self.readings[after] - self.readings[before]);
        level / self.middle
    }

    /// The readings as under a steady lamp. A level below a tenth of the middle one is too little light to say how much.
    #[must_use]
    pub fn divided(&self, y: &[f64]) -> Vec<f64> {
        y.iter().enumerate().map(|(at, reading)| reading / self.level(at).max(0.1)).collect()
    }

    /// How steady the lamp was during these readings of patterns alone, or differences.
    #[must_use]
    pub fn lamp(&self, y: &[f64], form: Form) -> Option<Lamp> {
        // What a reading is off the line between its neighbours, which hold noise as well.
        let off = self.readings.windows(3).map(|r| (f64::midpoint(r[0], r[2]) - r[1]).abs());
        let noise = deviation(off) / 1.5_f64.sqrt();
        if noise >= self.middle {
            return None;
        }
        // A difference is twice the reading, less the all-on reading.
        let (gain, offset) = match form {
            Form::Single => (2.0, self.middle),
            _ => (1.0, 0.0),
        };
        let others = || {
            let is_other = |at: &usize| self.places.binary_search(at).is_err();
            (0..y.len()).filter(is_other).filter(|&at| !y[at].is_nan())
        };
        let squares = |of: &dyn Fn(usize) -> f64| others().map(|at| of(at).powi(2)).sum::<f64>();
        let signal = squares(&|at| gain * y[at] - offset);
        let error = squares(&|at| gain * y[at] * (self.level(at) - 1.0));
        // The noise of the all-on readings moves the level, too.
        let limits = is_limit(error, signal, others().count() as f64 * (gain * noise).powi(2));
        let levels = self.readings.windows(2).map(|r| f64::midpoint(r[0], r[1]));
        let drift = range(levels) / self.middle;
        let by = Witness::AllOn(self.places.len());
        Some(Lamp { by, spread: noise / self.middle, drift, limits })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_level_lies_between_the_readings_of_the_all_on_pattern() {
        let y = [2.0, 0.3, 0.9, 4.0, 1.0, 6.0, 1.0, 1.0, 8.0, 1.0];
        let lamp = LampReadings::new(vec![0, 3, 5, 8], &y).unwrap();
        let levels: Vec<f64> = (0..10).map(|at| 6.0 * lamp.level(at)).collect();
        let expected =
            [2.0, 8.0 / 3.0, 10.0 / 3.0, 4.0, 5.0, 6.0, 20.0 / 3.0, 22.0 / 3.0, 8.0, 8.0];
        assert!(levels.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{levels:?}");
        let divided = lamp.divided(&y);
        assert!([0, 3, 5, 8].iter().all(|&at| (divided[at] - 6.0).abs() < 1e-12), "{divided:?}");
        assert!((divided[4] - 1.2).abs() < 1e-12, "{divided:?}");
        // Too few, at one end only, and no light.
        for places in [vec![0, 5, 9], vec![0, 1, 2, 3], vec![5, 6, 7, 9]] {
            assert_eq!(LampReadings::new(places.clone(), &y), None, "{places:?}");
        }
        assert_eq!(LampReadings::new(vec![0, 3, 5, 8], &[0.0; 10]), None);
    }
}
