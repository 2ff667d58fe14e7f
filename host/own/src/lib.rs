#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! # Invariant
//! Nothing is assumed about the patterns. The strength of a penalty, or the number of atoms, is the
//! one that best predicts held-back measurements, unless the caller gives it (as many
//! orthogonal patterns as pixels, or Tikhonov's method where the noise is known: the likeliest one). Units do not matter
//! (`tests::units_of_patterns_and_measurements_do_not_matter`). The mean of the image, which
//! patterns of zeros and ones measure far better than any detail, has no penalty.
//!
//! # The dark level
//! A detector reads something without light: ambient light, the offset of an amplifier. It is one
//! unknown constant beside the image, without a penalty: `y = A x + dark`. So the image does not depend
//! on it (`tests::a_dark_level_changes_no_image`). Two cases need a choice:
//!
//! - The weights of all patterns have the same sum. Then a dark level looks like the mean of the image:
//!   it counts as light, [`DarkLevel::Unknown`]. If that sum is 0, no pattern sees the mean.
//! - The pseudo-inverse of as few patterns as pixels, or fewer, explains any constant by some image. All
//!   rows of a Hadamard matrix explain it by one bright pixel. The dark level is then that of the
//!   smoothest image, [`DarkLevel::Smoothest`]. Penalties choose by themselves.
//!
//! # Methods
//!
//! `A` are the patterns, one in each row, `y` the measurements, `c` the coefficients of the image
//! in a basis, and `s` their expected sizes (amplitudes as one over frequency, as in
//! [`OmpSettings`](nirspi_recon::reconstruct::OmpSettings)):
//!
//! | method | the image is |
//! |---|---|
//! | pseudo-inverse | the least of those for which `abs(y - A x)` is least, by conjugate gradients (A. Björck, *Numerical Methods for Least Squares Problems*, 1996, 7.4); of orthogonal patterns, `A A^T = D`, it is `A^T D^-1 y` |
//! | Tikhonov | where `abs(y - A c)^2 + t sum_j (c[j] / s[j])^2` is least |
//! | sparse | where `abs(y - A c)^2 / 2 + t sqrt 2 sum_j abs(c[j]) / s[j]` is least, by FISTA |
//! | total variation | where `abs(y - A x)^2 / 2 + t sum of abs(gradient of x)` is least, by Chambolle and Pock |
//! | OMP | Algorithm 1 over `[A diag(s); sqrt t]`, `t` being Tikhonov's |
//!
//! `t` is relative to the measurements' variance, for `A` with norm 1; for total variation,
//! relative to the standard deviation.

mod complete;
mod doubt;
mod error;
mod folds;
mod gram;
mod live;
mod many;
mod noise;
mod outliers;
mod problem;
mod pseudo_inverse;
mod solvers;
mod symmetric;

pub use doubt::MatrixDoubt;
pub use error::MatrixError;
pub use live::LiveMatrix;
use nalgebra::{DMatrix, DVector};
use nirspi_recon::basis::{Basis, Transform};
use nirspi_recon::omp::Stop;
use nirspi_recon::reconstruct::{HeldBack, MatrixMethod, MatrixSettings, Penalty};
use nirspi_recon::{Image, Shape, Size};
pub use noise::{KnownNoise, NoiseFrom};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// A user's own patterns, one in each row, of `height * width` weights each.
#[derive(Debug, Clone)]
pub struct OwnMatrix {
    size: Size,
    patterns: DMatrix<f64>,
    rank: usize,
    /// Squared norm of each pattern, if all patterns are orthogonal to each other.
    orthogonal: Option<DVector<f64>>,
}

/// The result of [`OwnMatrix::reconstruct`].
#[derive(Debug, Clone, PartialEq)]
pub struct MatrixReconstruction {
    /// The image, in the measurements' units divided by the patterns'.
    pub image: Image<Size>,
    /// The method that made it: never [`MatrixMethod::Best`].
    pub method: MatrixMethod,
    /// Strength of the penalty; `None` for the pseudo-inverse.
    pub strength: Option<f64>,
    /// For OMP, the number of atoms and why the pursuit stopped.
    pub atoms: Option<(usize, Stop)>,
    /// The dark level.
    pub dark: DarkLevel,
    /// Norm of the residual, relative to the norm of the measurements without the dark level.
    pub residual: f64,
    /// Number of linearly independent patterns among those that the image is made of.
    pub rank: usize,
    /// Numbers of the measurements that no scene can have given beside the others. The image is made without them.
    pub outliers: Vec<usize>,
    /// How well held-back measurements are predicted by the others, by Tikhonov's method: of no more patterns than pixels,
    /// that are not a complete orthogonal set, if the [settings](MatrixSettings::judge) want it.
    pub held_back: Option<HeldBack>,
    /// A doubt whether the measurements belong to the patterns.
    pub doubt: Option<MatrixDoubt>,
}

/// The detector's reading without light, in the measurements' units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DarkLevel {
    /// The settings leave it out: it counts as 0.
    LeftOut,
    /// The level that fits the measurements best.
    Fitted(f64),
    /// Images explain any level; this one gives the smoothest image.
    Smoothest(f64),
    /// All patterns have the same sum of weights, so that the level looks like the mean of the image. It
    /// counts as 0.
    Unknown,
}

impl DarkLevel {
    /// The level that was subtracted from the measurements.
    #[must_use]
    pub fn value(self) -> f64 {
        match self {
            Self::Fitted(level) | Self::Smoothest(level) => level,
            Self::LeftOut | Self::Unknown => 0.0,
        }
    }

    /// What the user should know about the level beside its value.
    #[must_use]
    pub fn note(self) -> Option<&'static str> {
        match self {
            Self::LeftOut | Self::Fitted(_) => None,
            Self::Smoothest(_) => Some(
                "the patterns are too few to measure a dark level: it is that of the smoothest image that fits",
            ),
            Self::Unknown => Some(
                "the weights of all patterns have the same sum: a dark level cannot be told from the mean of the image and is a part of the mean",
            ),
        }
    }
}

/// Strengths to try, the strongest first.
const STRENGTHS: [f64; 7] = [1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6];

/// Number of parts of the measurements. Each part is held back once.
const FOLDS: usize = 4;

/// Seed of the split of the measurements. The split changes the result, so the seed never changes.
const SPLIT_SEED: u64 = 0x5eed;

/// Squared error, relative to the least error, that counts as equally good. If patterns do not
/// predict each other, all errors are alike.
const AS_GOOD: f64 = 1.1;

/// The most weights of all patterns for which [`MatrixMethod::Best`] tries total variation.
const TRIED: usize = 1 << 20;

/// Numbers of atoms to try, up to the number of measurements.
const SPARSITIES: [usize; 10] = [1, 2, 4, 8, 16, 32, 64, 128, 200, 300];

/// The most measurements at a time: images on trial are in memory for all of them.
const BATCH: usize = 128;

/// Smallest pivot of the Gram matrix, relative to the largest, for which a pattern counts as
/// linearly independent.
const NEW: f64 = 1e-11;

/// The same in single precision, for which a pattern is independent without a closer look.
const SURELY_NEW: f64 = 1e-4;

/// Number of patterns from which a first look in single precision saves time.
const MANY: usize = 512;

/// Number of patterns for each pixel more than there are patterns, in a look at some of the pixels.
const ENOUGH_PIXELS: usize = 8;

/// Relative difference of sums of weights that counts as rounding.
const SAME_SUM: f64 = 1e-9;

/// Part of the energy of a constant that images must leave unexplained for the measurements to say
/// something of a dark level.
const UNEXPLAINED: f64 = 1e-6;

impl OwnMatrix {
    /// A matrix from the weights of one pattern after another, row-major.
    ///
    /// # Errors
    /// [`MatrixError`] if the weights are not whole patterns, are not finite, or are all 0.
    pub fn new(size: impl Shape, weights: &[f64]) -> Result<Self, MatrixError> {
        let size: Size = size.into();
        let area = size.area();
        if weights.is_empty() || !weights.len().is_multiple_of(area) {
            return Err(MatrixError::Shape { found: weights.len(), size });
        }
        finite("matrix", weights, area)?;
        Self::of(size, DMatrix::from_row_slice(weights.len() / area, area, weights))
    }

    fn of(size: Size, patterns: DMatrix<f64>) -> Result<Self, MatrixError> {
        let orthogonal = energies_if_orthogonal(&patterns);
        let rank = match &orthogonal {
            Some(_) => patterns.nrows(),
            None => rank(&patterns),
        };
        if rank == 0 {
            return Err(MatrixError::Dark);
        }
        Ok(Self { size, patterns, rank, orthogonal })
    }

    /// Height and width of the image.
    #[must_use]
    pub fn size(&self) -> Size {
        self.size
    }

    /// Number of patterns.
    #[must_use]
    pub fn patterns(&self) -> usize {
        self.patterns.nrows()
    }

    /// Number of linearly independent patterns, to rounding.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Number of pixels with weight 0 in all patterns.
    #[must_use]
    pub fn unseen_pixels(&self) -> usize {
        self.patterns.column_iter().filter(|column| column.iter().all(|&w| w == 0.0)).count()
    }

    /// Reconstructs the image from `y`, one measurement for each pattern.
    ///
    /// # Errors
    /// [`MatrixError`] if `y` does not fit the matrix, or a setting is not valid.
    pub fn reconstruct(
        &self,
        y: &[f64],
        settings: &MatrixSettings,
    ) -> Result<MatrixReconstruction, MatrixError> {
        Ok(self.reconstruct_all(&[y], settings)?.remove(0))
    }

    /// The images of any number of measurements, each with one number for each pattern. Each image is
    /// that of [`reconstruct`](Self::reconstruct) (`tests::many::images_are_those_of_each_alone`), and
    /// what depends on the patterns alone is found out once.
    ///
    /// # Errors
    /// As [`reconstruct`](Self::reconstruct).
    pub fn reconstruct_all(
        &self,
        all: &[&[f64]],
        settings: &MatrixSettings,
    ) -> Result<Vec<MatrixReconstruction>, MatrixError> {
        self.check(all, settings)?;
        let expected = outliers::Expected::new(self);
        let outliers: Vec<Vec<usize>> =
            all.par_iter().map(|y| expected.outliers(self, y, settings.dark)).collect();
        let (whole, others): (Vec<usize>, Vec<usize>) =
            (0..all.len()).partition(|&at| outliers[at].is_empty());
        let mut found: Vec<Option<MatrixReconstruction>> = vec![None; all.len()];
        let kept = many::Kept::default();
        for which in whole.chunks(BATCH) {
            let settings = settings.of_some(which);
            let some: Vec<&[f64]> = which.iter().map(|&at| all[at]).collect();
            let images = many::Many::new(self, &settings, &some, &kept).images()?;
            which.iter().zip(images).for_each(|(&at, image)| found[at] = Some(image));
        }
        for at in others {
            let settings = settings.of_some(&[at]);
            found[at] = Some(self.without(outliers[at].clone(), all[at], &settings)?);
        }
        Ok(found.into_iter().flatten().collect())
    }

    /// The image without the measurements of these numbers.
    fn without(
        &self,
        outliers: Vec<usize>,
        y: &[f64],
        settings: &MatrixSettings,
    ) -> Result<MatrixReconstruction, MatrixError> {
        let left: Vec<usize> = (0..y.len()).filter(|k| !outliers.contains(k)).collect();
        let own = Self::of(self.size, self.patterns.select_rows(&left))?;
        let y: Vec<f64> = left.iter().map(|&k| y[k]).collect();
        let made = many::Many::new(&own, settings, &[&y], &many::Kept::default()).images()?;
        made.into_iter()
            .next()
            .map(|made| MatrixReconstruction { outliers, ..made })
            .ok_or(MatrixError::Dark)
    }

    fn check(&self, all: &[&[f64]], settings: &MatrixSettings) -> Result<(), MatrixError> {
        for y in all {
            if y.len() != self.patterns() {
                return Err(MatrixError::Length { found: y.len(), expected: self.patterns() });
            }
            finite("y", y, 1)?;
        }
        let (size, area) = (self.size, self.size.area());
        if let Some(atoms) = &settings.atoms {
            if atoms.is_empty() || !atoms.len().is_multiple_of(area) {
                return Err(MatrixError::Shape { found: atoms.len(), size });
            }
            let atoms: Vec<f64> = atoms.iter().map(|&v| v.into()).collect();
            finite("dictionary", &atoms, area)?;
        }
        if settings.atoms.is_none() {
            self.transform(settings.basis)?;
        }
        if settings.non_negative && settings.atoms.is_none() && settings.basis != Basis::Pixel {
            return Err(MatrixError::Signed { basis: settings.basis });
        }
        if let Some(found) = settings.noise.filter(|sigma| !(sigma.is_finite() && *sigma >= 0.0)) {
            let expected = "a standard deviation of 0 or more";
            return Err(MatrixError::Setting { setting: "noise", found, expected });
        }
        match settings.strength {
            Some(found) if !(found > 0.0 && found <= 1e6) => {
                let expected = "more than 0, at most 1e6";
                Err(MatrixError::Setting { setting: "strength", found, expected })
            }
            _ => Ok(()),
        }
    }

    /// Whether an image with these settings depends on how large the [noise](MatrixSettings::noise) is: by Tikhonov's method
    /// over a basis, whose strength is not given, of as many patterns as pixels at most.
    #[must_use]
    pub fn weighs_noise(&self, settings: &MatrixSettings) -> bool {
        let is_tikhonov = matches!(
            settings.method,
            MatrixMethod::Best | MatrixMethod::Penalty(Penalty::Tikhonov)
        );
        is_tikhonov
            && settings.strength.is_none()
            && settings.atoms.is_none()
            && settings.basis != Basis::Pixel
            && self.patterns() <= self.size.area()
    }

    fn transform(&self, basis: Basis) -> Result<Transform<Size>, MatrixError> {
        let size = self.size;
        Transform::of_size(basis, size).ok_or(MatrixError::Basis { basis, size })
    }
}

/// The measurements that are kept and those that are held back, for each fold with both.
fn folds(count: usize) -> impl Iterator<Item = (Vec<usize>, Vec<usize>)> {
    let mut shuffled: Vec<usize> = (0..count).collect();
    shuffled.shuffle(&mut Pcg64::seed_from_u64(SPLIT_SEED));
    (0..FOLDS)
        .map(move |fold| {
            let of = |held: bool| -> Vec<usize> {
                let part = shuffled.iter().enumerate();
                part.filter(|(i, _)| (i % FOLDS == fold) == held).map(|(_, &k)| k).collect()
            };
            (of(false), of(true))
        })
        .filter(|(kept, held)| !kept.is_empty() && !held.is_empty())
}

fn as_good_as_the_best(errors: &[f64]) -> impl Fn(&f64) -> bool {
    let least = errors.iter().copied().fold(f64::INFINITY, f64::min);
    move |error| *error <= AS_GOOD * least
}

/// The last of the equally good results, which has the smallest residual.
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

/// Squared norm of each pattern.
fn energies(patterns: &DMatrix<f64>) -> DVector<f64> {
    let mut energies = DVector::zeros(patterns.nrows());
    for column in patterns.column_iter() {
        energies.zip_apply(&column, |energy: &mut f64, weight| *energy += weight * weight);
    }
    energies
}

/// Squared norms of the patterns, if all patterns are orthogonal to each other. `A A^T v` is
/// compared with `D v` for a few random `v`: non-orthogonal patterns would have to pass every
/// comparison by chance.
fn energies_if_orthogonal(patterns: &DMatrix<f64>) -> Option<DVector<f64>> {
    const TRIALS: usize = 3;
    const ROUNDING: f64 = 1e-9;
    let (rows, columns) = patterns.shape();
    if rows > columns {
        return None;
    }
    let energies = energies(patterns);
    if energies.iter().any(|&energy| energy == 0.0) {
        return None;
    }
    let mut random = Pcg64::seed_from_u64(SPLIT_SEED);
    let holds = (0..TRIALS).all(|_| {
        // Patterns of any norm have equal weight.
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

/// An image made of each pattern, in a column.
fn images(patterns: &DMatrix<f64>, make: impl Fn(&mut [f64]) -> Vec<f32> + Sync) -> DMatrix<f32> {
    let (count, area) = patterns.shape();
    let mut images = DMatrix::<f32>::zeros(area, count);
    images.as_mut_slice().par_chunks_exact_mut(area).enumerate().for_each(|(k, image)| {
        let mut weights: Vec<f64> = patterns.row(k).iter().copied().collect();
        image.copy_from_slice(&make(&mut weights));
    });
    images
}

/// The rank by pivoted Cholesky factorisation of the smaller Gram matrix, as far as the
/// factorisation goes.
fn rank(patterns: &DMatrix<f64>) -> usize {
    // The squares of very large or very small weights leave the range of floating point.
    let largest = patterns.amax();
    if largest == 0.0 {
        return 0;
    }
    let relative = |pattern: &mut [f64]| pattern.iter().map(|w| (w / largest) as f32).collect();
    let (count, pixels) = patterns.shape();
    let are_independent = |patterns: &DMatrix<f64>| {
        gram::are_independent(gram::gram(&images(patterns, relative)), SURELY_NEW)
    };
    if (MANY..=pixels).contains(&count) {
        // Patterns that are independent in some of the pixels are so in all.
        let some = count + count / ENOUGH_PIXELS;
        let in_some = || {
            let places: Vec<usize> = (0..some).map(|k| k * pixels / some).collect();
            are_independent(&patterns.select_columns(&places))
        };
        if (some < pixels && in_some()) || are_independent(patterns) {
            return count;
        }
    }
    let patterns = &(patterns / largest);
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
mod testing;
#[cfg(test)]
mod tests;
