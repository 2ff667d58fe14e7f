//! Total variation for flat regions with edges, by the primal-dual algorithm of Chambolle and Pock.
//!
//! The proximal map of the data term is exact: the rows are orthonormal, so each measured
//! coefficient moves towards its measurement on its own, and the other coefficients stay.

use super::{Masked, Problem, dot, walsh};
use crate::gradient::{climb, descend};

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
