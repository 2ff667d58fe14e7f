//! FISTA: few large coefficients.
//!
//! The measured rows are orthonormal, so a gradient step of length 1 never overshoots and needs no
//! line search.

use super::{Masked, Problem, dot, see, show};
use crate::basis::Basis;

/// Change of the coefficients, relative to their norm, at which the iteration stops.
const SETTLED: f64 = 1e-4;

/// The predicted rows at each strength.
pub(super) fn predict(
    problem: &Problem<'_>,
    positions: &[usize],
    strengths: &[f32],
    iterations: usize,
) -> Vec<Vec<f32>> {
    let Masked { grid, mask } = Masked::new(problem, positions);
    // The mean is not a detail, so it has no penalty.
    let free = usize::from(problem.transform.basis() != Basis::Pixel);
    let noise = problem.prior.noise.powi(2) * std::f32::consts::SQRT_2;
    let weights: Vec<f32> = (0..grid.len())
        .map(|j| if j < free { 0.0 } else { noise / problem.prior.scale[j] })
        .collect();
    let mut c = vec![0.0; grid.len()];
    strengths
        .iter()
        .map(|strength| {
            settle(problem, &grid, &mask, &mut c, iterations, |j, v| {
                let threshold = strength * weights[j];
                v.signum() * (v.abs() - threshold).max(0.0)
            });
            let mut predicted = c.clone();
            show(problem, &mut predicted);
            predicted
        })
        .collect()
}

fn settle(
    problem: &Problem<'_>,
    grid: &[f32],
    mask: &[f32],
    c: &mut [f32],
    iterations: usize,
    shrink: impl Fn(usize, f32) -> f32,
) {
    let mut ahead = c.to_vec();
    let mut pace = 1.0_f32;
    for _ in 0..iterations {
        let mut step = ahead.clone();
        show(problem, &mut step);
        for ((v, b), mask) in step.iter_mut().zip(grid).zip(mask) {
            *v = mask * (b - *v);
        }
        see(problem, &mut step);
        let next: Vec<f32> =
            ahead.iter().zip(&step).enumerate().map(|(j, (c, step))| shrink(j, c + step)).collect();
        let faster = 0.5 * (1.0 + (1.0 + 4.0 * pace * pace).sqrt());
        let momentum = (pace - 1.0) / faster;
        pace = faster;
        let change: Vec<f32> = next.iter().zip(&*c).map(|(next, c)| next - c).collect();
        for ((ahead, next), change) in ahead.iter_mut().zip(&next).zip(&change) {
            *ahead = next + momentum * change;
        }
        c.copy_from_slice(&next);
        if dot(&change, &change) <= SETTLED.powi(2) * dot(c, c) {
            break;
        }
    }
}
