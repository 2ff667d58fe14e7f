//! Measurements by patterns of the user's own: any real matrix instead of Hadamard rows.
//!
//! The one law: nothing is assumed of the patterns. How strong a penalty is, or how many atoms there are, is what predicts
//! measurements best that were held back, unless the caller gives it; and the mean of the image, which patterns of zeros and
//! ones see far better than anything else, is never held against it.
//!
//! With `A` the patterns, one a row, `y` the measurements, `c` the coefficients of the image in a basis and `s` what is
//! expected of them (amplitudes as one over frequency, as in [`OmpSettings`](super::OmpSettings)):
//!
//! | method | the image is |
//! |---|---|
//! | pseudo-inverse | the least of those for which `abs(y - A x)` is least, by conjugate gradients (A. Björck, *Numerical Methods for Least Squares Problems*, 1996, 7.4); of orthogonal patterns, `A A^T = D`, it is `A^T D^-1 y` |
//! | Tikhonov | where `abs(y - A c)^2 + t sum_j (c[j] / s[j])^2` is least |
//! | sparse | where `abs(y - A c)^2 / 2 + t sqrt 2 sum_j abs(c[j]) / s[j]` is least, by FISTA |
//! | total variation | where `abs(y - A x)^2 / 2 + t sum of abs(gradient of x)` is least, by Chambolle and Pock |
//! | OMP | Algorithm 1 over `[A diag(s); sqrt t]`, `t` being Tikhonov's |
//!
//! `t` is relative to the measurements' variance, `A` having norm 1; for total variation to the root of that.

mod problem;
mod solvers;

use super::Penalty;
use crate::basis::Basis;
use crate::omp::{OmpError, Stop};
use crate::{Image, Side};
use nalgebra::{DMatrix, DVector};
use problem::Problem;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use thiserror::Error;

/// Patterns, one a row, of `side * side` weights each.
#[derive(Debug, Clone)]
pub struct OwnMatrix {
    side: Side,
    patterns: DMatrix<f64>,
    rank: usize,
    /// Squared norm of each pattern, where no pattern has a part along another.
    orthogonal: Option<DVector<f64>>,
}

/// What is wrong with a matrix, its measurements or a setting.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum MatrixError {
    /// No whole patterns.
    #[error("{found} numbers, expected a multiple of the {area} pixels of a {n} x {n} image", n = area.isqrt())]
    Shape {
        /// Numbers in all.
        found: usize,
        /// Pixels of an image.
        area: usize,
    },
    /// A weight or measurement is NaN or infinite.
    #[error("{field} is {found} at [{row}, {column}], expected finite numbers")]
    NotFinite {
        /// `matrix` or `y`.
        field: &'static str,
        /// Pattern.
        row: usize,
        /// Pixel.
        column: usize,
        /// What was found.
        found: f64,
    },
    /// No pattern lets any light through.
    #[error("a matrix of rank 0: every weight is 0, expected patterns that see something")]
    Dark,
    /// Not one measurement a pattern.
    #[error("{found} measurements by {expected} patterns, expected one a pattern")]
    Length {
        /// Measurements.
        found: usize,
        /// Patterns.
        expected: usize,
    },
    /// A setting out of range.
    #[error("{setting} is {found}, expected {expected}")]
    Setting {
        /// Which.
        setting: &'static str,
        /// What was given.
        found: f64,
        /// What would do.
        expected: &'static str,
    },
    /// Coefficients of 0 or more for atoms that are not light.
    #[error(
        "coefficients of 0 or more in the {basis} basis, expected the pixel basis or atoms of one's own"
    )]
    Signed {
        /// The basis.
        basis: Basis,
    },
    /// The pursuit refused the problem.
    #[error(transparent)]
    Pursuit(#[from] OmpError),
}

/// How to invert.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MatrixMethod {
    /// Least squares of least norm.
    PseudoInverse,
    /// The least of a penalty.
    Penalty(Penalty),
    /// Few coefficients.
    Omp,
}

/// Settings of [`OwnMatrix::reconstruct`].
#[derive(Debug, Clone, PartialEq)]
pub struct MatrixSettings {
    /// How to invert.
    pub method: MatrixMethod,
    /// Basis of the coefficients.
    pub basis: Basis,
    /// Images of the matrix's side, one after another, instead of a basis.
    pub atoms: Option<Vec<f32>>,
    /// Strength of a penalty, `t` in the module's table; without it, the best at predicting held-back measurements.
    pub strength: Option<f64>,
    /// Atoms for OMP; without it, as many as predict held-back measurements best.
    pub sparsity: Option<usize>,
    /// OMP: coefficients of 0 or more.
    pub non_negative: bool,
}

impl MatrixSettings {
    /// Everything found from the measurements, in the DCT basis.
    #[must_use]
    pub fn new(method: MatrixMethod) -> Self {
        let (atoms, strength, sparsity) = (None, None, None);
        Self { method, basis: Basis::Dct, atoms, strength, sparsity, non_negative: false }
    }
}

/// What [`OwnMatrix::reconstruct`] found.
#[derive(Debug, Clone, PartialEq)]
pub struct MatrixReconstruction {
    /// The image, in the measurements' units over the patterns'.
    pub image: Image,
    /// Strength of the penalty; none for the pseudo-inverse.
    pub strength: Option<f64>,
    /// Atoms of the representation and why there are no more, for OMP.
    pub atoms: Option<(usize, Stop)>,
    /// Norm of what the image leaves of the measurements, relative to theirs.
    pub residual: f64,
}

/// Strengths that are tried, from the strongest on.
const STRENGTHS: [f64; 7] = [1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6];

/// Parts into which measurements are split, each held back once.
const FOLDS: usize = 4;

/// Splits the measurements; part of the result, so it never changes.
const SPLIT_SEED: u64 = 0x5eed;

/// Squared error, relative to the least, that is as good: where no pattern says anything of another, all errors are alike.
const AS_GOOD: f64 = 1.1;

/// Numbers of atoms that are tried, as far as there are measurements.
const SPARSITIES: [usize; 10] = [1, 2, 4, 8, 16, 32, 64, 128, 200, 300];

/// What a pivot of the Gram matrix must be of the largest for a pattern to count as new.
const NEW: f64 = 1e-11;

impl OwnMatrix {
    /// From the weights of one pattern after another, row-major.
    ///
    /// # Errors
    /// [`MatrixError`] if these are no whole patterns of finite weights, or all of them 0.
    pub fn new(side: Side, weights: &[f64]) -> Result<Self, MatrixError> {
        let area = side.area();
        if weights.is_empty() || !weights.len().is_multiple_of(area) {
            return Err(MatrixError::Shape { found: weights.len(), area });
        }
        finite("matrix", weights, area)?;
        let patterns = DMatrix::from_row_slice(weights.len() / area, area, weights);
        let orthogonal = energies_if_orthogonal(&patterns);
        let rank = match &orthogonal {
            Some(_) => patterns.nrows(),
            None => rank(&patterns),
        };
        if rank == 0 {
            return Err(MatrixError::Dark);
        }
        Ok(Self { side, patterns, rank, orthogonal })
    }

    /// Side of the image.
    #[must_use]
    pub fn side(&self) -> Side {
        self.side
    }

    /// How many patterns there are.
    #[must_use]
    pub fn patterns(&self) -> usize {
        self.patterns.nrows()
    }

    /// How many of them are no combination of others, to rounding.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// How many pixels no pattern sees.
    #[must_use]
    pub fn unseen_pixels(&self) -> usize {
        self.patterns.column_iter().filter(|column| column.iter().all(|&w| w == 0.0)).count()
    }

    /// The image that `y`, one number a pattern, was measured of.
    ///
    /// # Errors
    /// [`MatrixError`] if `y` does not fit the matrix or a setting makes no sense.
    pub fn reconstruct(
        &self,
        y: &[f64],
        settings: &MatrixSettings,
    ) -> Result<MatrixReconstruction, MatrixError> {
        if y.len() != self.patterns() {
            return Err(MatrixError::Length { found: y.len(), expected: self.patterns() });
        }
        finite("y", y, 1)?;
        self.check(settings)?;
        let every: Vec<usize> = (0..y.len()).collect();
        let (pixels, strength, atoms) = match settings.method {
            MatrixMethod::PseudoInverse => {
                let y = DVector::from_column_slice(y);
                let pixels = match &self.orthogonal {
                    Some(energies) => self.patterns.tr_mul(&y.component_div(energies)),
                    None => solvers::least_squares(&self.patterns, &y),
                };
                (pixels, None, None)
            }
            MatrixMethod::Omp => {
                let noise = match settings.strength {
                    Some(strength) => strength,
                    // Few atoms leave more than noise: the strongest that predicts as well.
                    None => {
                        let errors = self.errors_of_strengths(y, settings, Penalty::Tikhonov)?;
                        let as_good = as_good_as_the_best(&errors);
                        STRENGTHS[errors.iter().position(as_good).unwrap_or(0)]
                    }
                };
                let sparsity = match settings.sparsity {
                    Some(sparsity) => sparsity,
                    None => self.best_sparsity(y, settings, noise)?,
                };
                let problem = Problem::new(self, settings, y, &every);
                let mut found = problem.omp(noise, &[sparsity], settings.non_negative)?;
                let (pixels, size, stop) = found.remove(0);
                (pixels, Some(noise), Some((size, stop)))
            }
            MatrixMethod::Penalty(penalty) => {
                // The same way there as in the comparison: methods that only approach their minimum remember it.
                let strengths = match settings.strength {
                    Some(strength) => vec![strength],
                    None => {
                        let errors = self.errors_of_strengths(y, settings, penalty)?;
                        STRENGTHS[..=last_as_good(&errors)].to_vec()
                    }
                };
                let problem = Problem::new(self, settings, y, &every);
                let pixels =
                    problem.penalised(penalty, &strengths).swap_remove(strengths.len() - 1);
                (pixels, strengths.last().copied(), None)
            }
        };
        let y = DVector::from_column_slice(y);
        let left = (&y - &self.patterns * &pixels).norm();
        let residual = if y.norm() > 0.0 { left / y.norm() } else { 0.0 };
        let image = Image::new(self.side, pixels.iter().map(|&v| v as f32).collect());
        Ok(MatrixReconstruction { image, strength, atoms, residual })
    }

    fn check(&self, settings: &MatrixSettings) -> Result<(), MatrixError> {
        let area = self.side.area();
        if let Some(atoms) = &settings.atoms {
            if atoms.is_empty() || !atoms.len().is_multiple_of(area) {
                return Err(MatrixError::Shape { found: atoms.len(), area });
            }
            let atoms: Vec<f64> = atoms.iter().map(|&v| v.into()).collect();
            finite("dictionary", &atoms, area)?;
        }
        if settings.non_negative && settings.atoms.is_none() && settings.basis != Basis::Pixel {
            return Err(MatrixError::Signed { basis: settings.basis });
        }
        match settings.strength {
            Some(found) if !(found > 0.0 && found <= 1e6) => {
                let expected = "more than 0, at most 1e6";
                Err(MatrixError::Setting { setting: "strength", found, expected })
            }
            _ => Ok(()),
        }
    }

    fn errors_of_strengths(
        &self,
        y: &[f64],
        settings: &MatrixSettings,
        penalty: Penalty,
    ) -> Result<Vec<f64>, MatrixError> {
        let predict = |problem: &Problem| Ok(problem.penalised(penalty, &STRENGTHS));
        self.errors(y, settings, STRENGTHS.len(), predict)
    }

    fn best_sparsity(
        &self,
        y: &[f64],
        settings: &MatrixSettings,
        noise: f64,
    ) -> Result<usize, MatrixError> {
        let sparsities: Vec<usize> = SPARSITIES.into_iter().filter(|&k| k <= y.len()).collect();
        let predict = |problem: &Problem| {
            let found = problem.omp(noise, &sparsities, settings.non_negative)?;
            Ok(found.into_iter().map(|(pixels, ..)| pixels).collect())
        };
        Ok(sparsities[last_as_good(&self.errors(y, settings, sparsities.len(), predict)?)])
    }

    /// By how much each of `count` images, made of the other measurements, misses those held back: sums of squares.
    fn errors(
        &self,
        y: &[f64],
        settings: &MatrixSettings,
        count: usize,
        predict: impl Fn(&Problem) -> Result<Vec<DVector<f64>>, MatrixError>,
    ) -> Result<Vec<f64>, MatrixError> {
        let mut shuffled: Vec<usize> = (0..y.len()).collect();
        shuffled.shuffle(&mut Pcg64::seed_from_u64(SPLIT_SEED));
        let mut errors = vec![0.0; count];
        for fold in 0..FOLDS {
            let of = |held: bool| -> Vec<usize> {
                let part = shuffled.iter().enumerate();
                part.filter(|(i, _)| (i % FOLDS == fold) == held).map(|(_, &k)| k).collect()
            };
            let (kept, held) = (of(false), of(true));
            if kept.is_empty() || held.is_empty() {
                continue;
            }
            let images = predict(&Problem::new(self, settings, y, &kept))?;
            for (error, pixels) in errors.iter_mut().zip(images) {
                let miss =
                    |&k: &usize| (y[k] - self.patterns.row(k).transpose().dot(&pixels)).powi(2);
                *error += held.iter().map(miss).sum::<f64>();
            }
        }
        Ok(errors)
    }
}

fn as_good_as_the_best(errors: &[f64]) -> impl Fn(&f64) -> bool {
    let least = errors.iter().copied().fold(f64::INFINITY, f64::min);
    move |error| *error <= AS_GOOD * least
}

/// Of those that predict as well as the best the last, which leaves least of what was measured.
fn last_as_good(errors: &[f64]) -> usize {
    errors.iter().rposition(as_good_as_the_best(errors)).unwrap_or(0)
}

fn finite(field: &'static str, values: &[f64], width: usize) -> Result<(), MatrixError> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(at) => {
            let (row, column) = (at / width, at % width);
            Err(MatrixError::NotFinite { field, row, column, found: values[at] })
        }
        None => Ok(()),
    }
}

/// Squared norms of patterns of which none has a part along another. `A A^T v` is held against `D v` for a few random `v`:
/// two patterns that are not orthogonal would have to be missed by each of them.
fn energies_if_orthogonal(patterns: &DMatrix<f64>) -> Option<DVector<f64>> {
    const TRIALS: usize = 3;
    const ROUNDING: f64 = 1e-9;
    let (rows, columns) = patterns.shape();
    if rows > columns {
        return None;
    }
    let mut energies = DVector::<f64>::zeros(rows);
    for column in patterns.column_iter() {
        energies.zip_apply(&column, |energy, weight| *energy += weight * weight);
    }
    if energies.iter().any(|&energy| energy == 0.0) {
        return None;
    }
    let mut random = Pcg64::seed_from_u64(SPLIT_SEED);
    let holds = (0..TRIALS).all(|_| {
        // Patterns of any norm weigh alike.
        let v = DVector::from_fn(rows, |k, _| (random.random::<f64>() - 0.5) / energies[k].sqrt());
        let seen = patterns * patterns.tr_mul(&v);
        let off = |k: usize| {
            ((seen[k] - energies[k] * v[k]).powi(2) / energies[k], energies[k] * v[k] * v[k])
        };
        let (missed, all) = (0..rows).map(off).fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
        missed <= ROUNDING.powi(2) * all
    });
    holds.then_some(energies)
}

/// Pivoted Cholesky factorisation of the smaller Gram matrix, as far as it goes.
fn rank(patterns: &DMatrix<f64>) -> usize {
    let mut gram = match patterns.nrows() <= patterns.ncols() {
        true => patterns * patterns.transpose(),
        false => patterns.transpose() * patterns,
    };
    let size = gram.nrows();
    let mut left: Vec<usize> = (0..size).collect();
    let largest = gram.diagonal().max();
    for found in 0..size {
        let at = left
            .iter()
            .enumerate()
            .max_by(|a, b| gram[(*a.1, *a.1)].total_cmp(&gram[(*b.1, *b.1)]));
        let Some((at, &pivot)) = at else { return found };
        let energy = gram[(pivot, pivot)];
        if energy <= NEW * largest {
            return found;
        }
        left.swap_remove(at);
        let column: DVector<f64> = gram.column(pivot) / energy.sqrt();
        for &j in &left {
            let weight = column[j];
            gram.column_mut(j).axpy(-weight, &column, 1.0);
        }
    }
    size
}

#[cfg(test)]
mod tests;
