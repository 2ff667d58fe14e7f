//! What the frames so far have shown: rows, read at one position of the scene or at several.

use super::motion::Shift;
use super::rows::Spectrum;
use super::{FALLOFF, LEAST_NOISE};
use crate::basis::Basis;
use crate::reconstruct::selection::noise_level;
use crate::reconstruct::{NoiseLevel, Problem};
use crate::{Measurements, Rows, Side};
use std::collections::VecDeque;

/// Number of frames of whose estimates of the noise the median counts.
const NOISES: usize = 8;

/// The state, in orthonormal units over `unit`.
#[derive(Debug, Clone)]
pub(super) struct Past {
    pub side: Side,
    pub unit: f64,
    pub spectrum: Spectrum,
    /// Every row of the last image.
    pub mean: Vec<f32>,
    /// What is known from each position of the scene, the last position first.
    pub poses: VecDeque<Pose>,
    pub shift: Shift,
    /// The last estimates of the noise.
    pub noises: VecDeque<f32>,
}

/// A position of the scene, and the rows that were read there.
#[derive(Debug, Clone)]
pub(super) struct Pose {
    /// Motion since then.
    pub since: Shift,
    pub known: Known,
}

/// The most positions.
const POSES: usize = 6;

/// Value of each row, and its variance `readings * noise^2 + changes`. The two parts are apart,
/// because a better estimate of the noise holds for old readings too. A row without a value has
/// infinite `changes`.
#[derive(Debug, Clone)]
pub(super) struct Known {
    pub value: Vec<f32>,
    /// Share of a reading's variance that is left: 1 for one reading, less for a mean of several.
    pub readings: Vec<f32>,
    /// Variance from changes of the scene.
    pub changes: Vec<f32>,
}

impl Past {
    /// The frame in the units of the past, with a prior for its light.
    pub fn problem_of<'f>(&self, frame: &'f Measurements, noise: NoiseLevel) -> Problem<'f> {
        let mut problem = Problem::of(frame, Basis::Dct, FALLOFF, noise);
        let change = (problem.unit / self.unit) as f32;
        problem.unit = self.unit;
        problem.values.iter_mut().for_each(|value| *value *= change);
        problem.prior.noise *= change;
        problem.prior.scale.iter_mut().for_each(|scale| *scale *= change);
        // The mean of the image says nothing about the size of the other coefficients, and is not
        // expected to be near 0.
        problem.prior.scale[0] = problem.prior.scale[0].max(self.mean[0].abs());
        problem
    }

    /// Moves the scene. Rows that are read from now on belong to a position of their own.
    pub fn move_by(&mut self, shift: Shift) {
        self.shift = shift;
        self.poses.retain(|pose| pose.known.changes.iter().any(|changes| changes.is_finite()));
        if shift != Shift::default() || self.poses.is_empty() {
            self.poses.iter_mut().for_each(|pose| pose.since = pose.since.and(shift));
            let known = Known::nothing(self.side);
            self.poses.push_front(Pose { since: Shift::default(), known });
            self.poses.truncate(POSES);
        }
    }

    /// What is known of each row, apart from the prior: one over a variance. What the rows know
    /// together is more than that.
    pub fn information(&self, noise: f32) -> Vec<f32> {
        let mut sum = vec![0.0; self.side.area()];
        for Pose { since, known } in &self.poses {
            let moved = self.spectrum.shift(*since).variance(&known.precision(noise));
            sum.iter_mut().zip(moved).for_each(|(sum, moved)| *sum += moved);
        }
        sum
    }

    /// The rows that are known nearly as well as by one reading, in the measurements' units.
    pub fn fused(&self, noise: f32) -> Measurements {
        let unit = self.unit * self.side.pixels() as f64;
        let information = self.information(noise);
        let values = match self.poses.len() {
            1 => &self.poses[0].known.value,
            _ => &self.mean,
        };
        let rows = (0..values.len()).filter(|&row| information[row] * noise * noise >= LEAST_FUSED);
        let (rows, values) = rows.map(|row| (row as u32, f64::from(values[row]) * unit)).unzip();
        Measurements::trusted(Rows::trusted(self.side, rows), values)
    }

    /// The noise: given, or the median of the last estimates. Where the rows were known before,
    /// what the prediction misses is an estimate too, and counts if it is clearly smaller: both
    /// contain detail or motion of the scene.
    pub fn noise(&mut self, problem: &Problem<'_>, predicted: &[f32], given: NoiseLevel) -> f32 {
        if matches!(given, NoiseLevel::Known(_)) {
            return problem.prior.noise.max(LEAST_NOISE);
        }
        // Where nothing moved, the rows themselves are what is expected. The image of a scene that moved
        // lacks what its prior has smoothed away, which would count as noise.
        let has_moved = self.poses[0].known.changes.iter().all(|changes| changes.is_infinite());
        let known = &self.poses[usize::from(has_moved && self.poses.len() > 1)].known;
        let expected = if has_moved { predicted } else { &known.value };
        let again = problem.rows.iter().zip(&problem.values);
        let (rows, missed): (Vec<u32>, Vec<f32>) = again
            .filter(|(row, _)| known.readings[**row as usize] <= 1.0)
            .filter(|(row, _)| known.changes[**row as usize].is_finite())
            .map(|(&row, value)| {
                let at = row as usize;
                // The value itself has a share of a reading's noise.
                (row, (value - expected[at]) / (1.0 + known.readings[at]).sqrt())
            })
            .unzip();
        let mut noise = problem.prior.noise;
        if rows.len() >= LEAST_ROWS {
            let again = noise_level(&Rows::trusted(self.side, rows), &missed);
            // The smaller of two equal estimates would be too small on average.
            if again < CLEARLY * noise {
                noise = again;
            }
        }
        self.noises.truncate(NOISES - 1);
        self.noises.push_front(noise);
        median(&self.noises)
    }
}

/// Least weight of a row among the fused ones; one reading has weight 1. A method that takes all
/// rows for equally good is led astray by rows with more noise than the others.
const LEAST_FUSED: f32 = 0.5;

/// The fewest rows measured again that give an estimate of the noise.
const LEAST_ROWS: usize = 32;

/// How much smaller an estimate of the noise must be to replace another one.
const CLEARLY: f32 = 0.8;

/// The median of some estimates of the noise.
pub(super) fn median(noises: &VecDeque<f32>) -> f32 {
    let mut sorted: Vec<f32> = noises.iter().copied().collect();
    sorted.sort_unstable_by(f32::total_cmp);
    let at = |place: usize| sorted.get(place).copied().unwrap_or(LEAST_NOISE);
    let middle = 0.5 * (at(sorted.len().saturating_sub(1) / 2) + at(sorted.len() / 2));
    middle.max(LEAST_NOISE)
}

impl Known {
    pub fn nothing(side: Side) -> Self {
        let area = side.area();
        let (value, readings) = (vec![0.0; area], vec![0.0; area]);
        Self { value, readings, changes: vec![f32::INFINITY; area] }
    }

    /// One over the variance of each row; 0 for a row without a value.
    pub fn precision(&self, noise: f32) -> Vec<f32> {
        let parts = self.readings.iter().zip(&self.changes);
        parts.map(|(readings, changes)| (readings * noise * noise + changes).recip()).collect()
    }

    /// Lets values lose weight. `kept` is the share of each row that stays from frame to frame:
    /// the value over the share is then a reading of the new scene, whose variance has grown by
    /// what the scene has changed.
    pub fn age(&mut self, kept: &[f32], prior: &[f32]) {
        for (row, (kept, prior)) in kept.iter().zip(prior).enumerate() {
            let (square, changes) = (kept * kept, self.changes[row]);
            if *kept < LEAST_KEPT || !changes.is_finite() {
                (self.value[row], self.readings[row]) = (0.0, 0.0);
                self.changes[row] = f32::INFINITY;
                continue;
            }
            self.value[row] /= kept;
            self.readings[row] /= square;
            self.changes[row] = (changes + prior * (1.0 - square)) / square;
        }
    }

    /// Adds this frame's readings.
    pub fn add(&mut self, problem: &Problem<'_>, noise: f32) {
        let fresh = noise * noise;
        for (&row, reading) in problem.rows.iter().zip(&problem.values) {
            let row = row as usize;
            let old = self.readings[row] * fresh + self.changes[row];
            // Weights of the new reading and of the old value.
            let new = if old.is_finite() { old / (old + fresh) } else { 1.0 };
            let rest = 1.0 - new;
            self.value[row] = rest * self.value[row] + new * reading;
            self.readings[row] = rest * rest * self.readings[row] + new * new;
            self.changes[row] = if rest > 0.0 { rest * rest * self.changes[row] } else { 0.0 };
        }
    }
}

/// Share below which nothing of a row is left.
const LEAST_KEPT: f32 = 0.05;
