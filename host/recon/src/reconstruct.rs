//! From measurements to an image.
//!
//! # Invariant
//! A measured Hadamard coefficient of the image is the weighted mean of reading and prediction, and
//! differs from the reading by at most [`WITHIN`] times the reading's noise
//! (`tests::what_was_measured_is_kept_within_its_noise_and_any_side_and_share_gives_an_image`). Rows
//! that were not measured are filled in: by zeros ([`hadamard`]), or by the prediction of a sparse
//! representation ([`omp()`]), scaled by how well it predicted held-back rows.
//!
//! # Why OMP is not used bare
//! Algorithm 1 over unit-norm atoms does poorly on real partial measurements: after normalisation,
//! atoms that the measured rows barely see compete with all others, and fit detail and noise with
//! huge coefficients. The baseline to beat is zero filling of a low-sequency order.
//! [`OmpSettings::default`] adds to Algorithm 1, most important first:
//!
//! 1. **Weights**: a measured coefficient keeps its reading as far as the reading's noise is below
//!    the error of the prediction (`weight.rs`); the representation fills the others.
//! 2. **A prior**: coefficients are expected to fall as one over frequency, the amplitude spectrum
//!    of natural images (D. J. Field, *Relations between the statistics of natural images and the
//!    response properties of cortical cells*, 1987), and measurements to have the noise estimated
//!    from them; see [`crate::omp::sampled`].
//! 3. **Cross-validation**: the number of atoms and the trust in the prediction (a factor from 0,
//!    zero filling, to 1) are those with the least error on rows that were measured but held back.
//!
//! The first part of the natural order is no sampling of an image: its gaps are unlike the rows that
//! could be held back, so that cross-validation cannot see what it does not know.
//! [`LOWEST_SEQUENCIES`] avoids it.

mod explain;
mod explanation;
mod frame;
mod held_back;
mod kind;
mod matrix;
mod method;
mod methods;
mod noise;
mod own_atoms;
pub mod prior;
mod pursuit;
mod recursive;
mod regularised;
mod report;
mod selection;
mod stack;
mod stacked;
mod video;
mod weight;

pub use explain::{better_shift, explanation, few_patterns_see};
pub use explanation::Explanation;
pub use frame::{believed_frame, fused_frame};
pub use held_back::HeldBack;
pub use kind::GoingOn;
pub use matrix::{MatrixMethod, MatrixSettings};
pub use method::{Method, MethodSettings, OwnAtoms, ParseMethodError, Reconstruct, Setting};
pub use methods::hadamard;
pub use noise::estimated_noise;
pub use own_atoms::omp_over;
pub use recursive::{Recursive, RecursiveFrame, RecursiveSettings};
pub use regularised::{Penalty, Regularised, RegularisedSettings, Strength, regularised};
pub use report::{Reconstruction, Report};
pub use stack::{AT_A_TIME, stack, stack_while};
pub use stacked::Stacked;
pub use video::{VideoFrame, omp_video};
pub use weight::WITHIN;

use crate::basis::{Basis, Transform};
use crate::measurements::Kind;
use crate::omp::sampled::{Prior, SampledHadamard, visible_energy};
use crate::omp::{Backend, Limits, OmpError, Stop};
use crate::{Image, Measurements, Order, Rows, Side, fwht};
use noise::Statistics;
use pursuit::{Found, How};
use std::sync::Arc;
use thiserror::Error;

/// The order for taking a part of recorded measurements, unless the user names another one: the
/// lowest sequencies first, whatever the recorded order is.
///
/// Most of a scene is in its lowest sequencies. The first part of a raster of patterns (`natural`,
/// `sequency`, `walsh-2d`) leaves out the finer half of one direction, so an image from that part
/// is folded onto itself or smeared. In this module's last table zig-zag is ahead of cake-cutting
/// up to 20 % on average, and equal at 30 %; cake-cutting is better for pages and signs with many
/// upright and level edges.
pub const LOWEST_SEQUENCIES: Order = Order::ZigZag;

/// How [`omp()`] chooses the number of atoms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sparsity {
    /// The number of atoms, up to `most`, that predicts held-back measurements best, with the trust
    /// that predicts them best. At most a quarter of the measurements.
    CrossValidated {
        /// Largest number of atoms.
        most: usize,
        /// Number of parts into which the measurements are split, 2 or more. Each part is held back
        /// once.
        folds: usize,
    },
    /// This number of atoms, with their whole prediction.
    Fixed(usize),
    /// As many atoms as reduce the residual to the noise, with their whole prediction.
    Noise,
}

impl Sparsity {
    /// Why a pursuit with this setting stopped, in words.
    #[must_use]
    pub fn reason(self, stop: Stop) -> &'static str {
        match (stop, self) {
            (Stop::Sparsity, Self::Fixed(_)) => "as many atoms as asked for",
            (Stop::Sparsity, _) => "more atoms predict no better",
            (Stop::Residual, Self::Noise) => "no more than noise is left",
            (Stop::Residual, _) => "residual reached",
            (Stop::NoAtomLeft, _) => "no atom left that explains more",
            (Stop::Dependent, _) => "atoms left are combinations of those chosen",
        }
    }
}

/// The noise of a measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoiseLevel {
    /// That of the [measurements](Measurements::noise); estimated if they have none
    /// ([`estimated_noise`]).
    Estimated,
    /// Standard deviation in the measurements' own units.
    Known(f64),
}

/// Settings of [`omp()`]. The module's documentation gives the reasons for the defaults.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OmpSettings {
    /// Basis in which the image is sparse.
    pub basis: Basis,
    /// How many atoms.
    pub sparsity: Sparsity,
    /// Norm of the residual, relative to the measurements' norm, at which the pursuit stops.
    pub residual: f64,
    /// Power of the frequency with which coefficients are expected to fall; 0 expects all to be
    /// alike. `None`: the power that the measurements themselves make likely, which costs a pursuit
    /// more than it gains where nearly all light is scattered (`scatter_tests.rs`).
    pub falloff: Option<f64>,
    /// Noise of the measurements.
    pub noise: NoiseLevel,
    /// Least share of an atom's energy that the measured rows must see for the atom to be chosen.
    pub visibility: f64,
    /// Whether the image is exactly the sparse fit. Otherwise measured rows are weighted means of
    /// reading and fit.
    pub exactly_sparse: bool,
    /// The backend of the pursuits. One image takes a few pursuits over different dictionaries, so
    /// [`Backend::Auto`] is the processor.
    pub backend: Backend,
    /// Non-negative coefficients, for atoms that are light: pixels or your own atoms.
    pub non_negative: bool,
}

impl OmpSettings {
    fn how(&self) -> How {
        How { non_negative: self.non_negative, backend: self.backend }
    }

    /// Number of atoms beyond which more atoms are not worth their time, by the module's table.
    pub const MOST_ATOMS: usize = 300;

    /// Below this visibility, an atom's correlations are as much rounding of `f32` transforms as
    /// scene.
    pub const LEAST_VISIBILITY: f64 = 1e-4;

    /// Algorithm 1 as printed in the paper: `sparsity` atoms by normalised correlation, no prior,
    /// an exactly sparse image.
    #[must_use]
    pub fn as_printed(basis: Basis, sparsity: usize) -> Self {
        Self {
            basis,
            sparsity: Sparsity::Fixed(sparsity),
            residual: 0.0,
            falloff: Some(0.0),
            noise: NoiseLevel::Known(0.0),
            visibility: Self::LEAST_VISIBILITY,
            exactly_sparse: true,
            backend: Backend::Auto,
            non_negative: false,
        }
    }
}

impl Default for OmpSettings {
    fn default() -> Self {
        Self {
            basis: Basis::Dct,
            sparsity: Sparsity::CrossValidated { most: Self::MOST_ATOMS, folds: 4 },
            residual: 0.0,
            falloff: Some(1.0),
            noise: NoiseLevel::Estimated,
            visibility: Self::LEAST_VISIBILITY,
            exactly_sparse: false,
            backend: Backend::Auto,
            non_negative: false,
        }
    }
}

/// The result of [`omp()`].
#[derive(Debug, Clone, PartialEq)]
pub struct OmpReconstruction {
    /// The image, in the measurements' units.
    pub image: Image,
    /// Number of atoms in the representation.
    pub sparsity: usize,
    /// Why the pursuit stopped; [`Stop::Sparsity`] if cross-validation chose the number of atoms.
    pub stop: Stop,
    /// Norm of the difference between the measurements and the image, relative to the measurements'
    /// norm.
    pub residual: f64,
    /// Mean weight of the readings in the measured rows: 1 where noise does not matter, 0 where the
    /// image is the fit.
    pub reading_weight: f64,
    /// How well readings were predicted without them; `None` if none was held back.
    pub held_back: Option<HeldBack>,
    /// Number of atoms that the measured rows do not see.
    pub unseen_atoms: usize,
    /// Trust: factor on the prediction for rows that were not measured, 0 (zero filling) to 1.
    pub trust: f64,
    /// Noise of a measurement, estimated or given, in the measurements' units.
    pub noise: f64,
    /// What computed, where that was found out with the stack; `None` for what the settings ask for.
    pub by: Option<ComputedBy>,
}

/// What computed an image.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ComputedBy {
    /// The backend.
    pub backend: Backend,
    /// The name of the GPU, if one computed.
    pub device: Option<Arc<str>>,
    /// Why, in one line, where that was not the user's choice.
    pub said: Option<Arc<str>>,
}

/// Why there is no image.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ReconstructError {
    /// A setting out of range.
    #[error("{setting} is {found}, expected {expected}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// The value.
        found: f64,
        /// What the setting accepts.
        expected: &'static str,
    },
    /// Atoms of the user's that are not images of the measured side.
    #[error("atoms of {found} numbers, expected a multiple of the {area} pixels of an image")]
    Atoms {
        /// Number of values in all.
        found: usize,
        /// Pixels of an image.
        area: usize,
    },
    /// Non-negative coefficients for a basis whose atoms are not light.
    #[error(
        "coefficients of 0 or more in the {basis} basis, expected the pixel basis or atoms of one's own"
    )]
    Signed {
        /// The basis.
        basis: Basis,
    },
    /// A setting that the method does not use.
    #[error("{setting} belongs to {}, not to {method}", Method::listed(|method| method.takes(*setting)))]
    NotTaken {
        /// The setting.
        setting: Setting,
        /// The method.
        method: Method,
    },
    /// The method needs Hadamard rows, and the patterns are others.
    #[error(
        "method {method} needs Hadamard rows, and these patterns are others: expected {}",
        Method::listed(|method| method.with_matrix().is_some())
    )]
    NeedsRows {
        /// The method.
        method: Method,
    },
    /// The method completes measurements by a network, and the settings hold none.
    #[error("the method {method} needs a network: give it one, or choose another method")]
    NeedsNetwork {
        /// The method.
        method: Method,
    },
    /// The network does not complete images of this side.
    #[error(
        "the network {network} does not complete images of {side} x {side} pixels: choose another method, such as {}",
        Method::TIKHONOV
    )]
    NetworkSide {
        /// The network's name.
        network: String,
        /// Side of the images.
        side: usize,
    },
    /// The pursuit refused the problem.
    #[error(transparent)]
    Pursuit(#[from] OmpError),
    /// The user has stopped the work.
    #[error("stopped")]
    Stopped,
    /// A user's own method found no image, for this reason.
    #[error("{0}")]
    Failed(String),
}

/// Reconstructs an image from partial measurements by a sparse representation.
///
/// # Errors
/// [`ReconstructError`] if a setting is out of range.
pub fn omp(
    measurements: &Measurements,
    settings: &OmpSettings,
) -> Result<OmpReconstruction, ReconstructError> {
    settings.check()?;
    let problem = Problem::new(measurements, settings);
    let choice = choose_atoms(&problem, settings)?;
    let every: Vec<usize> = (0..problem.rows.len()).collect();
    let dictionary = problem.dictionary(&every);
    let found = problem.pursue(&dictionary, &every, &[choice.atoms])?.remove(0);
    let predicted = dictionary.predict(&found.support, &found.coefficients);
    Ok(reconstruction(&problem, found, predicted, settings, &choice))
}

fn choose_atoms(
    problem: &Problem<'_>,
    settings: &OmpSettings,
) -> Result<selection::Choice, OmpError> {
    match settings.sparsity {
        Sparsity::Fixed(atoms) => Ok(selection::Choice { atoms, trust: 1.0, held_back: None }),
        Sparsity::Noise => {
            Ok(selection::Choice { atoms: problem.rows.len(), trust: 1.0, held_back: None })
        }
        Sparsity::CrossValidated { most, folds } => selection::choose(problem, most, folds),
    }
}

/// The reconstruction of a representation: its numbers, and the image that it predicts.
fn reconstruction(
    problem: &Problem<'_>,
    found: Found,
    predicted: Vec<f32>,
    settings: &OmpSettings,
    choice: &selection::Choice,
) -> OmpReconstruction {
    let made = match settings.exactly_sparse || settings.non_negative {
        true => Made::of_prediction(problem, predicted),
        false => Made::weighted(problem, predicted, choice.trust, choice.held_back.as_deref()),
    };
    OmpReconstruction {
        image: made.image,
        sparsity: found.support.len(),
        stop: found.stop,
        residual: made.residual,
        reading_weight: made.reading_weight,
        held_back: problem.judge(choice.held_back.as_deref(), choice.trust),
        unseen_atoms: found.unseen,
        trust: f64::from(choice.trust),
        noise: problem.noise_in_units(),
        by: None,
    }
}

/// An image of a prediction of all rows.
struct Made {
    image: Image,
    /// Norm of the difference between the measurements and the image, relative to the measurements'
    /// norm.
    residual: f64,
    /// Mean weight of the readings in the measured rows.
    reading_weight: f64,
}

impl Made {
    /// The image of the prediction itself.
    fn of_prediction(problem: &Problem<'_>, mut grid: Vec<f32>) -> Self {
        let residual = problem.residual_of(&grid);
        let n = problem.side.pixels() as f32;
        fwht::transform(&mut grid);
        let pixels = grid.iter().map(|v| (f64::from(v / n) * problem.unit) as f32).collect();
        Self { image: Image::new(problem.side, pixels), residual, reading_weight: 0.0 }
    }

    /// The prediction is believed by the factor `trust`, and the measured rows are weighted means of
    /// reading and prediction: of what was predicted without the reading, if it was held back, so
    /// that its noise is not in both.
    fn weighted(
        problem: &Problem<'_>,
        mut grid: Vec<f32>,
        trust: f32,
        held_back: Option<&[f32]>,
    ) -> Self {
        for (&row, &predicted) in problem.rows.iter().zip(held_back.unwrap_or_default()) {
            grid[row as usize] = predicted;
        }
        grid.iter_mut().for_each(|v| *v *= trust);
        let reading_weight =
            weight::weigh(problem.rows, &problem.values, problem.reading_noise(), &mut grid);
        Self { reading_weight, ..Self::of_prediction(problem, grid) }
    }
}

/// Measurements and prior in orthonormal units, scaled so that the largest measurement is 1. So
/// picoamperes and ADC sums are equally far from the limits of `f32`.
#[derive(Clone)]
struct Problem<'a> {
    side: Side,
    rows: &'a Rows,
    values: Vec<f32>,
    /// The largest measurement, in orthonormal units.
    unit: f64,
    transform: Transform,
    prior: Prior,
    /// Noise of a reading, unless it is still to be estimated. `prior.noise` also holds detail that
    /// the prior does not expect.
    reading_noise: Option<f32>,
    /// What the noise of a reading is at most, if more than the readings themselves says so.
    most_noise: Option<f64>,
    /// Norm of the residual, relative to the measurements' norm, at which a pursuit stops.
    residual: f64,
    /// The noise at which a pursuit also stops; 0 for none.
    to_noise: f32,
    how: How,
}

impl<'a> Problem<'a> {
    fn of(
        measurements: &'a Measurements,
        basis: Basis,
        falloff: Option<f64>,
        noise: NoiseLevel,
    ) -> Self {
        let side = measurements.side();
        let rows = measurements.rows();
        let n = side.pixels() as f64;
        let (values, unit) = in_units(measurements);
        let transform = Transform::new(basis, side);
        let in_units = |sigma: f64| (sigma / n / unit) as f32;
        let of_kind =
            |kind: Kind| Statistics { noise: in_units(kind.noise), falloff: kind.falloff };
        let most_noise = measurements.most_noise().map(|most| most / n / unit);
        let alone = || falloff.is_none().then(|| Statistics::of(rows, &values, most_noise));
        let statistics = measurements.kind().map(of_kind).or_else(alone);
        let (noise, reading_noise) = match noise {
            NoiseLevel::Known(sigma) => (in_units(sigma), Some(in_units(sigma))),
            NoiseLevel::Estimated => {
                let estimated = statistics.map(|statistics| statistics.noise);
                let known = measurements.noise().map(in_units).or(estimated);
                (selection::noise_level(rows, &values), known)
            }
        };
        let falloff = falloff.or(statistics.map(|statistics| statistics.falloff)).unwrap_or(1.0);
        let scale = prior_scale(&transform, rows, &values, falloff);
        let prior = Prior { scale, noise, visibility: 0.0 };
        let how = How { non_negative: false, backend: Backend::Auto };
        let (residual, to_noise) = (0.0, 0.0);
        Self {
            side,
            rows,
            values,
            unit,
            transform,
            prior,
            reading_noise,
            most_noise,
            residual,
            to_noise,
            how,
        }
    }

    fn new(measurements: &'a Measurements, settings: &OmpSettings) -> Self {
        let mut problem = Self::of(measurements, settings.basis, settings.falloff, settings.noise);
        problem.prior.visibility = settings.visibility as f32;
        problem.residual = settings.residual;
        problem.stop_at_noise(settings.sparsity, measurements);
        problem.how = settings.how();
        problem
    }

    /// Takes other measurements of the same rows. Their noise is `noise`, or what is known of it.
    fn read(&mut self, measurements: &'a Measurements, noise: NoiseLevel) {
        (self.values, self.unit) = in_units(measurements);
        let of_kind = || measurements.kind().map(|kind| kind.noise);
        let noise = match noise {
            NoiseLevel::Known(sigma) => Some(sigma),
            NoiseLevel::Estimated => measurements.noise().or_else(of_kind),
        };
        let n = self.side.pixels() as f64;
        self.reading_noise = noise.map(|sigma| (sigma / n / self.unit) as f32);
        self.most_noise = measurements.most_noise().map(|most| most / n / self.unit);
    }

    /// Measurements of the same rows, in units of this problem.
    fn in_units(&self, measurements: &Measurements) -> Vec<f32> {
        let n = self.side.pixels() as f64;
        measurements.values().iter().map(|v| (v / n / self.unit) as f32).collect()
    }

    /// Norm of the difference between the measurements and a prediction of all rows, relative to
    /// the measurements' norm.
    fn residual_of(&self, predicted: &[f32]) -> f64 {
        let left = |(&row, value): (&u32, &f32)| f64::from(value - predicted[row as usize]).powi(2);
        let left: f64 = self.rows.iter().zip(&self.values).map(left).sum();
        let energy: f64 = self.values.iter().map(|&v| f64::from(v).powi(2)).sum();
        if energy > 0.0 { (left / energy).sqrt() } else { 0.0 }
    }

    /// Noise of a measurement in the measurements' units.
    fn noise_in_units(&self) -> f64 {
        f64::from(self.reading_noise() * self.side.pixels() as f32) * self.unit
    }

    fn judge(&self, held_back: Option<&[f32]>, trust: f32) -> Option<HeldBack> {
        HeldBack::of(self.rows, &self.values, held_back?, trust)
    }

    fn reading_noise(&self) -> f32 {
        let estimated = || Statistics::of(self.rows, &self.values, self.most_noise).noise;
        self.reading_noise.unwrap_or_else(estimated)
    }

    /// With [`Sparsity::Noise`] a pursuit also stops at the noise: the measured one, else the upper
    /// bound, as an estimate of 0 would stop no pursuit.
    fn stop_at_noise(&mut self, sparsity: Sparsity, measurements: &Measurements) {
        self.to_noise = match (sparsity, measurements.noise()) {
            (Sparsity::Noise, Some(_)) => self.reading_noise(),
            (Sparsity::Noise, None) => self.prior.noise,
            _ => 0.0,
        };
    }

    /// The basis, measured by the rows at these positions.
    fn dictionary(&self, positions: &[usize]) -> SampledHadamard<'_> {
        let rows: Vec<u32> = positions.iter().map(|&k| self.rows[k]).collect();
        SampledHadamard::new(&self.transform, &rows, &self.prior)
    }

    /// Pursues the measurements at these positions up to each number of atoms; the last number is
    /// the largest.
    fn pursue(
        &self,
        dictionary: &SampledHadamard<'_>,
        positions: &[usize],
        sparsities: &[usize],
    ) -> Result<Vec<Found>, OmpError> {
        let values: Vec<f32> = positions.iter().map(|&k| self.values[k]).collect();
        pursuit::pursue(dictionary, &values, &self.limits(), self.how, sparsities)
    }

    /// Limits of a pursuit, whatever the number of atoms.
    fn limits(&self) -> Limits {
        Limits { sparsity: 0, residual: self.residual, noise: f64::from(self.to_noise) }
    }
}

/// The measurements in units of the largest, and this unit, both orthonormal.
fn in_units(measurements: &Measurements) -> (Vec<f32>, f64) {
    let n = measurements.side().pixels() as f64;
    let largest = measurements.values().iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let unit = if largest > 0.0 { largest / n } else { 1.0 };
    (measurements.values().iter().map(|v| (v / n / unit) as f32).collect(), unit)
}

/// Expected size of each coefficient: proportional to `frequency^-falloff`, and scaled so that the
/// expected energy of the measured rows, without the mean, is their measured energy.
fn prior_scale(transform: &Transform, rows: &[u32], values: &[f32], falloff: f64) -> Vec<f32> {
    let side = transform.side();
    let frequencies = transform.basis().frequencies(side);
    let mut scale: Vec<f32> =
        frequencies.iter().map(|f| f.max(1.0).powf(-falloff as f32)).collect();
    if falloff == 0.0 {
        return scale;
    }
    let mut measured = vec![0.0; side.area()];
    for &row in rows {
        measured[row as usize] = 1.0;
    }
    let energy: f32 =
        rows.iter().zip(values).filter(|(row, _)| **row != 0).map(|(_, v)| v * v).sum();
    let expected: f32 = visible_energy(transform, &measured)
        .iter()
        .zip(&scale)
        .zip(&frequencies)
        .filter(|(_, f)| **f > 0.0)
        .map(|((g, s), _)| g * s * s)
        .sum();
    if energy > 0.0 && expected > 0.0 {
        let factor = (energy / expected).sqrt();
        scale.iter_mut().for_each(|s| *s *= factor);
    }
    scale
}

impl OmpSettings {
    fn check(&self) -> Result<(), ReconstructError> {
        let refuse =
            |setting, found, expected| Err(ReconstructError::Setting { setting, found, expected });
        check_prior(self.falloff, self.noise)?;
        if self.non_negative && self.basis != Basis::Pixel {
            return Err(ReconstructError::Signed { basis: self.basis });
        }
        if !(self.visibility >= 0.0 && self.visibility < 1.0) {
            return refuse("visibility", self.visibility, "0 or more and less than 1");
        }
        if let Sparsity::CrossValidated { folds, .. } = self.sparsity
            && folds < 2
        {
            return refuse("folds", folds as f64, "2 or more");
        }
        Ok(())
    }
}

fn check_prior(falloff: Option<f64>, noise: NoiseLevel) -> Result<(), ReconstructError> {
    let refuse =
        |setting, found, expected| Err(ReconstructError::Setting { setting, found, expected });
    if let Some(falloff) = falloff
        && !(0.0..=8.0).contains(&falloff)
    {
        return refuse("falloff", falloff, "0 to 8");
    }
    match noise {
        NoiseLevel::Known(sigma) if !(sigma >= 0.0 && sigma.is_finite()) => {
            refuse("noise", sigma, "a finite number, 0 or more")
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod same_images;
#[cfg(test)]
mod scatter_tests;
#[cfg(test)]
mod tests;
