//! What the frames so far have shown: rows, read at one position of the scene or at several.

use super::motion::Shift;
use super::noise::{self, Missed};
use super::rows::Spectrum;
use super::{FALLOFF, LEAST_NOISE};
use crate::basis::Basis;
use crate::reconstruct::weight::weigh_each;
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
    /// Whether the noise of the last frame was said, and not estimated.
    pub noise_is_known: bool,
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
        let mut problem = Problem::of(frame, Basis::Dct, Some(FALLOFF), noise);
        let change = (problem.unit / self.unit) as f32;
        problem.unit = self.unit;
        problem.values.iter_mut().for_each(|value| *value *= change);
        problem.prior.noise *= change;
        problem.reading_noise = problem.reading_noise.map(|noise| noise * change);
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

    /// How much of each row is known by the readings of the last position alone: 1 where the
    /// earlier positions and the `expected` variance of the scene say nothing beside them, 0 where
    /// they say as much. Readings then count as they are, whatever else is believed.
    pub fn share_of_last(&self, noise: f32, expected: Option<&[f32]>) -> Vec<f32> {
        let last = self.poses[0].known.precision(noise);
        let all = self.information(noise);
        let share = |(row, (last, all)): (usize, (f32, f32))| {
            let others = (all - last).max(0.0) + expected.map_or(0.0, |prior| prior[row].recip());
            ((last - others) / (last + others)).max(0.0)
        };
        last.into_iter().zip(all).enumerate().map(share).collect()
    }

    /// Replaces a share of each row of an image by the readings of the last position.
    pub fn with_readings(&self, mut rows: Vec<f32>, share: &[f32]) -> Vec<f32> {
        let values = self.poses[0].known.value.iter().zip(share);
        rows.iter_mut()
            .zip(values)
            .for_each(|(row, (value, share))| *row += share * (value - *row));
        rows
    }

    /// Replaces the rows of a fit that are known at least as well as by one reading by the weighted means of
    /// both, and gives the mean weight of what is known. The fit has taken what is known, noise and all: by
    /// `prior`, the expected square of each row, it is first moved away from that, to where it would be
    /// without it.
    pub fn weigh(&self, prior: &[f32], noise: f32, fit: &mut [f32]) -> f64 {
        let known = &self.poses[0].known;
        let precision = known.precision(noise);
        let looks = |row: usize| precision[row] * noise * noise;
        for (row, fit) in fit.iter_mut().enumerate().filter(|(row, _)| looks(*row) >= 0.999) {
            *fit -= precision[row] * prior[row] * (known.value[row] - *fit);
        }
        let is_read = |row: &u32| looks(*row as usize) >= 0.999;
        let rows = (0..self.side.area() as u32).filter(is_read).collect();
        let rows = Rows::trusted(self.side, rows);
        let reading = |k: usize| {
            let row = rows[k] as usize;
            (known.value[row], precision[row].sqrt().recip())
        };
        weigh_each(&rows, reading, fit)
    }

    /// The rows that are known nearly as well as by one reading, in the measurements' units; and those
    /// of them that the last position has read, or that are known far better than by `prior`, the
    /// expected square of each row. If the noise of a reading is known and not estimated, theirs is that of
    /// their middle row.
    pub fn fused(&self, noise: f32, prior: &[f32]) -> [Measurements; 2] {
        let unit = self.unit * self.side.pixels() as f64;
        let information = self.information(noise);
        let last = self.poses[0].known.precision(noise);
        let values = match self.poses.len() {
            1 => self.poses[0].known.value.clone(),
            _ => self.with_readings(self.mean.clone(), &self.share_of_last(noise, None)),
        };
        let by_readings = |precision: f32| precision * noise * noise >= LEAST_FUSED;
        let of = |rows: &[usize]| {
            let values = rows.iter().map(|&row| f64::from(values[row]) * unit).collect();
            let mut known: Vec<f32> = rows.iter().map(|&row| information[row]).collect();
            let rows = rows.iter().map(|&row| row as u32).collect();
            let fused = Measurements::trusted(Rows::trusted(self.side, rows), values);
            if !self.noise_is_known || known.is_empty() {
                return fused;
            }
            let middle = known.len() / 2;
            let information = *known.select_nth_unstable_by(middle, f32::total_cmp).1;
            fused.of_noise(unit / f64::from(information).sqrt())
        };
        let mut rows: Vec<usize> =
            (0..values.len()).filter(|&row| by_readings(information[row])).collect();
        let fused = of(&rows);
        let beyond_prior = |row: usize| information[row] * prior[row] >= BEYOND_PRIOR;
        rows.retain(|&row| by_readings(last[row]) || beyond_prior(row));
        [fused, of(&rows)]
    }

    /// The noise of this frame: given, or the median of the last estimates. `predicted` are the
    /// rows after each motion that is considered.
    pub fn noise(&mut self, problem: &Problem<'_>, predicted: &[&[f32]], given: NoiseLevel) -> f32 {
        self.noise_is_known = matches!(given, NoiseLevel::Known(_));
        if self.noise_is_known {
            return problem.prior.noise.max(LEAST_NOISE);
        }
        // If nothing has moved, the rows themselves are what is expected: the image of a scene
        // lacks what its prior has smoothed away, which would count as noise.
        let known = &self.poses[0].known;
        let by_rows = known.missed(problem, &known.value, |readings| (1.0 + readings).sqrt());
        // A prior has smoothed the noise of an image, which counts as none.
        let by_images = predicted.iter().map(|rows| known.missed(problem, rows, |_| 1.0));
        let noise = std::iter::once(by_rows)
            .chain(by_images)
            .fold(noise::of_frame(problem), |noise, missed| {
                noise::of_missed(self.side, missed, noise)
            });
        self.noises.truncate(NOISES - 1);
        self.noises.push_front(noise);
        median(&self.noises)
    }
}

/// Least weight of a row among the fused ones; one reading has weight 1. A method that takes all
/// rows for equally good is led astray by rows with more noise than the others.
const LEAST_FUSED: f32 = 0.5;

/// How many times more the readings at earlier positions must say of a row than the prior does. What
/// they say of one row is mixed with what they say of others, so the sum of it says too much: with
/// much noise, a learned prior knows such a row better.
const BEYOND_PRIOR: f32 = 15.0;

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

    /// What `expected` misses of the readings of the rows that were read before, as noise of one
    /// reading.
    /// `noises` says by how much the noise of what is expected adds to that of a reading, for a row
    /// with this share of a reading's variance.
    fn missed(
        &self,
        problem: &Problem<'_>,
        expected: &[f32],
        noises: impl Fn(f32) -> f32,
    ) -> Missed {
        let again = problem.rows.iter().zip(&problem.values);
        let (rows, values) = again
            .filter(|(row, _)| self.readings[**row as usize] <= 1.0)
            .filter(|(row, _)| self.changes[**row as usize].is_finite())
            .map(|(&row, value)| {
                let at = row as usize;
                (row, (value - expected[at]) / noises(self.readings[at]))
            })
            .unzip();
        Missed { rows, values }
    }

    /// One over the variance of each row; 0 for a row without a value.
    pub fn precision(&self, noise: f32) -> Vec<f32> {
        let parts = self.readings.iter().zip(&self.changes);
        parts.map(|(readings, changes)| (readings * noise * noise + changes).recip()).collect()
    }

    /// Value, share of a reading's variance and variance from changes of a row after the scene has
    /// changed; `None` if nothing of the row is left. `kept` is the share of the row that stays
    /// from frame to frame: the value over the share is then a reading of the new scene, whose
    /// variance has grown by what the scene has changed.
    pub fn aged(&self, row: usize, kept: f32, prior: f32) -> Option<[f32; 3]> {
        let (square, changes) = (kept * kept, self.changes[row]);
        (kept >= LEAST_KEPT && changes.is_finite()).then(|| {
            let changes = (changes + prior * (1.0 - square)) / square;
            [self.value[row] / kept, self.readings[row] / square, changes]
        })
    }

    /// Lets values lose weight.
    pub fn age(&mut self, kept: &[f32], prior: &[f32]) {
        for (row, (kept, prior)) in kept.iter().zip(prior).enumerate() {
            [self.value[row], self.readings[row], self.changes[row]] =
                self.aged(row, *kept, *prior).unwrap_or([0.0, 0.0, f32::INFINITY]);
        }
    }

    /// Multiplies the variance of each row by 1 or more.
    pub fn doubt(&mut self, surprise: &[f32], noise: f32) {
        let parts = self.changes.iter_mut().zip(&self.readings).zip(surprise);
        for ((changes, readings), surprise) in parts {
            if changes.is_finite() {
                *changes += (surprise - 1.0) * (readings * noise * noise + *changes);
            }
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
