//! A frame as seen from the past: how likely motions and speeds are.

use super::motion::Shift;
use super::past::Past;
use super::rows::Spectrum;
use crate::Rows;
use crate::basis::Basis;
use crate::order::positions_by_sequency;
use crate::reconstruct::Problem;

/// Speeds to try, in pixels a frame: how far parts of the scene move that the common motion leaves
/// out.
const SPEEDS_PX: [f32; 9] = [0.0, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0];

/// A prediction of all rows before the frame is seen, and what is known of each before the scene
/// has changed.
pub(super) struct Guess {
    pub shift: Shift,
    pub mean: Vec<f32>,
    pub information: Vec<f32>,
}

impl Guess {
    pub fn moved(&self, spectrum: &Spectrum, shift: Shift) -> Self {
        let operator = spectrum.shift(shift);
        let (mean, information) =
            (operator.apply(&self.mean), operator.variance(&self.information));
        Self { shift, mean, information }
    }

    /// Variance of each row.
    pub fn variance(&self, prior: &[f32]) -> Vec<f32> {
        let each = self.information.iter().zip(prior);
        each.map(|(known, prior)| (known + prior.recip()).recip()).collect()
    }
}

/// How likely a prediction is with its likeliest speed: the logarithm, up to a constant of the
/// frame.
pub(super) struct Likely {
    pub gain: f32,
    pub speed_px: f32,
}

/// Variance of a row of which the share `kept` stays.
fn aged(kept: f32, variance: f32, prior: f32) -> f32 {
    let square = kept * kept;
    square * variance + (1.0 - square) * prior
}

/// Readings in the first band of rows after the mean, and in the largest: each band has twice as
/// many as the one before.
const BANDS: (usize, usize) = (8, 128);

/// Standard errors above which the mean of some squares is no chance.
const NO_CHANCE: f32 = 2.0;

/// Squares of what a prediction misses in a band of rows, and their expected squares.
#[derive(Default)]
struct Squares {
    count: usize,
    found: f32,
    expected: f32,
}

impl Squares {
    fn add(&mut self, found: f32, expected: f32) {
        self.count += 1;
        self.found += found;
        self.expected += expected;
    }

    /// By how much the variance of a row is larger than expected; 0 where that may be chance.
    fn excess(&self) -> f32 {
        let count = self.count as f32;
        let no_chance = 1.0 + NO_CHANCE * (2.0 / count).sqrt();
        if self.found > no_chance * self.expected {
            (self.found - self.expected) / count
        } else {
            0.0
        }
    }
}

/// A frame as seen from the past.
pub(super) struct View<'p> {
    pub spectrum: &'p Spectrum,
    pub problem: &'p Problem<'p>,
    pub noise: f32,
    /// Expected square of each row.
    pub prior: Vec<f32>,
    pub speeds_px: Vec<f32>,
    pub frequencies: Vec<f32>,
}

impl<'p> View<'p> {
    pub fn new(
        past: &'p Past,
        problem: &'p Problem<'p>,
        noise: f32,
        speed_px: Option<f64>,
    ) -> View<'p> {
        let squares: Vec<f32> = problem.prior.scale.iter().map(|scale| scale * scale).collect();
        View {
            spectrum: &past.spectrum,
            problem,
            noise,
            prior: past.spectrum.rows(&squares),
            speeds_px: speed_px.map_or_else(|| SPEEDS_PX.to_vec(), |speed| vec![speed as f32]),
            frequencies: Basis::Dct.frequencies(past.side),
        }
    }

    /// Share of each row that stays at this speed.
    pub fn kept(&self, speed_px: f32) -> Vec<f32> {
        let n = self.problem.side.pixels() as f32;
        let stays = |(scale, f): (&f32, &f32)| {
            let phase = std::f32::consts::PI * f.max(1.0) * speed_px / n;
            scale * scale * (-0.5 * phase * phase).exp()
        };
        let stays: Vec<f32> =
            self.problem.prior.scale.iter().zip(&self.frequencies).map(stays).collect();
        let rows = self.spectrum.rows(&stays);
        rows.iter().zip(&self.prior).map(|(stays, prior)| (stays / prior).min(1.0)).collect()
    }

    /// The readings of all rows but the mean, with the weight of each.
    pub fn weighted(&self, guess: &Guess) -> Vec<(usize, f32, f32)> {
        let (noise, variance) = (self.noise.powi(2), guess.variance(&self.prior));
        let of = |(&row, &value): (&u32, &f32)| {
            let row = row as usize;
            (row, value, 1.0 / (noise + variance[row]))
        };
        let readings = self.problem.rows.iter().zip(&self.problem.values);
        readings.filter(|(row, _)| **row != 0).map(of).collect()
    }

    /// The likeliest speed.
    pub fn likeliest(&self, guess: &Guess) -> Likely {
        let variance = guess.variance(&self.prior);
        let cost = 0.5 * (self.problem.rows.len() as f32).ln() + (self.speeds_px.len() as f32).ln();
        let at = |&speed_px: &f32| {
            let kept = self.kept(speed_px);
            let gain = self.gain(|row| {
                (kept[row] * guess.mean[row], aged(kept[row], variance[row], self.prior[row]))
            });
            // One more parameter must gain what the Bayesian information criterion asks for,
            // and the best of several speeds more than that.
            Likely { gain: if speed_px > 0.0 { gain - cost } else { gain }, speed_px }
        };
        let all = self.speeds_px.iter().map(at);
        all.reduce(|a, b| if b.gain > a.gain { b } else { a })
            .unwrap_or(Likely { gain: f32::MIN, speed_px: 0.0 })
    }

    /// How many times larger than expected the variance of each row is, 1 or more, after the scene
    /// has aged at the likeliest speed. One speed for all rows misses how a scene turns, or how a
    /// part of it moves; the readings show by how much, for the rows of each scale.
    pub fn surprise(&self, past: &Past, guess: &Guess, kept: &[f32]) -> Vec<f32> {
        let noise = self.noise.powi(2);
        let variances = guess.variance(&self.prior);
        let stays = guess.shift == Shift::default();
        let expected = |row: usize| {
            // If nothing has moved, the rows themselves are what is expected: the image lacks what
            // its prior has smoothed away.
            let known = &past.poses[0].known;
            match known.aged(row, kept[row], self.prior[row]).filter(|_| stays) {
                Some([value, readings, changes]) => (value, readings * noise + changes),
                None => {
                    (kept[row] * guess.mean[row], aged(kept[row], variances[row], self.prior[row]))
                }
            }
        };
        let mut reading = vec![None; self.prior.len()];
        for (&row, value) in self.problem.rows.iter().zip(&self.problem.values) {
            reading[row as usize] = Some(*value);
        }
        let by_sequency = positions_by_sequency(&Rows::natural(self.problem.side));
        let mut surprise = vec![1.0; self.prior.len()];
        let (mut rows, mut size, mut excess) = (Vec::new(), 1, 0.0);
        let mut squares = Squares::default();
        for (at, &row) in std::iter::once(&0).chain(&by_sequency).enumerate() {
            rows.push(row);
            let (mean, variance) = expected(row);
            if let Some(value) = reading[row] {
                squares.add((value - mean).powi(2), variance + noise);
            }
            let is_last = at == by_sequency.len();
            if squares.count == size || is_last {
                if squares.count * 2 >= size {
                    excess = squares.excess();
                }
                for row in rows.drain(..) {
                    surprise[row] = 1.0 + excess / expected(row).1;
                }
                (size, squares) = (BANDS.0.max((2 * size).min(BANDS.1)), Squares::default());
            }
        }
        surprise
    }

    /// How likely the frame is without a past.
    pub fn without_a_past(&self) -> f32 {
        self.gain(|row| (0.0, self.prior[row]))
    }

    /// Logarithm of the likelihood of the readings, given mean and variance of each row.
    pub fn gain(&self, of_row: impl Fn(usize) -> (f32, f32)) -> f32 {
        let readings = self.problem.rows.iter().zip(&self.problem.values);
        let each = readings.filter(|(row, _)| **row != 0).map(|(&row, value)| {
            let (mean, variance) = of_row(row as usize);
            let variance = variance + self.noise.powi(2);
            -0.5 * f64::from(variance.ln() + (value - mean).powi(2) / variance)
        });
        each.sum::<f64>() as f32
    }
}
