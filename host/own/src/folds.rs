//! Tikhonov's images of few patterns of many pixels, for all strengths and all folds at once.
//!
//! With `K = A S^2 A^T`, Tikhonov's problem of the measurements `f` is `(P K P + t) z = P y`: `P`
//! leaves out the other measurements and removes what has no penalty, the dark level and the mean.
//! The image is `S^2 A^T P z`, and its measurements are `K P z`. So all folds share one matrix, and no
//! image is needed to judge a strength. Conjugate gradients for the weakest strength solve the others
//! on the way, because all have the same residuals but for a factor (B. Jegerlehner,
//! arXiv:hep-lat/9612014), and one pass through `K` serves all folds.

use super::gram::gram;
use super::problem::Fit;
use super::solvers::{ITERATIONS, SETTLED};
use super::symmetric::Symmetric;
use super::{
    DarkLevel, MatrixSettings, OwnMatrix, SPLIT_SEED, STRENGTHS, energies, images, last_as_good,
};
use nalgebra::DVector;
use nirspi_recon::Size;
use nirspi_recon::basis::{Basis, Transform};
use nirspi_recon::quadrature::{quadrature, signs};
use nirspi_recon::reconstruct::HeldBack;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::ops::Range;

/// Part of the patterns' norm below which what is left of them is rounding.
const ROUNDING: f64 = 1e-9;

/// Strengths of which the likeliest is found: powers of ten, this many a decade.
const LIKELY: (i32, i32, i32) = (-6, 3, 4);

/// What the patterns say of Tikhonov's problem, before any measurement.
pub(super) struct Products {
    transform: Transform<Size>,
    /// Squares of the expected sizes; 0 for the mean, which has no penalty.
    sizes: Vec<f32>,
    /// `K`.
    products: Symmetric,
    /// Sum of the weights of each pattern.
    sums: DVector<f64>,
    /// Squared norm of each pattern.
    energies: DVector<f64>,
    dark: bool,
}

/// Tikhonov's images of all measurements and of the folds, not yet made.
pub(super) struct Folds<'p> {
    own: &'p OwnMatrix,
    of: &'p Products,
    y: DVector<f64>,
    strengths: Vec<f64>,
    /// All measurements, then those of each fold.
    parts: Vec<Part>,
}

/// Some of the measurements.
struct Part {
    /// 1 for a measurement that is used, 0 for one that is held back.
    used: DVector<f64>,
    /// Orthonormal directions without a penalty.
    free: Vec<DVector<f64>>,
    mean: Mean,
    fits_dark: bool,
    /// `P z` for each strength, in units in which `K P z` are the measurements.
    found: Vec<DVector<f64>>,
}

/// How the mean of the image is found.
enum Mean {
    /// No pattern sees it.
    Unseen,
    /// By least squares: the measurements of an even image of 1.
    Fitted(DVector<f64>),
    /// It looks like a dark level: all patterns see it with this weight.
    Shared(f64),
}

/// What is added to the measurements of an image without a mean.
struct Level {
    mean: f64,
    dark: DarkLevel,
}

impl Products {
    /// `None` for atoms of one's own or single pixels, and for more patterns than pixels, whose
    /// number is reduced instead.
    pub(super) fn new(own: &OwnMatrix, settings: &MatrixSettings) -> Option<Self> {
        let is_ours = settings.atoms.is_none()
            && settings.basis != Basis::Pixel
            && own.patterns() <= own.size.area();
        let transform = Transform::of_size(settings.basis, own.size).filter(|_| is_ours)?;
        let frequencies = settings.basis.frequencies(own.size);
        let sizes: Vec<f32> =
            frequencies.iter().map(|&f| if f > 0.0 { f.max(1.0).powi(-2) } else { 0.0 }).collect();
        let largest = own.patterns.amax();
        let products = Symmetric::new(
            gram(&images(&own.patterns, |image| {
                image.iter_mut().for_each(|weight| *weight /= largest);
                let mut values: Vec<f32> = image.iter().map(|&weight| weight as f32).collect();
                transform.analyse(&mut values);
                values.iter_mut().zip(&sizes).for_each(|(value, size)| *value *= size.sqrt());
                values
            })),
            largest * largest,
        );
        Some(Self {
            transform,
            sizes,
            products,
            sums: own.patterns.column_sum(),
            energies: energies(&own.patterns),
            dark: settings.dark,
        })
    }

    /// The strength at which the measurements are most likely with noise of this standard deviation; `None` for measurements
    /// that say nothing. The model is that of [`quadrature`](nirspi_recon::quadrature): coefficients are normal with variance `a s^2`, the noise with `a t`.
    pub(super) fn likeliest(&self, own: &OwnMatrix, y: &[f64], sigma: f64) -> Option<f64> {
        let (y, parts) = (DVector::from_column_slice(y), Vec::new());
        let folds = Folds { own, of: self, y, strengths: Vec::new(), parts };
        let every: Vec<usize> = (0..folds.y.len()).collect();
        let part = folds.part(&every, self.dark);
        let run = folds.run(&part);
        let count = folds.y.len().checked_sub(part.free.len()).filter(|_| run.scale > 0.0)?;
        // In units in which the measurements have variance 1.
        let variance = (sigma * run.scale / run.unit).powi(2);
        let vector = |v: &[f32]| DVector::from_iterator(v.len(), v.iter().map(|&v| f64::from(v)));
        let rounded = |v: DVector<f64>| -> Vec<f32> { v.iter().map(|&v| v as f32).collect() };
        let times = |v: &[f32]| {
            rounded(part.projected(self.products.times(&part.projected(vector(v)))) * run.scale)
        };
        let readings = quadrature(rounded(run.direction.clone()), count, times)?;
        let ones = vec![1.0; folds.y.len()];
        let probes = signs(&ones).map(|signs| rounded(part.projected(vector(&signs))));
        let probes: Vec<_> = probes.filter_map(|signs| quadrature(signs, count, times)).collect();
        let count = count as f64;
        let likelihood = |strength: &f64| {
            let determinants: f64 =
                probes.iter().map(|probe| probe.mean(|v| (v + strength).ln())).sum();
            let misfit = readings.energy * readings.mean(|v| 1.0 / (v + strength)) * strength;
            let factor = (variance / strength).ln();
            -(misfit / variance + count * (determinants / probes.len() as f64 + factor))
        };
        let (lowest, highest, a_decade) = LIKELY;
        let tried = (lowest * a_decade..=highest * a_decade)
            .map(|step| 10.0_f64.powf(f64::from(step) / f64::from(a_decade)));
        tried.max_by(|a, b| likelihood(a).total_cmp(&likelihood(b)))
    }

    /// Measurements of a made-up scene, with random coefficients of the expected sizes.
    pub(super) fn of_a_scene(&self, own: &OwnMatrix) -> Vec<f64> {
        let mut random = Pcg64::seed_from_u64(SPLIT_SEED);
        let size = |size: &f32| size.sqrt() * (random.random::<f32>() - 0.5);
        let mut image: Vec<f32> = self.sizes.iter().map(size).collect();
        self.transform.synthesise(&mut image);
        let image = DVector::from_iterator(image.len(), image.into_iter().map(f64::from));
        (&own.patterns * image).as_slice().to_vec()
    }

    /// The same of the patterns at these places alone, which follow each other.
    pub(super) fn of_some(&self, places: Range<usize>) -> Self {
        let some = |v: &DVector<f64>| v.rows(places.start, places.len()).into_owned();
        Self {
            transform: self.transform.clone(),
            sizes: self.sizes.clone(),
            products: self.products.of_some(places.clone()),
            sums: some(&self.sums),
            energies: some(&self.energies),
            dark: self.dark,
        }
    }

    /// The problem of these measurements by the patterns of which these are the products. Without a strength, one is
    /// chosen.
    pub(super) fn folds<'p>(
        &'p self,
        own: &'p OwnMatrix,
        y: &[f64],
        strength: Option<f64>,
    ) -> Folds<'p> {
        let strengths = strength.map_or_else(|| STRENGTHS.to_vec(), |strength| vec![strength]);
        let (y, parts) = (DVector::from_column_slice(y), Vec::new());
        let mut folds = Folds { own, of: self, y, strengths, parts };
        let y = &folds.y;
        let every: Vec<usize> = (0..y.len()).collect();
        let mut parts = vec![folds.part(&every, self.dark)];
        if strength.is_none() {
            parts.extend(super::folds(y.len()).map(|(kept, _)| folds.part(&kept, self.dark)));
        }
        folds.solve(&mut parts);
        folds.parts = parts;
        folds
    }
}

impl Folds<'_> {
    /// The image of all measurements at the strength that predicts those held back best, or at the
    /// one that was given; and the strength.
    pub(super) fn chosen(&self) -> (Fit, f64) {
        self.fit(last_as_good(&self.errors()))
    }

    /// Errors of each strength on the held-back measurements: sums of squares.
    pub(super) fn errors(&self) -> Vec<f64> {
        let missed = |strength| self.held_back(strength).map(|held| held.missed().powi(2)).sum();
        (0..self.strengths.len()).map(missed).collect()
    }

    /// How well held-back measurements are predicted by the others, at the strength that predicts them best; and the
    /// deviation of the measurements around those of an even image.
    pub(super) fn judgement(&self) -> Option<(HeldBack, f64)> {
        let held: Vec<Held> = self.held_back(last_as_good(&self.errors())).collect();
        let spread = held.iter().map(|held| held.value.powi(2)).sum::<f64>() / held.len() as f64;
        let pairs = held.iter().map(|held| (held.value, held.predicted));
        Some((HeldBack::of_pairs(pairs)?, spread.sqrt()))
    }

    /// The image of all measurements at the strength of this index, and the strength.
    fn fit(&self, strength: usize) -> (Fit, f64) {
        let whole = &self.parts[0];
        let level = self.level(whole, &self.of.products.times(&whole.found[strength]));
        let weights: DVector<f64> = self.own.patterns.tr_mul(&whole.found[strength]);
        let unit = weights.amax().max(f64::MIN_POSITIVE);
        let mut image: Vec<f32> = weights.iter().map(|&weight| (weight / unit) as f32).collect();
        self.of.transform.analyse(&mut image);
        image.iter_mut().zip(&self.of.sizes).for_each(|(value, size)| *value *= size);
        self.of.transform.synthesise(&mut image);
        let pixels = image.iter().map(|&value| f64::from(value) * unit + level.mean);
        let pixels = DVector::from_iterator(image.len(), pixels);
        (Fit { pixels, dark: level.dark }, self.strengths[strength])
    }

    fn part(&self, kept: &[usize], fits_dark: bool) -> Part {
        let mut used = DVector::zeros(self.y.len());
        kept.iter().for_each(|&k| used[k] = 1.0);
        let shown = kept.len() as f64;
        let seen = self.of.energies.dot(&used);
        let rounding = ROUNDING * seen.sqrt();
        let sums = self.of.sums.component_mul(&used);
        let mut free = Vec::new();
        let mut even = sums.clone();
        if fits_dark {
            even -= &used * (sums.sum() / shown);
            free.push(&used / shown.sqrt());
        }
        let mean = match () {
            () if even.norm() > rounding => {
                free.push(&even / even.norm());
                Mean::Fitted(even)
            }
            () if fits_dark && sums.norm() > rounding => Mean::Shared(sums.sum() / shown),
            () => Mean::Unseen,
        };
        Part { used, free, mean, fits_dark, found: Vec::new() }
    }

    /// Solves all parts for all strengths.
    fn solve(&self, parts: &mut [Part]) {
        let mut runs: Vec<Run> = parts.iter().map(|part| self.run(part)).collect();
        for _ in 0..ITERATIONS {
            let directions: Vec<&DVector<f64>> = runs.iter().map(|run| &run.direction).collect();
            if runs.iter().all(Run::has_settled) {
                break;
            }
            let seen = self.of.products.times_each(&directions);
            for ((run, part), seen) in runs.iter_mut().zip(&*parts).zip(seen) {
                if !run.has_settled() {
                    run.advance(part.projected(seen) * run.scale, &self.strengths);
                }
            }
        }
        for (part, run) in parts.iter_mut().zip(runs) {
            part.found = run.found.into_iter().map(|z| z * run.unit).collect();
        }
    }

    /// The start of a part: measurements of variance 1, and expected energy that is the measured one.
    fn run(&self, part: &Part) -> Run {
        let y = part.projected(self.y.component_mul(&part.used));
        let shown = part.used.sum();
        let free: f64 = part.free.iter().map(|free| free.dot(&self.of.products.times(free))).sum();
        let diagonal = self.of.products.diagonal();
        let energy = diagonal.dot(&part.used) - free;
        let largest = diagonal.max();
        // What rounding leaves of equal numbers is no contrast.
        let is_flat = y.norm() <= ROUNDING * self.y.component_mul(&part.used).norm()
            || energy <= 1e-7 * shown * largest;
        let spread = y.norm() / shown.sqrt();
        let (scale, y) = match is_flat {
            true => (0.0, y * 0.0),
            false => (shown / energy, y / spread),
        };
        Run::new(y, scale, spread * scale, self.strengths.len())
    }

    /// Mean and dark level that fit the measurements of a part best; `seen` are those of its image
    /// without a mean.
    fn level(&self, part: &Part, seen: &DVector<f64>) -> Level {
        let left = (&self.y - seen).component_mul(&part.used);
        let offset = left.sum() / part.used.sum();
        match &part.mean {
            Mean::Unseen if part.fits_dark => Level { mean: 0.0, dark: DarkLevel::Fitted(offset) },
            Mean::Unseen => Level { mean: 0.0, dark: DarkLevel::LeftOut },
            Mean::Shared(weight) => Level { mean: offset / weight, dark: DarkLevel::Unknown },
            Mean::Fitted(even) => {
                let mean = even.dot(&left) / even.norm_squared();
                let left = left - self.of.sums.component_mul(&part.used) * mean;
                let dark = match part.fits_dark {
                    true => DarkLevel::Fitted(left.sum() / part.used.sum()),
                    false => DarkLevel::LeftOut,
                };
                Level { mean, dark }
            }
        }
    }

    /// The measurements that were held back from a part, each with its prediction by the others at the strength of this
    /// index.
    fn held_back(&self, strength: usize) -> impl Iterator<Item = Held> {
        self.parts[1..].iter().flat_map(move |part| {
            let seen = self.of.products.times(&part.found[strength]);
            let level = self.level(part, &seen);
            let held = (0..self.y.len()).filter(|&k| part.used[k] == 0.0);
            held.map(move |k| Held {
                value: self.y[k] - self.of.sums[k] * level.mean - level.dark.value(),
                predicted: seen[k],
            })
        })
    }
}

/// A held-back measurement and its prediction, both without the dark level and the mean of the image.
struct Held {
    value: f64,
    predicted: f64,
}

impl Held {
    fn missed(&self) -> f64 {
        self.value - self.predicted
    }
}

impl Part {
    /// `P v`.
    fn projected(&self, mut v: DVector<f64>) -> DVector<f64> {
        v.component_mul_assign(&self.used);
        for free in &self.free {
            let along = free.dot(&v);
            v.axpy(-along, free, 1.0);
        }
        v
    }
}

/// Conjugate gradients for the weakest strength, which is the last, and for the others with it.
struct Run {
    /// By which `K` is multiplied.
    scale: f64,
    /// By which a solution is multiplied to belong to the measurements.
    unit: f64,
    residual: DVector<f64>,
    direction: DVector<f64>,
    energy: f64,
    first_energy: f64,
    step: f64,
    turn: f64,
    found: Vec<DVector<f64>>,
    directions: Vec<DVector<f64>>,
    /// Residual of each strength as a part of the weakest one's, now and one step ago.
    parts: Vec<[f64; 2]>,
}

impl Run {
    fn new(y: DVector<f64>, scale: f64, unit: f64, strengths: usize) -> Self {
        let energy = y.norm_squared();
        Self {
            scale,
            unit,
            found: vec![y.clone() * 0.0; strengths],
            directions: vec![y.clone(); strengths],
            parts: vec![[1.0; 2]; strengths],
            residual: y.clone(),
            direction: y,
            energy,
            first_energy: energy,
            step: 1.0,
            turn: 0.0,
        }
    }

    fn has_settled(&self) -> bool {
        self.energy <= SETTLED.powi(2) * self.first_energy
    }

    /// One step along the direction, of which `seen` is the product with the matrix.
    fn advance(&mut self, seen: DVector<f64>, strengths: &[f64]) {
        let weakest = strengths[strengths.len() - 1];
        let seen = seen + &self.direction * weakest;
        let step = self.energy / self.direction.dot(&seen);
        let next: Vec<f64> = strengths
            .iter()
            .zip(&self.parts)
            .map(|(strength, &[now, before])| {
                let stronger = before * self.step * (1.0 + (strength - weakest) * step);
                now * before * self.step / (step * self.turn * (before - now) + stronger)
            })
            .collect();
        self.residual.axpy(-step, &seen, 1.0);
        let energy = self.residual.norm_squared();
        let turn = energy / self.energy;
        for (k, next) in next.into_iter().enumerate() {
            let now = self.parts[k][0];
            // The residual of a strong penalty is far below that of the weakest, and its image is found.
            if now.abs() < f64::EPSILON {
                continue;
            }
            let ratio = next / now;
            self.found[k].axpy(step * ratio, &self.directions[k], 1.0);
            self.directions[k] *= turn * ratio * ratio;
            self.directions[k].axpy(next, &self.residual, 1.0);
            self.parts[k] = [next, now];
        }
        self.direction *= turn;
        self.direction += &self.residual;
        (self.step, self.turn, self.energy) = (step, turn, energy);
    }
}
