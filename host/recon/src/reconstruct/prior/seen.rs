//! What a network is given: measurements without gain and offset, a classical start, and a few
//! numbers about both. `host/nets/training/prior.py` does the same in training.

use crate::basis::Basis;
use crate::reconstruct::regularised::tikhonov;
use crate::reconstruct::selection::SIGMAS_PER_MEDIAN;
use crate::reconstruct::{HeldBack, NoiseLevel, Problem, weight};
use crate::{Measurements, Rows, Side, fwht, order};

/// Iterations of conjugate gradients for the start, as in training.
const ITERATIONS: usize = 20;

/// The least noise that the start counts with, relative to the contrast.
const LEAST_NOISE: f32 = 1e-4;

/// Normalised measurements of one image.
///
/// Coefficients are orthonormal (`d / n`), by natural Hadamard row, and divided by the contrast:
/// the standard deviation of the zero-filled image's pixels is 1. The mean is left out: row 0
/// counts as measured, with the value 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    side: Side,
    values: Vec<f32>,
    mask: Vec<f32>,
    start: Vec<f32>,
    fineness: Vec<f32>,
    conditions: [f32; Self::CONDITIONS],
    noise: f32,
    /// The image's contrast, in the measurements' units a pixel.
    unit: f64,
    /// The image's mean, in the measurements' units a pixel; 0 if row 0 was not measured.
    mean: f64,
}

impl Seen {
    /// Number of [`conditions`](Self::conditions).
    pub const CONDITIONS: usize = 8;

    /// `None` if the measurements show no contrast, or if there are fewer than eight rows beside
    /// the all-ones row.
    #[must_use]
    pub fn new(measurements: &Measurements) -> Option<Self> {
        let side = measurements.side();
        let (n, area) = (side.pixels(), side.area());
        let rows = measurements.rows();
        let positions = order::positions_by_sequency(rows);
        let orthonormal = |k: usize| measurements.values()[k] / n as f64;
        let energy: f64 = positions.iter().map(|&k| orthonormal(k).powi(2)).sum();
        let unit = energy.sqrt() / n as f64;
        if positions.len() < 8 || unit <= 0.0 || !unit.is_finite() {
            return None;
        }
        let at_mean = rows.iter().position(|&row| row == 0);
        let mean = at_mean.map_or(0.0, |k| measurements.values()[k] / area as f64);
        let (mut values, mut mask) = (vec![0.0; area], vec![0.0; area]);
        mask[0] = 1.0;
        for &k in &positions {
            let row = rows[k] as usize;
            (values[row], mask[row]) = ((orthonormal(k) / unit) as f32, 1.0);
        }
        let along: Vec<f32> = positions.iter().map(|&k| values[rows[k] as usize].abs()).collect();
        let quarters = quarters(&along);
        let noise = SIGMAS_PER_MEDIAN * quarters[3];
        let sequency = order::sequencies(n as u32);
        let axes = |row: usize| [sequency[row / n], sequency[row % n]].map(|s| s as f32);
        let fineness = (0..area).map(|row| axes(row).iter().sum::<f32>() / (2 * n) as f32);
        let mut seen = Self {
            side,
            fineness: fineness.collect(),
            conditions: [0.0; Self::CONDITIONS],
            start: Vec::new(),
            values,
            mask,
            noise,
            unit,
            mean,
        };
        seen.conditions = seen.told(quarters, positions.len() + 1, axes);
        seen.start = seen.tikhonov();
        Some(seen)
    }

    /// Magnitudes along the sequencies, the share of the patterns, the side, and where the patterns
    /// are.
    fn told(
        &self,
        quarters: [f32; 4],
        count: usize,
        axes: impl Fn(usize) -> [f32; 2],
    ) -> [f32; Self::CONDITIONS] {
        let n = self.side.pixels() as f32;
        let mut sums = [0.0; 2];
        for (row, _) in self.mask.iter().enumerate().filter(|(_, mask)| **mask > 0.0) {
            for (sum, axis) in sums.iter_mut().zip(axes(row)) {
                *sum += f64::from(axis);
            }
        }
        let [down, across] = sums.map(|sum| (sum / count as f64) as f32 * 4.0 / n - 1.0);
        let [a, b, c, d] = quarters.map(|magnitude| (magnitude.max(1e-4).ln() + 1.0) / 2.0);
        let share = count as f32 / self.side.area() as f32;
        [a, b, c, d, share.ln(), (n / 64.0).log2(), down, across]
    }

    /// Tikhonov's prediction at strength 1; measured coefficients keep their values.
    fn tikhonov(&self) -> Vec<f32> {
        let n = self.side.pixels() as f64;
        let measured: Vec<u32> =
            (0..self.side.area() as u32).filter(|&row| self.mask[row as usize] > 0.0).collect();
        let values = measured.iter().map(|&row| f64::from(self.values[row as usize])).collect();
        let every: Vec<usize> = (0..measured.len()).collect();
        let part = Measurements::trusted(Rows::trusted(self.side, measured), values);
        let noise = NoiseLevel::Known(self.noise.max(LEAST_NOISE).into());
        let problem = Problem::of(&part, Basis::Dct, Some(1.0), noise);
        let mut start = tikhonov::predict(&problem, &every, &[1.0], ITERATIONS).remove(0);
        let unit = (problem.unit * n) as f32;
        for ((start, value), mask) in start.iter_mut().zip(&self.values).zip(&self.mask) {
            *start = if *mask > 0.0 { *value } else { *start * unit };
        }
        start
    }

    /// The image's side.
    #[must_use]
    pub fn side(&self) -> Side {
        self.side
    }

    /// Every coefficient by natural row, zeros where nothing was measured.
    #[must_use]
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// 1 where a row was measured, else 0, by natural row.
    #[must_use]
    pub fn mask(&self) -> &[f32] {
        &self.mask
    }

    /// Tikhonov's completion, by natural row.
    #[must_use]
    pub fn start(&self) -> &[f32] {
        &self.start
    }

    /// How fine each natural row's pattern is: the sum of its two sequencies over twice the side.
    #[must_use]
    pub fn fineness(&self) -> &[f32] {
        &self.fineness
    }

    /// What a network is told: half of one plus the logarithm of the median magnitude of the
    /// measurements, for each quarter of the rows along the zig-zag; logarithms of the share of the
    /// patterns and (to base 2) of the side over 64; the mean sequency of the patterns down and
    /// across, -1 for the coarsest, 1 for an even spread over all patterns.
    #[must_use]
    pub fn conditions(&self) -> &[f32; Self::CONDITIONS] {
        &self.conditions
    }

    /// Standard deviation of a measurement's noise, estimated as for the other methods: an upper
    /// bound, because the finest measured patterns also see the scene.
    #[must_use]
    pub fn noise(&self) -> f32 {
        self.noise
    }

    /// The image of coefficients in the same units, row-major.
    #[must_use]
    pub fn image(&self, coefficients: &[f32]) -> Vec<f32> {
        let mut image = coefficients.to_vec();
        fwht::transform(&mut image);
        image.iter_mut().for_each(|v| *v /= self.side.pixels() as f32);
        image
    }

    pub(super) fn unit(&self) -> f64 {
        self.unit
    }

    pub(super) fn mean(&self) -> f64 {
        self.mean
    }

    /// A measurement in normalised units.
    pub(super) fn in_units(&self, value: f64) -> f32 {
        (value / self.side.pixels() as f64 / self.unit) as f32
    }

    /// Judges predictions, one for each measurement.
    pub(super) fn judge(&self, rows: &Rows, predicted: &[f32]) -> Option<HeldBack> {
        let values: Vec<f32> = rows.iter().map(|&row| self.values[row as usize]).collect();
        HeldBack::of(rows, &values, predicted, 1.0)
    }

    /// Replaces measured rows of `grid`, a completion, by weighted means of reading and completion,
    /// and gives the mean weight of the readings. `noise` is in the measurements' units.
    pub(super) fn weigh(&self, rows: &Rows, noise: f64, grid: &mut [f32]) -> f64 {
        let noise = self.in_units(noise);
        weight::weigh_each(rows, |k| (self.values[rows[k] as usize], noise), grid)
    }

    /// Norm of the difference between measurements and coefficients, relative to the measurements'
    /// norm with the mean.
    pub(super) fn residual(&self, coefficients: &[f32]) -> f64 {
        let energy = |v: f32| f64::from(v).powi(2);
        let left = self.values.iter().zip(coefficients).zip(&self.mask).skip(1);
        let left: f64 = left.map(|((v, c), mask)| energy((v - c) * mask)).sum();
        let mean = self.mean / self.unit * self.side.pixels() as f64;
        let all: f64 = self.values.iter().map(|&v| energy(v)).sum::<f64>() + mean * mean;
        (left / all).sqrt()
    }
}

/// The median of each quarter of the magnitudes.
fn quarters(magnitudes: &[f32]) -> [f32; 4] {
    let end = |quarter: usize| magnitudes.len() * quarter / 4;
    std::array::from_fn(|quarter| {
        let mut part = magnitudes[end(quarter)..end(quarter + 1)].to_vec();
        let middle = part.len() / 2;
        *part.select_nth_unstable_by(middle, f32::total_cmp).1
    })
}
