//! The result of a pursuit, with the solution for every number of atoms.

use super::scalar::Scalar;
use super::{Solution, Stop};

/// The result of a pursuit: a solution for every number of atoms up to the last.
#[derive(Debug, Clone)]
pub struct Path<T> {
    /// Atoms in the order in which they were chosen.
    pub support: Vec<usize>,
    /// Norm of the residual before the first atom and after each atom, relative to the
    /// measurement's norm.
    pub residual_norms: Vec<f64>,
    /// Why the pursuit stopped.
    pub stop: Stop,
    /// Atoms that the measurement does not see.
    pub unseen: Vec<usize>,
    /// Smallest lead of a chosen atom over the best other atom: difference of their correlations
    /// with the residual, relative to the measurement's norm. Rounding may have decided a choice
    /// with a lead of some tens of epsilons.
    pub least_lead: f64,
    /// Number of atoms whose lead was too small for `f32`, so that double precision chose.
    pub refereed: usize,
    /// Lower-triangular factor of the support's Gram matrix, row after row.
    pub(super) factor: Vec<T>,
    /// The initial projection, orthogonalised like the atoms.
    pub(super) steps: Vec<T>,
}

impl<T: Scalar> Path<T> {
    pub(super) fn add(&mut self, atom: usize, step: T, remaining: &mut f64, energy: f64) {
        self.steps.push(step);
        self.support.push(atom);
        *remaining -= step.into().powi(2);
        self.residual_norms.push((remaining.max(0.0) / energy).sqrt());
    }

    /// Least-squares coefficients over the first `atoms` atoms of the support (all of it if it has
    /// fewer).
    #[must_use]
    pub fn coefficients(&self, atoms: usize) -> Vec<f64> {
        let atoms = atoms.min(self.support.len());
        let mut x: Vec<f64> = self.steps[..atoms].iter().map(|&s| s.into()).collect();
        self.substitute_back(&mut x);
        x
    }

    /// Replaces `g` by the solution of `G x = g` over the whole support, where `G` is the support's
    /// Gram matrix. The accuracy is that of the factorisation in this number type.
    pub(super) fn divide(&self, g: &mut [f64]) {
        for i in 0..g.len() {
            let row = self.factor_row(i);
            let (known, rest) = g.split_at_mut(i);
            let sum: f64 = known.iter().zip(row).map(|(x, &entry)| x * entry.into()).sum();
            rest[0] = (rest[0] - sum) / row[i].into();
        }
        self.substitute_back(g);
    }

    fn factor_row(&self, i: usize) -> &[T] {
        &self.factor[i * (i + 1) / 2..][..=i]
    }

    fn substitute_back(&self, x: &mut [f64]) {
        for i in (0..x.len()).rev() {
            let row = self.factor_row(i);
            let (known, rest) = x.split_at_mut(i);
            rest[0] /= Into::<f64>::into(row[i]);
            for (x, &entry) in known.iter_mut().zip(row) {
                *x -= entry.into() * rest[0];
            }
        }
    }

    /// The solution over the whole support.
    #[must_use]
    pub fn solution(self) -> Solution {
        let coefficients = self.coefficients(self.support.len());
        let Self { support, residual_norms, stop, unseen, .. } = self;
        Solution { support, coefficients, residual_norms, stop, unseen }
    }
}
