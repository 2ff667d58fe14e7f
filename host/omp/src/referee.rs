//! Chooses in double precision between atoms that single precision cannot distinguish.
//!
//! The pursuit runs in `f32`. For the few atoms whose scores differ by no more than the rounding of
//! `f32`, the correlations with the residual are computed in `f64`, from the Gram matrix of the
//! support alone. So only doubtful choices cost double precision.
//!
//! With `G` the support's Gram matrix and `p0` its initial projection, both in `f64`, the
//! coefficients solve `G x = p0`. The pursuit's `f32` factor of `G` gives `x` by iterative
//! refinement, where each step gains the digits of `f32` (C. B. Moler, *Iterative refinement in
//! floating point*, 1967). The correlation of rival `j` is then
//! `d[j] y - sum over the support of G[i, j] x[i]`: some `5 K^2` products for a choice, where the
//! whole pursuit in `f64` takes `N K^2 / 2` for a measurement.

use super::dense::DenseDictionary;
use super::dictionary::Dictionary;
use super::path::Path;
use nalgebra::DMatrix;

/// Chooses between atoms whose scores are too close for a number type.
pub(super) trait Referee<T> {
    /// Smallest lead over the next best atom, relative to the measurement's norm, that needs no
    /// referee.
    fn believed(&self) -> f64;

    /// Chooses one of `rivals`, which are at least one, in ascending order; `path` holds the
    /// earlier choices.
    fn choose(&mut self, path: &Path<T>, rivals: &[usize]) -> usize;
}

/// No referee: the largest score wins.
impl<T> Referee<T> for () {
    fn believed(&self) -> f64 {
        0.0
    }

    fn choose(&mut self, _: &Path<T>, rivals: &[usize]) -> usize {
        rivals[0]
    }
}

impl<T, R: Referee<T>> Referee<T> for Option<R> {
    fn believed(&self) -> f64 {
        self.as_ref().map_or(0.0, R::believed)
    }

    fn choose(&mut self, path: &Path<T>, rivals: &[usize]) -> usize {
        self.as_mut().map_or(rivals[0], |referee| referee.choose(path, rivals))
    }
}

/// Smallest lead over the next best atom, relative to the measurement's norm, that counts as
/// certain. Measured errors of initial projections were up to 1.02 epsilons (1024 atoms of unit
/// norm, 256 to 1024 normal measurements).
pub(super) const BELIEVED: f64 = 8.0 * f32::EPSILON as f64;

/// Smallest distance of the residual's energy from the limit, relative to the measurement's energy,
/// that counts as certain. The residual's energy is a difference of squares in `f32`.
pub(super) const BELIEVED_ENERGY: f64 = 64.0 * f32::EPSILON as f64;

/// Change of the coefficients, relative to the largest, below which a further step would only add
/// rounding.
pub(super) const REFINED: f64 = 1e-11;

/// Largest number of refinement steps. A Gram matrix that needs more steps has ended the pursuit in
/// `f32` before.
pub(super) const STEPS: usize = 5;

/// The same measurement and dictionary in double precision.
pub(super) struct DoubleReferee<'a> {
    matrix: &'a DMatrix<f64>,
    dictionary: &'a DenseDictionary<f64>,
    y: &'a [f64],
    /// Initial projection of the support.
    p0: Vec<f64>,
    /// Lower triangle of the support's Gram matrix, row after row.
    gram: Vec<f64>,
}

impl<'a> DoubleReferee<'a> {
    pub(super) fn new(
        matrix: &'a DMatrix<f64>,
        dictionary: &'a DenseDictionary<f64>,
        y: &'a [f64],
    ) -> Self {
        Self { matrix, dictionary, y, p0: Vec::new(), gram: Vec::new() }
    }

    fn atom(&self, k: usize) -> &'a [f64] {
        let rows = self.matrix.nrows();
        &self.matrix.as_slice()[k * rows..(k + 1) * rows]
    }

    /// Inner products of atom `k` with the atoms of `support`.
    fn gram_of(&self, k: usize, support: &[usize]) -> Vec<f64> {
        match self.dictionary.stored_gram_column(k) {
            Some(column) => support.iter().map(|&i| column[i]).collect(),
            None => support.iter().map(|&i| dot(self.atom(k), self.atom(i))).collect(),
        }
    }

    /// Coefficients of the support.
    fn coefficients(&mut self, path: &Path<f32>) -> Vec<f64> {
        for known in self.p0.len()..path.support.len() {
            let k = path.support[known];
            self.p0.push(dot(self.atom(k), self.y));
            let row = self.gram_of(k, &path.support[..=known]);
            self.gram.extend(row);
        }
        let mut x = path.coefficients(path.support.len());
        for _ in 0..STEPS {
            let mut change = self.missing(&x);
            path.divide(&mut change);
            x.iter_mut().zip(&change).for_each(|(x, change)| *x += change);
            if largest(&change) <= REFINED * largest(&x) {
                break;
            }
        }
        x
    }

    /// `p0 - G x`.
    fn missing(&self, x: &[f64]) -> Vec<f64> {
        let mut missing = self.p0.clone();
        let mut rest = &self.gram[..];
        for i in 0..x.len() {
            let (row, below) = rest.split_at(i + 1);
            rest = below;
            let (before, own) = missing.split_at_mut(i);
            let mut sum = row[i] * x[i];
            for ((missing, g), x_before) in before.iter_mut().zip(row).zip(x) {
                *missing -= g * x[i];
                sum += g * x_before;
            }
            own[0] -= sum;
        }
        missing
    }
}

impl Referee<f32> for DoubleReferee<'_> {
    fn believed(&self) -> f64 {
        BELIEVED
    }

    fn choose(&mut self, path: &Path<f32>, rivals: &[usize]) -> usize {
        let x = self.coefficients(path);
        let inverse_norms = self.dictionary.atoms().inverse_norms();
        let score = |&k: &usize| {
            let explained = dot(&self.gram_of(k, &path.support), &x);
            (dot(self.atom(k), self.y) - explained).abs() * inverse_norms[k]
        };
        let mut best = (rivals[0], score(&rivals[0]));
        for rival in &rivals[1..] {
            let score = score(rival);
            if score > best.1 {
                best = (*rival, score);
            }
        }
        best.0
    }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, v| v.abs().max(most))
}

/// Inner product, in eight sums that do not wait for each other.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut sums = [0.0_f64; 8];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::normal;
    use crate::{Limits, Solver, reference};
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    /// Atoms that have much in common, whose coefficients single precision finds to a few digits.
    #[test]
    fn coefficients_and_choices_are_those_of_double_precision() {
        let mut random = Pcg64::seed_from_u64(8);
        let single = |v: f64| f64::from(v as f32);
        let matrix = DMatrix::from_fn(48, 60, |_, k| {
            single((1.0 + k as f64 / 9.0) * (normal(&mut random) + 15.0))
        });
        let y: Vec<f64> = (0..48).map(|_| single(normal(&mut random))).collect();
        let exact = |atoms| reference::solve(&matrix, &y, &Limits::atoms(atoms)).unwrap();
        let few = DenseDictionary::new(&matrix.map(|v| v as f32));
        let y32: Vec<f32> = y.iter().map(|&y| y as f32).collect();
        let path = |atoms| Solver::new(&few, &Limits::atoms(atoms)).unwrap().solve(&y32).unwrap();
        assert_eq!(path(12).support, exact(12).support);
        let worst = |found: &[f64]| {
            let exact = exact(12).coefficients;
            assert_eq!(found.len(), exact.len());
            let errors = found.iter().zip(&exact).map(|(a, b)| (a - b).abs());
            errors.fold(0.0, f64::max) / largest(&exact)
        };
        let rough = worst(&path(12).coefficients(12));
        assert!(rough > 1e-5, "{rough}");
        // With the Gram matrix and without it, in one go and after an earlier choice.
        for bytes in [usize::MAX, 0] {
            let double = DenseDictionary::with_gram_within(&matrix, bytes);
            for before in [0, 5] {
                let mut referee = DoubleReferee::new(&matrix, &double, &y);
                referee.coefficients(&path(before));
                let found = worst(&referee.coefficients(&path(12)));
                assert!(found < 1e-11, "{found}, {bytes} bytes, after {before}");
                assert_eq!(referee.believed(), BELIEVED);
            }
            let support = exact(13).support;
            for (chosen, next) in support.iter().enumerate() {
                let rivals: Vec<usize> =
                    (0..60).filter(|k| !support[..chosen].contains(k)).collect();
                let mut referee = DoubleReferee::new(&matrix, &double, &y);
                assert_eq!(referee.choose(&path(chosen), &rivals), *next, "after {chosen}");
            }
        }
    }

    #[test]
    fn of_equal_rivals_the_lowest_is_chosen() {
        let mut matrix = DMatrix::identity(4, 6);
        matrix[(1, 4)] = 1.0;
        let double = DenseDictionary::new(&matrix).unnormalised();
        let y = [0.5, 2.0, 1.0, 0.0];
        let path = Solver::new(&DenseDictionary::new(&matrix.map(|v| v as f32)), &Limits::atoms(0))
            .unwrap()
            .solve(&y.map(|y| y as f32))
            .unwrap();
        assert_eq!(DoubleReferee::new(&matrix, &double, &y).choose(&path, &[0, 1, 2, 4]), 1);
    }
}
