//! A frame as seen from the past: how likely motions and speeds are.

use super::motion::Shift;
use super::past::{Past, median};
use super::rows::Spectrum;
use crate::basis::Basis;
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
    pub fn new(past: &'p Past, problem: &'p Problem<'p>, speed_px: Option<f64>) -> View<'p> {
        let squares: Vec<f32> = problem.prior.scale.iter().map(|scale| scale * scale).collect();
        View {
            spectrum: &past.spectrum,
            problem,
            noise: median(&past.noises),
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
                let square = kept[row] * kept[row];
                let variance = square * variance[row] + (1.0 - square) * self.prior[row];
                (kept[row] * guess.mean[row], variance)
            });
            // One more parameter must gain what the Bayesian information criterion asks for,
            // and the best of several speeds more than that.
            Likely { gain: if speed_px > 0.0 { gain - cost } else { gain }, speed_px }
        };
        let all = self.speeds_px.iter().map(at);
        all.reduce(|a, b| if b.gain > a.gain { b } else { a })
            .unwrap_or(Likely { gain: f32::MIN, speed_px: 0.0 })
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
