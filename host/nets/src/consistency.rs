//! Agreement with the readings (consistency): changes an image just enough that the readings agree
//! with it to within their noise, so a network cannot invent what the readings contradict.
//!
//! The camera's model is A = M B: B is a Gaussian blur of `sigma_px` on the 64 x 64 grid with
//! reflecting edges, and M takes means of 2 x 2 pixels where readings are 32 x 32 (else M = 1). An
//! image x outside the ball |y - A x| <= tau noise sqrt(n) becomes x + A^T (A A^T + lambda)^-1 (y -
//! A x). Lambda is chosen so that the new image lies on the ball, and is at least `LEAST_LAMBDA`.
//! Of all changes with the same norm this one fits best (Tikhonov; Morozov's discrepancy
//! principle).
//!
//! The blur may be no Gaussian at all: that of a target that moved, of a lens out of focus, or what the estimator took for
//! one. Then no image agrees with the readings, and the change only spoils what the network has made. The readings tell:
//! where the new image, in [0, 1], is still farther from them than `REACHED`, and the change has taken less than 0.6 of the
//! distance (`STUCK`), the old one stays. An image that is far off for another reason comes much nearer. A blur that the
//! caller knows may be that of one part of the image, so there images are always moved.
//!
//! # Invariant
//! An image inside the ball is not changed (`tests::inside_the_ball_nothing_changes`), nor one whose readings no image of
//! this model gives (`tests::an_image_stays_where_no_image_gives_its_readings`).
//!
//! # How the equation is solved
//! With reflecting edges B is diagonal in the cosine transform (DCT-II), and pair means fold cosine
//! 64 - k onto cosine k, so A A^T is diagonal too and no iteration is necessary. If some Hadamard
//! rows are missing, only the measured part counts, and [`MeasuredRows`] solves the same equation
//! in a Krylov space.

#[cfg(feature = "gpu")]
mod device;
mod krylov;
mod measured;

#[cfg(feature = "gpu")]
pub(crate) use device::agreement;
pub use measured::{MeasuredRows, MeasuredRowsError, SampledRows};

use crate::cosine::Cosine;
use crate::separable::Separable;
use krylov::Krylov;
use pulp::Arch;
use std::f32::consts::PI;
use std::sync::LazyLock;

/// Side of the sharp image.
pub const SIDE: usize = crate::grid::FINE;

/// Factor on the expected radius of the ball.
const TAU: f32 = 1.1;

/// Inconsistency above which the readings contradict the image. An image that agrees with its
/// readings has 1.1 or less, the radius to which the networks' result is moved.
pub const CONTRADICTED: f32 = 1.2;

/// Whether this inconsistency says that the readings contradict the image. NaN does.
#[must_use]
pub fn is_contradicted(inconsistency: f32) -> bool {
    inconsistency > CONTRADICTED || inconsistency.is_nan()
}

/// Inconsistency up to which an image that was moved counts as one that agrees: more than the radius, because pixels below 0
/// and above 1 are cut off after the move. 1.12 to 1.2 gave the same images to 0.2 dB.
const REACHED: f32 = 1.15;

/// Share of the distance from the readings that a move leaves where no image has these readings. Letters smeared by motion
/// gain 3.9 dB, those out of focus 1.1 dB, others nothing (docs/log/quality.md); with 0.5 and 0.6 they gain less.
const STUCK: f32 = 0.4;

/// Smallest standard deviation assumed for the readings, because the estimated blur is not exact
/// and no true blur is exactly Gaussian.
const NOISE_FLOOR: f32 = 0.004;

/// Smallest lambda. If the blur is overestimated, no image agrees with the readings, and the
/// equation would amplify noise without bound. This limit keeps the change below 1 / (2 sqrt
/// lambda) = 5 times the residual. The readings then still disagree, and the inconsistency shows
/// that.
const LEAST_LAMBDA: f32 = 0.01;

/// Largest lambda, as a decimal logarithm.
const MOST_LOG_LAMBDA: f32 = 4.0;

/// Number of halvings of the interval of lambda's logarithm, which gives lambda to 1e-5.
const BISECTIONS: usize = 22;

/// The cosine transform of the sharp image, and that of readings with half its side.
static OF_IMAGE: LazyLock<Cosine<f32>> = LazyLock::new(|| Cosine::new(SIDE, SIDE));
static OF_READINGS: LazyLock<Cosine<f32>> = LazyLock::new(|| Cosine::new(SIDE / 2, SIDE / 2));

/// Whether images are moved into agreement with their readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Binding {
    /// Images stay as they are.
    Off,
    /// Images stay where no image under the estimated blur has the readings.
    OfEstimate,
    /// The blur is known: images are moved as far as that goes.
    OfKnownBlur,
}

/// The camera's model for one image, and the noise of its readings.
#[derive(Debug)]
pub struct Consistency {
    /// From an image to the cosine transform of its readings: A.
    camera: Separable,
    /// Cosine transform of the readings.
    readings: &'static Cosine<f32>,
    /// Diagonal of D D^T on one axis, D = pair means of the blur.
    power: Vec<f32>,
    noise: f32,
    measured: MeasuredRows,
}

impl Consistency {
    /// The model for readings of `side` x `side` pixels, 32 or 64, of an image of [`SIDE`] x
    /// [`SIDE`] pixels. The blur is `sigma_px` of the image's pixels; `noise` is the standard
    /// deviation of a reading. Every Hadamard row counts as measured; [`of_rows`](Self::of_rows)
    /// changes that.
    pub fn new(side: usize, sigma_px: f32, noise: f32) -> Self {
        let attenuation = |k: usize| {
            let omega = PI * k as f32 / SIDE as f32;
            (-0.5 * (sigma_px * omega).powi(2)).exp()
        };
        let halved = side < SIDE;
        // cos(pi k / 128) is the factor of a pair's mean for cosine k; 1 / sqrt 2 is the factor of
        // its norm.
        let pair = |k: usize| (PI * k as f32 / (2 * SIDE) as f32).cos() * 0.5_f32.sqrt();
        let gain: Vec<f32> =
            (0..SIDE).map(|k| attenuation(k) * if halved { pair(k) } else { 1.0 }).collect();
        let mut power: Vec<f32> = gain[..side].iter().map(|g| g * g).collect();
        for k in 1..SIDE - side {
            power[k] += gain[SIDE - k].powi(2);
        }
        // Pair means fold cosine 64 - k onto cosine k, with the other sign, and remove cosine 32.
        let cosines: &Cosine<f32> = &OF_IMAGE;
        let mut camera = Vec::with_capacity(side * SIDE);
        for k in 0..side {
            camera.extend(cosines.wave(k).iter().map(|value| gain[k] * value));
            if halved && k > 0 {
                let (folded, factor) = (cosines.wave(SIDE - k), gain[SIDE - k]);
                let line = camera[k * SIDE..].iter_mut().zip(folded);
                line.for_each(|(value, folded)| *value -= factor * folded);
            }
        }
        Self {
            camera: Separable::new(camera, SIDE),
            readings: if halved { &OF_READINGS } else { &OF_IMAGE },
            power,
            noise: noise.max(NOISE_FLOOR),
            measured: MeasuredRows::All,
        }
    }

    /// The same model with only some Hadamard rows measured.
    ///
    /// # Errors
    /// [`MeasuredRowsError::OtherSide`] if the rows belong to readings of another side.
    pub fn of_rows(self, measured: &MeasuredRows) -> Result<Self, MeasuredRowsError> {
        measured.expect_side(self.power.len())?;
        Ok(Self { measured: measured.clone(), ..self })
    }

    /// Norm of the difference between `readings` and the model's readings of `image` ([`SIDE`]^2),
    /// over the norm expected from noise. Near 1 or below, they agree.
    pub fn residual_ratio(&self, readings: &[f32], image: &[f32]) -> f32 {
        let residual = self.residual(readings, image);
        norm(&residual) / (self.noise * (self.degrees() as f32).sqrt())
    }

    /// Clamps `image` to [0, 1] and moves it into agreement with its readings.
    pub fn agree(&self, readings: &[f32], image: &mut [f32], binding: Binding) {
        image.iter_mut().for_each(|value| *value = value.clamp(0.0, 1.0));
        if binding == Binding::Off {
            return;
        }
        let before = image.to_vec();
        if !self.project(readings, image) {
            return;
        }
        image.iter_mut().for_each(|value| *value = value.clamp(0.0, 1.0));
        if binding == Binding::OfEstimate {
            let left = self.residual_ratio(readings, image);
            if left > REACHED && left > STUCK * self.residual_ratio(readings, &before) {
                image.copy_from_slice(&before);
            }
        }
    }

    /// Moves `image` onto the ball. `false` if the image is inside already.
    fn project(&self, readings: &[f32], image: &mut [f32]) -> bool {
        let radius = TAU * self.noise * (self.degrees() as f32).sqrt();
        let residual = self.residual(readings, image);
        if norm(&residual) <= radius {
            return false;
        }
        let dual = match &self.measured {
            MeasuredRows::All => self.solve(&residual, radius),
            MeasuredRows::Rows(rows) => self.solve_sampled(rows, residual, radius),
        };
        let change = self.camera.adjoint(&dual);
        image.iter_mut().zip(change).for_each(|(pixel, change)| *pixel += change);
        true
    }

    /// Number of readings that count.
    fn degrees(&self) -> usize {
        match &self.measured {
            MeasuredRows::All => self.power.len().pow(2),
            MeasuredRows::Rows(rows) => rows.count(),
        }
    }

    /// Cosine transform of the measured part of y - A x.
    fn residual(&self, readings: &[f32], image: &[f32]) -> Vec<f32> {
        let mut residual = self.readings.forward(readings);
        let seen = self.camera.forward(image);
        residual.iter_mut().zip(seen).for_each(|(r, seen)| *r -= seen);
        match &self.measured {
            MeasuredRows::All => residual,
            MeasuredRows::Rows(rows) => rows.measured_part(&residual),
        }
    }

    /// The diagonal of A A^T.
    fn powers(&self) -> Vec<f32> {
        self.power
            .iter()
            .flat_map(|down| self.power.iter().map(move |across| down * across))
            .collect()
    }

    /// (A A^T + lambda)^-1 of the residual, with lambda such that the new residual has the radius
    /// as its norm. Of each coefficient lambda / (mu + lambda) is left.
    fn solve(&self, residual: &[f32], radius: f32) -> Vec<f32> {
        let powers = self.powers();
        let left = |lambda: f32| {
            let left = |r: f32, power: f32| r * lambda / (power + lambda);
            sum(residual, &powers, |r, power| f64::from(left(r, power)).powi(2)).sqrt() as f32
        };
        let lambda = bisect(BISECTIONS, |lambda| left(lambda) > radius);
        residual.iter().zip(&powers).map(|(r, power)| r / (power + lambda)).collect()
    }

    /// (P A A^T P + lambda)^-1 of the residual, where P projects onto the measured rows. Lambda is
    /// such that the new residual has the radius as its norm.
    fn solve_sampled(&self, rows: &SampledRows, residual: Vec<f32>, radius: f32) -> Vec<f32> {
        let powers = self.powers();
        let mut krylov = Krylov::new(residual);
        loop {
            krylov.step(|v| {
                let seen: Vec<f32> = v.iter().zip(&powers).map(|(v, power)| power * v).collect();
                rows.measured_part(&seen)
            });
            if !krylov.is_due() {
                continue;
            }
            // y - A (x + A^T dual) = residual - A A^T dual = lambda dual.
            let lambda = bisect(BISECTIONS, |lambda| lambda * krylov.norm(lambda) > radius);
            if krylov.is_enough(lambda) {
                return krylov.solution(lambda);
            }
        }
    }
}

/// The largest lambda, from [`LEAST_LAMBDA`] up on a logarithmic scale, whose result is not
/// `outside` the ball.
fn bisect(halvings: usize, mut outside: impl FnMut(f32) -> bool) -> f32 {
    let (mut inside, mut beyond) = (LEAST_LAMBDA.log10(), MOST_LOG_LAMBDA);
    for _ in 0..halvings {
        let middle = 0.5 * (inside + beyond);
        if outside(10.0_f32.powf(middle)) {
            beyond = middle;
        } else {
            inside = middle;
        }
    }
    10.0_f32.powf(inside)
}

fn norm(values: &[f32]) -> f32 {
    sum(values, values, |a, b| f64::from(a) * f64::from(b)).sqrt() as f32
}

/// The sum of `term` over pairs of elements, as sixteen sums side by side: a single one would wait
/// for each addition.
fn sum(a: &[f32], b: &[f32], term: impl Fn(f32, f32) -> f64) -> f64 {
    const SUMS: usize = 16;
    Arch::new().dispatch(|| {
        let mut sums = [0.0; SUMS];
        let ((a, last_a), (b, last_b)) = (a.as_chunks::<SUMS>(), b.as_chunks::<SUMS>());
        for (a, b) in a.iter().zip(b) {
            let pairs = a.iter().zip(b);
            sums.iter_mut().zip(pairs).for_each(|(sum, (&a, &b))| *sum += term(a, b));
        }
        let last = last_a.iter().zip(last_b).map(|(&a, &b)| term(a, b));
        sums.into_iter().chain(last).sum()
    })
}

#[cfg(test)]
mod tests;
