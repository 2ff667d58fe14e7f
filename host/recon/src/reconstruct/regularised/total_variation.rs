//! Total variation for flat regions with edges, by the primal-dual algorithm of Chambolle and Pock.
//!
//! The proximal map of the data term is exact: the rows are orthonormal, so each measured
//! coefficient moves towards its measurement on its own, and the other coefficients stay.

use super::{Masked, Problem, dot, walsh};

/// Upper bound of the squared norm of the discrete gradient (A. Chambolle, 2004).
const GRADIENT: f32 = 8.0;

/// The predicted rows at each strength.
pub(super) fn predict(
    problem: &Problem<'_>,
    positions: &[usize],
    strengths: &[f32],
    iterations: usize,
) -> Vec<Vec<f32>> {
    let n = problem.side.pixels();
    let Masked { grid, mask } = Masked::new(problem, positions);
    let mut x = grid.clone();
    walsh(n, &mut x);
    // Steps are proportional to the picture's contrast, which changes the speed and not the result.
    let mean = x.iter().sum::<f32>() / x.len() as f32;
    let spread: Vec<f32> = x.iter().map(|x| x - mean).collect();
    let contrast = ((dot(&spread, &spread) / x.len() as f64).sqrt() as f32).max(f32::MIN_POSITIVE);
    let (primal, dual) = (contrast / GRADIENT.sqrt(), 1.0 / (contrast * GRADIENT.sqrt()));
    let (mut down, mut across) = (vec![0.0; x.len()], vec![0.0; x.len()]);
    strengths
        .iter()
        .map(|strength| {
            let pull = primal / (strength * problem.prior.noise).max(f32::MIN_POSITIVE);
            let mut ahead = x.clone();
            for _ in 0..iterations {
                climb(n, &ahead, dual, &mut down, &mut across);
                let mut next = x.clone();
                descend(n, &down, &across, primal, &mut next);
                walsh(n, &mut next);
                for ((v, b), mask) in next.iter_mut().zip(&grid).zip(&mask) {
                    let kept = 1.0 / (1.0 + pull * mask);
                    *v = *v * kept + b * (1.0 - kept);
                }
                walsh(n, &mut next);
                for ((ahead, next), x) in ahead.iter_mut().zip(&next).zip(&x) {
                    *ahead = 2.0 * next - x;
                }
                x = next;
            }
            let mut predicted = x.clone();
            walsh(n, &mut predicted);
            predicted
        })
        .collect()
}

/// Moves the dual up the gradient of the image `x`, and projects it back into the unit discs.
pub(in crate::reconstruct) fn climb(
    width: usize,
    x: &[f32],
    step: f32,
    down: &mut [f32],
    across: &mut [f32],
) {
    let height = x.len() / width;
    for r in 0..height {
        let below = if r + 1 < height { r + 1 } else { r };
        for c in 0..width {
            let p = r * width + c;
            let right = if c + 1 < width { p + 1 } else { p };
            let d = down[p] + step * (x[below * width + c] - x[p]);
            let a = across[p] + step * (x[right] - x[p]);
            let outside = (d * d + a * a).sqrt().max(1.0);
            (down[p], across[p]) = (d / outside, a / outside);
        }
    }
}

/// Moves `x` along the dual's divergence.
pub(in crate::reconstruct) fn descend(
    width: usize,
    down: &[f32],
    across: &[f32],
    step: f32,
    x: &mut [f32],
) {
    let height = x.len() / width;
    for r in 0..height {
        for c in 0..width {
            let p = r * width + c;
            let from = |inside: bool, value: f32| if inside { value } else { 0.0 };
            let above = if r > 0 { down[p - width] } else { 0.0 };
            let left = if c > 0 { across[p - 1] } else { 0.0 };
            let divergence =
                from(r + 1 < height, down[p]) - above + from(c + 1 < width, across[p]) - left;
            x[p] += step * divergence;
        }
    }
}
