//! Solves (M + lambda) x = r for every lambda at the cost of one: Lanczos' basis of the Krylov
//! space of M and r.
//!
//! Lanczos (J. Res. Natl. Bur. Stand. 45, 1950) constructs vectors v_1 = r / |r|, v_2, ... in which
//! M is tridiagonal. The basis does not depend on lambda, so one series of products with M serves a
//! whole search for lambda. For each lambda only (T + lambda) c = |r| e_1 is solved, with as many
//! unknowns as steps. The result is that of conjugate gradients after as many steps (Frommer,
//! Maass, SIAM J. Sci. Comput. 20, 1999).
//!
//! # Invariant
//! For every lambda the solution agrees with that of the whole equation to within the tolerance
//! (`tests::every_shift_is_solved_in_one_space`).

use super::{norm, sum};

/// Largest number of products with the matrix. The equation is well conditioned for the lambdas
/// that matter.
pub(super) const MOST_STEPS: usize = 60;

/// Number of steps between two checks of the error.
pub(super) const STEPS_A_LOOK: usize = 2;

/// Norm of the residual, relative to the right-hand side's norm, at which a solution is accurate
/// enough.
pub(super) const TOLERANCE: f64 = 1e-3;

/// The Krylov space of a symmetric, positive semidefinite matrix and a right-hand side.
pub(super) struct Krylov {
    length: f64,
    /// Vectors v_1 to v_m, and then v_(m + 1).
    basis: Vec<Vec<f32>>,
    /// Diagonal of T, one element for each step.
    diagonal: Vec<f64>,
    /// Off-diagonal of T; element k couples v_(k + 1) and v_(k + 2).
    beside: Vec<f64>,
}

impl Krylov {
    /// The space of `right`, which must not be 0.
    pub(super) fn new(mut right: Vec<f32>) -> Self {
        let length = f64::from(norm(&right));
        right.iter_mut().for_each(|v| *v = (f64::from(*v) / length) as f32);
        Self { length, basis: vec![right], diagonal: Vec::new(), beside: Vec::new() }
    }

    /// Does one step; `apply` multiplies by the matrix.
    pub(super) fn step(&mut self, apply: impl FnOnce(&[f32]) -> Vec<f32>) {
        let steps = self.diagonal.len();
        let now = &self.basis[steps];
        let mut next = apply(now);
        if let Some(before) = steps.checked_sub(1) {
            take_away(&mut next, self.beside[before], &self.basis[before]);
        }
        let along = dot(now, &next);
        take_away(&mut next, along, now);
        let left = f64::from(norm(&next));
        // At 0 the space contains the whole solution, and the next vector is not used.
        let scale = if left > 0.0 { 1.0 / left } else { 0.0 };
        next.iter_mut().for_each(|v| *v = (f64::from(*v) * scale) as f32);
        self.basis.push(next);
        self.diagonal.push(along);
        self.beside.push(left);
    }

    /// Whether the error should be checked after this step.
    pub(super) fn is_due(&self) -> bool {
        let steps = self.diagonal.len();
        steps.is_multiple_of(STEPS_A_LOOK) || steps >= MOST_STEPS || self.coupling() == 0.0
    }

    /// Whether the solution for `lambda` is accurate enough, or no further step would improve it.
    pub(super) fn is_enough(&self, lambda: f32) -> bool {
        let last = self.coefficients(lambda).last().map_or(0.0, |c| c.abs());
        self.diagonal.len() >= MOST_STEPS || self.coupling() * last <= TOLERANCE * self.length
    }

    /// Norm of the solution for `lambda`.
    pub(super) fn norm(&self, lambda: f32) -> f32 {
        self.coefficients(lambda).iter().map(|c| c * c).sum::<f64>().sqrt() as f32
    }

    /// (M + `lambda`)^-1 of the right-hand side.
    pub(super) fn solution(&self, lambda: f32) -> Vec<f32> {
        let mut solution = vec![0.0; self.basis[0].len()];
        for (coefficient, vector) in self.coefficients(lambda).iter().zip(&self.basis) {
            take_away(&mut solution, -coefficient, vector);
        }
        solution
    }

    /// The coupling of the space to the next vector.
    fn coupling(&self) -> f64 {
        self.beside.last().copied().unwrap_or(f64::INFINITY)
    }

    /// (T + `lambda`)^-1 |r| e_1, by elimination.
    fn coefficients(&self, lambda: f32) -> Vec<f64> {
        let lambda = f64::from(lambda);
        let mut pivots: Vec<f64> = Vec::with_capacity(self.diagonal.len());
        let mut values: Vec<f64> = Vec::with_capacity(self.diagonal.len());
        for (k, diagonal) in self.diagonal.iter().enumerate() {
            let (pivot, value) = match k.checked_sub(1) {
                None => (diagonal + lambda, self.length),
                Some(before) => {
                    let factor = self.beside[before] / pivots[before];
                    (diagonal + lambda - factor * self.beside[before], -factor * values[before])
                }
            };
            pivots.push(pivot);
            values.push(value);
        }
        for k in (0..values.len()).rev() {
            let after = values.get(k + 1).map_or(0.0, |after| self.beside[k] * after);
            values[k] = (values[k] - after) / pivots[k];
        }
        values
    }
}

/// Subtracts `factor` times `other` from `values`.
fn take_away(values: &mut [f32], factor: f64, other: &[f32]) {
    let factor = factor as f32;
    values.iter_mut().zip(other).for_each(|(v, o)| *v -= factor * o);
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    sum(a, b, |a, b| f64::from(a * b))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A symmetric, positive semidefinite matrix of rank 40: a diagonal matrix after a reflection.
    fn multiply(v: &[f32]) -> Vec<f32> {
        let mirror: Vec<f32> = (0..64).map(|i| (1.0 + i as f32 * 0.7).sin()).collect();
        let reflected = |v: &[f32]| -> Vec<f32> {
            let share = 2.0 * dot(&mirror, v) / dot(&mirror, &mirror);
            v.iter()
                .zip(&mirror)
                .map(|(v, m)| (f64::from(*v) - share * f64::from(*m)) as f32)
                .collect()
        };
        let powers = reflected(v).into_iter().enumerate();
        let scaled: Vec<f32> =
            powers.map(|(i, v)| if i < 40 { v * 0.9_f32.powi(i as i32) } else { 0.0 }).collect();
        reflected(&scaled)
    }

    #[test]
    fn every_shift_is_solved_in_one_space() {
        let right: Vec<f32> = (0..64).map(|i| (i as f32 * 1.3).cos()).collect();
        let mut krylov = Krylov::new(right.clone());
        while !(krylov.is_due() && krylov.is_enough(0.01)) {
            krylov.step(multiply);
        }
        assert!(krylov.diagonal.len() < MOST_STEPS, "{}", krylov.diagonal.len());
        for lambda in [0.01, 0.1, 1.0, 100.0] {
            assert!(krylov.is_enough(lambda), "larger shifts are easier: {lambda}");
            let solution = krylov.solution(lambda);
            let back = multiply(&solution).into_iter().zip(&solution).map(|(m, s)| m + lambda * s);
            let left: Vec<f32> = back.zip(&right).map(|(b, r)| b - r).collect();
            assert!(norm(&left) < 1.1 * TOLERANCE as f32 * norm(&right), "{lambda}");
            assert!((krylov.norm(lambda) / norm(&solution) - 1.0).abs() < 1e-3, "{lambda}");
        }
    }
}
