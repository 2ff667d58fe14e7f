//! Orthogonal matching pursuit with non-negative coefficients, for atoms that are light.
//!
//! # Invariant
//! After every atom the coefficients are the non-negative least-squares solution over the support
//! (`tests::nonnegative::the_solution_is_the_best_of_those_that_are_nowhere_negative`), so the norm
//! of the residual never grows (`tests::nonnegative::with_every_step_less_is_left`). An atom whose
//! coefficient would become negative is removed from the support.
//!
//! With no limit on the atoms this is C. Lawson and R. Hanson, *Solving Least Squares Problems*
//! (1974), chapter 23, whose choice of the next atom is matching pursuit's without the magnitude;
//! see A. Bruckstein et al., *On the uniqueness of nonnegative sparse solutions to underdetermined
//! systems of equations* (2008).

use super::dictionary::{Dictionary, padded};
use super::pursuit::energy;
use super::scalar::Scalar;
use super::{Limits, OmpError, Solution, Stop, finite};
use nalgebra::{DMatrix, DVector};

/// Number of removed atoms, per atom of the dictionary, after which the search ends; the value is
/// Lawson and Hanson's.
const EXCHANGES: usize = 3;

/// Finds a sparse, non-negative `x` such that the dictionary times `x` is near `y`. Atoms can be
/// removed again, so `residual_norms` of the solution has only the first and the last norm.
///
/// A choice takes `N` products for each atom in the support; the coefficients take a third of the
/// cube of the support's size.
///
/// # Errors
/// [`OmpError`] if `y` does not fit the dictionary, a number is not finite, or a limit is negative
/// or NaN.
pub fn solve<T: Scalar, D: Dictionary<T> + ?Sized>(
    dictionary: &D,
    y: &[T],
    limits: &Limits,
) -> Result<Solution, OmpError> {
    limits.check()?;
    if y.len() != dictionary.measurements() {
        return Err(OmpError::Length { found: y.len(), expected: dictionary.measurements() });
    }
    finite("measurement", y)?;
    let mut p0 = vec![T::default(); padded(dictionary.atoms().count())];
    dictionary.project(y, &mut p0);
    finite("projection", &p0)?;
    let mut search = Search { dictionary, p0, energy: energy(y), taken: Vec::new() };
    let stop = search.run(limits, limits.enough(search.energy, y.len()))?;
    let unseen = dictionary.atoms().unseen().to_vec();
    let (support, coefficients) = search.taken.iter().map(|t| (t.atom, t.coefficient)).unzip();
    let left = (search.remaining().max(0.0) / search.energy).sqrt();
    let residual_norms = if search.energy > 0.0 { vec![1.0, left] } else { vec![0.0] };
    Ok(Solution { support, coefficients, residual_norms, stop, unseen })
}

struct Search<'d, T, D: ?Sized> {
    dictionary: &'d D,
    p0: Vec<T>,
    energy: f64,
    taken: Vec<Taken<T>>,
}

/// An atom of the support.
struct Taken<T> {
    atom: usize,
    coefficient: f64,
    /// The atom's column of the Gram matrix.
    column: Vec<T>,
}

impl<T: Scalar, D: Dictionary<T> + ?Sized> Search<'_, T, D> {
    fn run(&mut self, limits: &Limits, enough: f64) -> Result<Stop, OmpError> {
        let atoms = self.dictionary.atoms();
        let mut first = None;
        let most = EXCHANGES * limits.sparsity.min(atoms.count());
        for _ in 0..most {
            if self.remaining() <= enough {
                return Ok(Stop::Residual);
            }
            if self.taken.len() >= limits.sparsity {
                return Ok(Stop::Sparsity);
            }
            let p = self.projection();
            let free = |k: &usize| self.taken.iter().all(|taken| taken.atom != *k);
            let score = |k: usize| p[k] * atoms.inverse_norms()[k].into();
            let best = (0..atoms.count())
                .filter(free)
                .reduce(|best, k| if score(k) > score(best) { k } else { best });
            let Some(atom) = best else { return Ok(Stop::NoAtomLeft) };
            let best = score(atom);
            if best <= T::ROUNDING * *first.get_or_insert(best) {
                return Ok(Stop::NoAtomLeft);
            }
            let mut column = vec![T::default(); self.p0.len()];
            match self.dictionary.stored_gram_column(atom) {
                Some(stored) => column.copy_from_slice(stored),
                None => self.dictionary.gram_column(atom, &mut column),
            }
            self.taken.push(Taken { atom, coefficient: 0.0, column });
            if !self.settle() {
                self.taken.retain(|taken| taken.atom != atom);
                return Ok(Stop::Dependent);
            }
        }
        Ok(if self.remaining() <= enough { Stop::Residual } else { Stop::Sparsity })
    }

    /// Inner product of the residual with every atom.
    fn projection(&self) -> Vec<f64> {
        let mut p: Vec<f64> = self.p0.iter().map(|&p| p.into()).collect();
        for taken in &self.taken {
            for (p, &g) in p.iter_mut().zip(&taken.column) {
                *p -= taken.coefficient * g.into();
            }
        }
        p
    }

    /// Energy of the residual: with `G x = p0 - p`, the energy is `|y|^2 - sum of x (p0 + p)`.
    fn remaining(&self) -> f64 {
        let p = self.projection();
        let explained = |t: &Taken<T>| t.coefficient * (self.p0[t.atom].into() + p[t.atom]);
        self.energy - self.taken.iter().map(explained).sum::<f64>()
    }

    /// Moves the coefficients to the non-negative least-squares solution, and removes atoms on the
    /// way; false if the atoms of the support are dependent.
    fn settle(&mut self) -> bool {
        loop {
            let count = self.taken.len();
            let gram = DMatrix::from_fn(count, count, |i, j| {
                Into::<f64>::into(self.taken[j].column[self.taken[i].atom])
            });
            let right = DVector::from_fn(count, |i, _| self.p0[self.taken[i].atom].into());
            // Independence is judged by the part of each atom outside the span of all others,
            // whatever their order. A pivot compares an atom only with earlier atoms, and stays far
            // too large where several atoms together are nearly dependent.
            let independent = gram.clone().cholesky().filter(|cholesky| {
                let inverse = cholesky.inverse();
                (0..count).all(|i| inverse[(i, i)] * T::DEPENDENT * gram[(i, i)] < 1.0)
            });
            let Some(cholesky) = independent else { return false };
            let target = cholesky.solve(&right);
            // Moves towards the solution until the first coefficient reaches 0.
            let mut share = 1.0_f64;
            for (taken, &target) in self.taken.iter().zip(target.iter()) {
                if target <= 0.0 {
                    share = share.min(taken.coefficient / (taken.coefficient - target));
                }
            }
            let mut blocked = false;
            for (taken, &target) in self.taken.iter_mut().zip(target.iter()) {
                let before = taken.coefficient;
                taken.coefficient += share * (target - before);
                if target <= 0.0 && before <= share * (before - target) * (1.0 + 1e-12) {
                    taken.coefficient = 0.0;
                    blocked = true;
                }
            }
            if !blocked {
                return true;
            }
            self.taken.retain(|taken| taken.coefficient > 0.0);
        }
    }
}
