//! Motion of a whole image, on its Hadamard rows.
//!
//! # Invariant
//! A shift by whole pixels moves pixels, and keeps their values
//! (`tests::whole_pixels_move_unchanged`).

use super::rows::Spectrum;
use crate::basis::product;
use crate::fwht;
use std::f32::consts::PI;

/// Parts of a pixel that shifts are counted in.
const PARTS: i32 = 4;

/// How far, in pixels, a frame's motion is looked for around that of the frame before.
const REACH_PX: i32 = 3;

/// Number of shifts among which the best is chosen.
pub(super) const SHIFTS: f32 = 67.0;

/// Lobes of the interpolating kernel (Lanczos).
const LOBES: f32 = 3.0;

/// Motion down and to the right, in quarters of a pixel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Shift {
    down: i32,
    right: i32,
}

impl Shift {
    pub fn pixels(self) -> [f64; 2] {
        [self.down, self.right].map(|parts| f64::from(parts) / f64::from(PARTS))
    }

    /// This motion and then another one.
    pub fn and(self, then: Self) -> Self {
        self.by(then.down, then.right)
    }

    /// The way back.
    pub fn reversed(self) -> Self {
        Self { down: -self.down, right: -self.right }
    }

    fn by(self, down: i32, right: i32) -> Self {
        Self { down: self.down + down, right: self.right + right }
    }
}

/// The shift after which `mean`, every row of an image, agrees best with some readings: row, value
/// and weight of each. The search starts at no motion and at the motion of the frame before.
pub(super) fn best_shift(
    spectrum: &Spectrum,
    mean: &[f32],
    readings: &[(usize, f32, f32)],
    before: Shift,
) -> Shift {
    let missed = |shift: Shift| {
        let moved = spectrum.shift(shift).apply(mean);
        let squares =
            readings.iter().map(|&(row, value, weight)| weight * (value - moved[row]).powi(2));
        squares.sum::<f32>()
    };
    let mut best = (missed(Shift::default()), Shift::default());
    for (step, reach) in [(PARTS, REACH_PX), (2, 1), (1, 1)] {
        let centre = if step == PARTS { before } else { best.1 };
        for (down, right) in (-reach..=reach).flat_map(|d| (-reach..=reach).map(move |r| (d, r))) {
            let shift = centre.by(down * step, right * step);
            let found = missed(shift);
            if found < best.0 {
                best = (found, shift);
            }
        }
    }
    best.1
}

impl Spectrum {
    /// A shift of images of this side, on their rows.
    pub fn shift(&self, shift: Shift) -> Operator {
        Operator::new(self.side(), shift)
    }
}

/// A shift on the rows of an image: separable, one matrix for each direction.
pub(super) struct Operator {
    n: usize,
    down: Vec<f32>,
    /// Transposed.
    right: Vec<f32>,
}

impl Operator {
    pub fn new(n: usize, shift: Shift) -> Self {
        let along = |parts: i32| rows_of(n, parts as f32 / PARTS as f32);
        Self { n, down: along(shift.down), right: transposed(n, &along(shift.right)) }
    }

    /// The transposed operator.
    pub fn transposed(&self) -> Self {
        let n = self.n;
        Self { n, down: transposed(n, &self.down), right: transposed(n, &self.right) }
    }

    /// Every row of the shifted image.
    pub fn apply(&self, rows: &[f32]) -> Vec<f32> {
        sandwich(self.n, &self.down, rows, &self.right)
    }

    /// Variance of every row of the shifted image, from independent rows with these variances.
    pub fn variance(&self, variances: &[f32]) -> Vec<f32> {
        let squared = |matrix: &[f32]| matrix.iter().map(|v| v * v).collect::<Vec<f32>>();
        sandwich(self.n, &squared(&self.down), variances, &squared(&self.right))
    }
}

fn transposed(n: usize, matrix: &[f32]) -> Vec<f32> {
    (0..n * n).map(|p| matrix[p % n * n + p / n]).collect()
}

/// The product of three matrices.
fn sandwich(n: usize, left: &[f32], middle: &[f32], right: &[f32]) -> Vec<f32> {
    let (mut half, mut all) = (vec![0.0; n * n], vec![0.0; n * n]);
    product(n, n, left, middle, &mut half);
    product(n, n, &half, right, &mut all);
    all
}

/// The matrix of a shift along one axis, between orthonormal Walsh functions. Pixels beyond the
/// edge are as the edge.
fn rows_of(n: usize, pixels: f32) -> Vec<f32> {
    let mut matrix = vec![0.0; n * n];
    for (to, line) in matrix.chunks_exact_mut(n).enumerate() {
        let from = to as f32 - pixels;
        let first = from.floor() as i64 - LOBES as i64 + 1;
        let taps: Vec<(i64, f32)> =
            (first..first + 2 * LOBES as i64).map(|at| (at, lanczos(from - at as f32))).collect();
        let sum: f32 = taps.iter().map(|tap| tap.1).sum();
        for (at, weight) in taps {
            line[at.clamp(0, n as i64 - 1) as usize] += weight / sum;
        }
    }
    for _ in 0..2 {
        matrix.chunks_exact_mut(n).for_each(fwht::transform);
        matrix = transposed(n, &matrix);
    }
    matrix.iter_mut().for_each(|v| *v /= n as f32);
    matrix
}

fn lanczos(x: f32) -> f32 {
    let sinc = |x: f32| if x.abs() < 1e-6 { 1.0 } else { (PI * x).sin() / (PI * x) };
    if x.abs() < LOBES { sinc(x) * sinc(x / LOBES) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{scene, side};

    fn walsh(n: usize, image: &[f32]) -> Vec<f32> {
        let mut grid = image.to_vec();
        fwht::transform(&mut grid);
        grid.iter_mut().for_each(|v| *v /= n as f32);
        grid
    }

    #[test]
    fn whole_pixels_move_unchanged() {
        let n = 16;
        let image: Vec<f32> = scene(side(16), 0).iter().map(|&v| v as f32).collect();
        let shift = Shift { down: 2 * PARTS, right: -PARTS };
        let moved = walsh(n, &Operator::new(n, shift).apply(&walsh(n, &image)));
        for (at, &value) in moved.iter().enumerate() {
            let (row, column) = ((at / n).saturating_sub(2), (at % n + 1).min(n - 1));
            assert!((value - image[row * n + column]).abs() < 1e-4, "pixel {at}");
        }
        assert_eq!(shift.pixels(), [2.0, -1.0]);
    }

    #[test]
    fn variances_of_a_shift_are_those_of_many_shifted_images() {
        let n = 8;
        let operator = Operator::new(n, Shift { down: 3, right: -5 });
        let variances: Vec<f32> = (0..n * n).map(|at| 1.0 + (at % 7) as f32).collect();
        // The variance of a sum of independent rows is the sum over rows of squared shifted units.
        let mut expected = vec![0.0; n * n];
        for (row, variance) in variances.iter().enumerate() {
            let mut unit = vec![0.0; n * n];
            unit[row] = 1.0;
            for (sum, v) in expected.iter_mut().zip(operator.apply(&unit)) {
                *sum += variance * v * v;
            }
        }
        for (found, expected) in operator.variance(&variances).iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-3 * expected.max(1.0), "{found} {expected}");
        }
    }

    #[test]
    fn a_motion_is_found_from_some_rows() {
        let n = 32;
        let side = side(32);
        let image: Vec<f32> = scene(side, 2).iter().map(|&v| v as f32).collect();
        let mean = walsh(n, &image);
        let spectrum = Spectrum::new(side);
        for shift in [Shift { down: 4, right: -8 }, Shift { down: -3, right: 2 }, Shift::default()]
        {
            let moved = spectrum.shift(shift).apply(&mean);
            let rows = crate::Order::ZigZag.rows(side).unwrap().first(200);
            let readings: Vec<(usize, f32, f32)> =
                rows.iter().skip(1).map(|&row| (row as usize, moved[row as usize], 1.0)).collect();
            assert_eq!(best_shift(&spectrum, &mean, &readings, Shift::default()), shift);
        }
    }
}
