//! Readings of some Hadamard rows only: what the other rows would have said binds nobody.

use super::{Consistency, bisect, norm};
use crate::cosine::Cosine;

/// Most conjugate gradient steps; the equation is well conditioned where lambda matters.
const CG_STEPS: usize = 60;

/// Halvings of the interval of lambda's logarithm: lambda to a percent.
const BISECTIONS: usize = 11;

/// Residual of conjugate gradients, over the right-hand side, that is good enough.
const CG_TOLERANCE: f32 = 1e-3;

/// Which rows of the natural-order Hadamard matrix were measured.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MeasuredRows {
    measured: Vec<bool>,
    count: usize,
}

impl MeasuredRows {
    /// The rows of an image of `side` x `side` readings, a power of two; rows beyond are ignored. None if
    /// that is all of them, or none.
    pub fn new(side: usize, rows: &[u32]) -> Option<Self> {
        let mut measured = vec![false; side * side];
        for &row in rows {
            if let Some(measured) = measured.get_mut(row as usize) {
                *measured = true;
            }
        }
        let count = measured.iter().filter(|&&m| m).count();
        (side.is_power_of_two() && count > 0 && count < side * side)
            .then_some(Self { measured, count })
    }

    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Takes the unmeasured part out of readings given by their cosine transform.
    pub(super) fn keep_measured(&self, cosine: &Cosine<f32>, spectrum: &mut [f32]) {
        let mut readings = cosine.inverse(spectrum);
        walsh_hadamard(&mut readings);
        let scale = 1.0 / readings.len() as f32;
        for (value, &measured) in readings.iter_mut().zip(&self.measured) {
            *value *= if measured { scale } else { 0.0 };
        }
        walsh_hadamard(&mut readings);
        spectrum.copy_from_slice(&cosine.forward(&readings));
    }

    /// (P A A^T P + lambda)^-1 of the residual, P the measured part, with lambda such that the new
    /// residual has the radius' norm.
    pub(super) fn solve(&self, model: &Consistency, residual: &[f32], radius: f32) -> Vec<f32> {
        let mut dual = vec![0.0; residual.len()];
        // A starting point near the solution for the last lambda saves most of the steps.
        let lambda = bisect(BISECTIONS, |lambda| {
            self.conjugate_gradients(model, residual, lambda, &mut dual);
            // y - A (x + A^T dual) = residual - A A^T dual = lambda dual.
            lambda * norm(&dual) > radius
        });
        self.conjugate_gradients(model, residual, lambda, &mut dual);
        dual
    }

    fn conjugate_gradients(
        &self,
        model: &Consistency,
        right: &[f32],
        lambda: f32,
        solution: &mut [f32],
    ) {
        let apply = |v: &[f32]| -> Vec<f32> {
            let mut image: Vec<f32> =
                v.iter().enumerate().map(|(i, v)| model.power_at(i) * v).collect();
            self.keep_measured(model.readings, &mut image);
            image.iter_mut().zip(v).for_each(|(out, v)| *out += lambda * v);
            image
        };
        let mut residual: Vec<f32> =
            right.iter().zip(apply(solution)).map(|(r, a)| r - a).collect();
        let mut direction = residual.clone();
        let mut power = dot(&residual, &residual);
        let enough = CG_TOLERANCE * norm(right);
        for _ in 0..CG_STEPS {
            if power.sqrt() <= enough {
                return;
            }
            let image = apply(&direction);
            let step = power / dot(&direction, &image);
            for (s, d) in solution.iter_mut().zip(&direction) {
                *s += step * d;
            }
            for (r, a) in residual.iter_mut().zip(&image) {
                *r -= step * a;
            }
            let next = dot(&residual, &residual);
            let keep = next / power;
            for (d, r) in direction.iter_mut().zip(&residual) {
                *d = r + keep * *d;
            }
            power = next;
        }
    }
}

/// In place, natural order, not normalised.
fn walsh_hadamard(values: &mut [f32]) {
    let mut half = 1;
    while half < values.len() {
        for pair in values.chunks_exact_mut(2 * half) {
            let (low, high) = pair.split_at_mut(half);
            for (a, b) in low.iter_mut().zip(high) {
                (*a, *b) = (*a + *b, *a - *b);
            }
        }
        half *= 2;
    }
}

fn dot(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
