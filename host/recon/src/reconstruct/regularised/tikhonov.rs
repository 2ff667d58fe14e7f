//! Tikhonov's penalty for normal coefficients of known size, by conjugate gradients (M. Hestenes
//! and E. Stiefel, 1952).
//!
//! The unknowns are `z = c / s`, so all have the same expected size and the same accuracy.

use super::{Masked, Problem, dot, see, show};

/// The predicted rows at each strength.
pub(in crate::reconstruct) fn predict(
    problem: &Problem<'_>,
    positions: &[usize],
    strengths: &[f32],
    iterations: usize,
) -> Vec<Vec<f32>> {
    let Masked { grid, mask } = Masked::new(problem, positions);
    let seen = |rows: &mut Vec<f32>| rows.iter_mut().zip(&mask).for_each(|(v, mask)| *v *= mask);
    solve(problem, grid, seen, strengths, iterations)
}

/// The predicted rows at each strength. `weigh` multiplies rows by the weights of what is known of
/// them, where 1 is one reading, and `grid` has the known values, weighted so.
pub(in crate::reconstruct) fn solve(
    problem: &Problem<'_>,
    mut grid: Vec<f32>,
    weigh: impl Fn(&mut Vec<f32>),
    strengths: &[f32],
    iterations: usize,
) -> Vec<Vec<f32>> {
    let scale = &problem.prior.scale;
    see(problem, &mut grid);
    let right: Vec<f32> = grid.iter().zip(scale).map(|(v, s)| v * s).collect();
    let noise = problem.prior.noise.powi(2);
    let mut z = vec![0.0; right.len()];
    strengths
        .iter()
        .map(|strength| {
            let operate = |z: &[f32]| -> Vec<f32> {
                let mut seen: Vec<f32> = z.iter().zip(scale).map(|(z, s)| z * s).collect();
                show(problem, &mut seen);
                weigh(&mut seen);
                see(problem, &mut seen);
                seen.iter_mut()
                    .zip(scale)
                    .zip(z)
                    .for_each(|((v, s), z)| *v = *v * s + strength * noise * z);
                seen
            };
            conjugate_gradients(operate, &right, &mut z, iterations);
            let mut predicted: Vec<f32> = z.iter().zip(scale).map(|(z, s)| z * s).collect();
            show(problem, &mut predicted);
            predicted
        })
        .collect()
}

/// Norm of the residual, relative to the right side's norm, at which the iteration stops.
const ACCURACY: f64 = 1e-4;

/// Improves `x` as a solution of `operate(x) = right`.
fn conjugate_gradients(
    operate: impl Fn(&[f32]) -> Vec<f32>,
    right: &[f32],
    x: &mut [f32],
    iterations: usize,
) {
    let mut residual: Vec<f32> = right.iter().zip(operate(x)).map(|(b, a)| b - a).collect();
    let mut direction = residual.clone();
    let mut energy = dot(&residual, &residual);
    let enough = ACCURACY.powi(2) * dot(right, right);
    for _ in 0..iterations {
        if energy <= enough {
            break;
        }
        let image = operate(&direction);
        let curvature = dot(&direction, &image);
        if curvature <= 0.0 || curvature.is_nan() {
            break;
        }
        let step = (energy / curvature) as f32;
        for (((x, r), d), a) in x.iter_mut().zip(&mut residual).zip(&direction).zip(&image) {
            *x += step * d;
            *r -= step * a;
        }
        let before = std::mem::replace(&mut energy, dot(&residual, &residual));
        let turn = (energy / before) as f32;
        for (d, r) in direction.iter_mut().zip(&residual) {
            *d = r + turn * *d;
        }
    }
}
