//! Reconstruction by a penalty on the image: Tikhonov, total variation, sparse coefficients.
//!
//! One number controls the penalty: its strength, relative to what noise and prior call for.
//! Cross-validation on held-back measurements chooses the strength, unless the caller gives it.
//!
//! The units are orthonormal. `A` gives the measured rows from the scene's coefficients `c` (or
//! pixels `x`), `sigma` is the noise, and `s[j]` is the expected size of coefficient `j`
//! ([`OmpSettings`](super::OmpSettings)'s prior, amplitudes as one over frequency). At strength 1
//! the minimised sum is:
//!
//! | penalty | over | maximum a posteriori for |
//! |---|---|---|
//! | Tikhonov | `abs(b - A c)^2 / 2 + sigma^2 / 2 sum_j (c[j] / s[j])^2` | independent normal coefficients: a covariance prior |
//! | sparse | `abs(b - A c)^2 / 2 + sigma^2 sqrt 2 sum_j abs(c[j]) / s[j]` | independent Laplacian coefficients |
//! | total variation | `abs(b - A x)^2 / 2 + sigma sum of abs(gradient of x)` | flat regions with edges |

mod fista;
pub(super) mod tikhonov;
pub(super) mod total_variation;

use super::selection::{self, Chosen, TRUST, Trusted};
use super::{HeldBack, Made, NoiseLevel, Problem, ReconstructError};
use crate::basis::Basis;
use crate::{Image, Measurements, fwht, words};

/// A penalty on an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Penalty {
    /// Energy of the coefficients, weighted by their expected sizes (A. N. Tikhonov, 1963), by
    /// conjugate gradients.
    Tikhonov,
    /// Magnitudes of the coefficients, by FISTA (A. Beck and M. Teboulle, *A fast iterative
    /// shrinkage-thresholding algorithm for linear inverse problems*, 2009).
    Sparse,
    /// Total variation (L. Rudin et al., 1992), by A. Chambolle and T. Pock, *A first-order
    /// primal-dual algorithm for convex problems*, 2011. This penalty needs no basis.
    TotalVariation,
}

/// Strength of a penalty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Strength {
    /// One of five strengths, a factor of about three apart: the one that predicts held-back
    /// measurements best.
    CrossValidated {
        /// Number of parts that are held back in turn, 2 or more.
        folds: usize,
    },
    /// This strength, relative to what noise and prior call for.
    Fixed(f64),
}

impl Default for Strength {
    fn default() -> Self {
        Self::CrossValidated { folds: 4 }
    }
}

impl Strength {
    pub(super) fn check(self) -> Result<(), ReconstructError> {
        let refuse =
            |setting, found, expected| Err(ReconstructError::Setting { setting, found, expected });
        match self {
            Self::Fixed(found) if !(found > 0.0 && found <= 1e6) => {
                refuse("strength", found, "more than 0, at most 1e6")
            }
            Self::CrossValidated { folds } if folds < 2 => {
                refuse("folds", folds as f64, "2 or more")
            }
            _ => Ok(()),
        }
    }
}

impl Penalty {
    /// Whether the penalty is on coefficients of a basis, and not on pixels.
    #[must_use]
    pub fn has_basis(self) -> bool {
        self != Self::TotalVariation
    }
}

/// Settings of [`regularised`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RegularisedSettings {
    /// The penalty.
    pub penalty: Penalty,
    /// Basis of the coefficients.
    pub basis: Basis,
    /// Strength of the penalty.
    pub strength: Strength,
    /// Power of the frequency with which coefficients are expected to fall; `None`: the power that
    /// the measurements themselves make likely.
    pub falloff: Option<f64>,
    /// Noise of the measurements.
    pub noise: NoiseLevel,
    /// Largest number of iterations.
    pub iterations: usize,
}

impl RegularisedSettings {
    /// The settings of this module's tests and tables.
    #[must_use]
    pub fn new(penalty: Penalty) -> Self {
        Self {
            penalty,
            basis: Basis::Dct,
            strength: Strength::default(),
            falloff: None,
            noise: NoiseLevel::Estimated,
            iterations: 200,
        }
    }

    pub(super) fn problem<'m>(&self, measurements: &'m Measurements) -> Problem<'m> {
        Problem::of(measurements, self.basis, self.falloff, self.noise)
    }

    /// What the measurements at some positions predict of all rows, for each strength.
    pub(super) fn predict(
        &self,
        problem: &Problem<'_>,
        positions: &[usize],
        strengths: &[f32],
    ) -> Vec<Vec<f32>> {
        let predict = match self.penalty {
            Penalty::Tikhonov => tikhonov::predict,
            Penalty::Sparse => fista::predict,
            Penalty::TotalVariation => total_variation::predict,
        };
        predict(problem, positions, strengths, self.iterations)
    }

    /// The rows that limit the trust in a prediction. Total variation draws edges into plain noise, so it
    /// gets the lowest limit. A limit on the sparse penalty helps nowhere and costs 0.001 of correlation
    /// on real measurements (scatter_tests.rs).
    pub(super) fn trusted(&self) -> Trusted {
        match self.penalty {
            Penalty::TotalVariation => Trusted::AsFarAsFine { standard_errors: 0.0 },
            Penalty::Tikhonov => Trusted::AsFarAsFine { standard_errors: 1.0 },
            Penalty::Sparse => Trusted::ByAll,
        }
    }

    pub(super) fn check(&self) -> Result<(), ReconstructError> {
        self.strength.check()?;
        if self.iterations == 0 {
            let (setting, expected) = ("iterations", "1 or more");
            return Err(ReconstructError::Setting { setting, found: 0.0, expected });
        }
        super::check_prior(self.falloff, self.noise)
    }
}

/// The result of [`regularised`].
#[derive(Debug, Clone, PartialEq)]
pub struct Regularised {
    /// The image, in the measurements' units.
    pub image: Image,
    /// Strength of the penalty, relative to what noise and prior call for.
    pub strength: f64,
    /// Trust: factor on the prediction for rows that were not measured, 0 (zero filling) to 1.
    pub trust: f64,
    /// Norm of the difference between the measurements and the image, relative to the measurements'
    /// norm.
    pub residual: f64,
    /// Mean weight of the readings in the measured rows: 1 where noise does not matter, 0 where the
    /// image is the fit.
    pub reading_weight: f64,
    /// How well readings were predicted without them; `None` if none was held back.
    pub held_back: Option<HeldBack>,
    /// Noise of a measurement, estimated or given, in the measurements' units.
    pub noise: f64,
}

/// Strengths to try, the strongest first. Each starts from the result of the one before.
pub(super) const STRENGTHS: [f32; 5] = [10.0, 3.0, 1.0, 0.3, 0.1];

/// Reconstructs an image from partial measurements with a penalty.
///
/// # Errors
/// [`ReconstructError`] if a setting is out of range.
pub fn regularised(
    measurements: &Measurements,
    settings: &RegularisedSettings,
) -> Result<Regularised, ReconstructError> {
    settings.check()?;
    let problem = settings.problem(measurements);
    let (at, trust, strengths, held_back) = match settings.strength {
        Strength::Fixed(strength) => (0, 1.0, vec![strength as f32], None),
        Strength::CrossValidated { folds } => {
            let choice = selection::choose_among(
                &problem,
                STRENGTHS.len(),
                folds,
                settings.trusted(),
                |kept| Ok(settings.predict(&problem, kept, &STRENGTHS)),
            )?;
            match choice {
                None => (0, TRUST[0], STRENGTHS[..1].to_vec(), None),
                Some(Chosen { at, trust, held_back }) => {
                    (at, trust, STRENGTHS[..=at].to_vec(), Some(held_back))
                }
            }
        }
    };
    let every: Vec<usize> = (0..problem.rows.len()).collect();
    let mut predictions = settings.predict(&problem, &every, &strengths);
    let predicted = predictions.swap_remove(at);
    let judged = problem.judge(held_back.as_deref(), trust);
    let made = Made::weighted(&problem, predicted, trust, held_back.as_deref());
    Ok(Regularised {
        image: made.image,
        strength: match settings.strength {
            Strength::Fixed(strength) => strength,
            Strength::CrossValidated { .. } => words::shortest(strengths[at]),
        },
        trust: f64::from(trust),
        residual: made.residual,
        reading_weight: made.reading_weight,
        held_back: judged,
        noise: problem.noise_in_units(),
    })
}

/// Some measurements in a zero-filled grid of all rows, and a mask with a 1 at each of their rows.
struct Masked {
    grid: Vec<f32>,
    mask: Vec<f32>,
}

impl Masked {
    fn new(problem: &Problem<'_>, positions: &[usize]) -> Self {
        let area = problem.side.area();
        let (mut grid, mut mask) = (vec![0.0; area], vec![0.0; area]);
        for &k in positions {
            let row = problem.rows[k] as usize;
            (grid[row], mask[row]) = (problem.values[k], 1.0);
        }
        Self { grid, mask }
    }
}

/// Orthonormal Walsh-Hadamard transform: its own inverse and transpose.
fn walsh(n: usize, grid: &mut [f32]) {
    fwht::transform(grid);
    grid.iter_mut().for_each(|v| *v /= n as f32);
}

/// Replaces coefficients by the measurements of all rows that they predict.
fn show(problem: &Problem<'_>, coefficients: &mut [f32]) {
    problem.transform.synthesise(coefficients);
    walsh(problem.side.pixels(), coefficients);
}

/// Replaces measurements by coefficients: the transpose, and inverse, of [`show`].
fn see(problem: &Problem<'_>, grid: &mut [f32]) {
    walsh(problem.side.pixels(), grid);
    problem.transform.analyse(grid);
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
}

#[cfg(test)]
mod tests;
