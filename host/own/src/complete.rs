//! Tikhonov's image of as many orthogonal patterns as pixels, all of one norm, in one step.
//!
//! Such patterns turn the image into its measurements without a loss, so each coefficient of the image
//! has a measurement of its own, `g = c + noise`, and its estimate is `c s^2 / (s^2 + t)`, `s` being
//! its expected size. No measurement predicts another one except through these sizes: held-back
//! measurements would cost most and say least. The strength `t` is the one at which the measurements
//! are most likely, if coefficients are normal with variance `s^2` and noise with `t`, both times a
//! common factor (evidence, or restricted likelihood: H. D. Patterson and R. Thompson, *Biometrika*
//! 58, 545, 1971). So the finest details, which scenes hardly have, tell the noise. Where the noise is known, it is the
//! factor that is left. A scene with much fine detail looks like noise: readings that were taken several times, such as the
//! sums of pairs, say what the noise is at most, and noise beyond that is detail.

use super::problem::Fit;
use super::{DarkLevel, MatrixMethod, MatrixSettings, OwnMatrix, Penalty, STRENGTHS};
use nalgebra::DVector;
use nirspi_recon::basis::Basis;

/// Relative difference of norms that counts as rounding.
const SAME: f64 = 1e-9;

/// Part of a constant's energy outside the mean of the image below which a dark level is the mean.
const SEEN: f64 = 1e-12;

/// The least variance of a coefficient's noise, the greatest measurement being 1: that of rounding.
const ROUNDING: f64 = 1e-20;

/// Strengths between two neighbours of [`STRENGTHS`].
const BETWEEN: u32 = 4;

/// The image of the measurement at this place of all, and its strength; `None` for other patterns or settings.
pub(super) fn solve(
    own: &OwnMatrix,
    (at, y): (usize, &[f64]),
    settings: &MatrixSettings,
) -> Option<(Fit, f64)> {
    let energy = energy(own)?;
    let is_ours = settings.method == MatrixMethod::Penalty(Penalty::Tikhonov)
        && settings.atoms.is_none()
        && settings.basis != Basis::Pixel;
    if !is_ours {
        return None;
    }
    let transform = own.transform(settings.basis).ok()?;
    let coefficients = |y: &DVector<f64>| -> Vec<f64> {
        let seen = own.patterns.tr_mul(y) / energy;
        let mut image: Vec<f32> = seen.iter().map(|&v| v as f32).collect();
        transform.analyse(&mut image);
        image.into_iter().map(f64::from).collect()
    };
    // Units in which `f32` holds the numbers, however small.
    let unit = y.iter().fold(0.0, |most: f64, v| most.max(v.abs())).max(f64::MIN_POSITIVE);
    let unit = unit / energy.sqrt();
    let found = coefficients(&(DVector::from_column_slice(y) / unit));
    let constant = coefficients(&DVector::from_element(y.len(), energy.sqrt()));
    let frequencies = transform.basis().frequencies(own.size);
    let sizes: Vec<f64> = frequencies.iter().map(|f| f64::from(f.max(1.0)).powi(-2)).collect();
    // The mean has no penalty, and says nothing of the strength.
    let details: Vec<usize> = (0..sizes.len()).filter(|&j| frequencies[j] > 0.0).collect();
    let outside: f64 = details.iter().map(|&j| constant[j].powi(2)).sum();
    let sees_dark = outside > SEEN * constant.iter().map(|v| v * v).sum::<f64>();
    let fits_dark = settings.dark && sees_dark;
    let variance = |sigma: f64| (sigma / unit).powi(2) / energy;
    let known = settings.noise.filter(|sigma| *sigma > 0.0).map(variance);
    let mut model = Model { found, constant, sizes, details, fits_dark, known };
    let relative = model.details.iter().map(|&j| model.sizes[j]).sum::<f64>() / y.len() as f64;
    let strength = settings.strength.unwrap_or_else(|| {
        let likeliest = model.likeliest(relative);
        let most = settings.most_noise.get(at).copied().flatten().filter(|_| known.is_none());
        let most = most.map(|sigma| variance(sigma).max(ROUNDING));
        match most.filter(|most| *most < model.variance(likeliest * relative)) {
            None => likeliest,
            most => {
                model.known = most;
                model.likeliest(relative)
            }
        }
    });

    let noise = strength * relative;
    let dark = model.dark(noise);
    let mut image: Vec<f32> = (0..y.len())
        .map(|j| {
            let value = model.found[j] - dark * model.constant[j];
            let share =
                if frequencies[j] > 0.0 { model.sizes[j] / (model.sizes[j] + noise) } else { 1.0 };
            (value * share) as f32
        })
        .collect();
    transform.synthesise(&mut image);
    let pixels = DVector::from_iterator(image.len(), image.iter().map(|&v| f64::from(v) * unit));
    let dark = match (settings.dark, sees_dark) {
        (false, _) => DarkLevel::LeftOut,
        (true, false) => DarkLevel::Unknown,
        (true, true) => DarkLevel::Fitted(dark * unit * energy.sqrt()),
    };
    Some((Fit { pixels, dark }, strength))
}

/// Whether [`solve`] has an image by Tikhonov's method.
pub(super) fn is_complete(own: &OwnMatrix) -> bool {
    energy(own).is_some()
}

/// The squared norm of every pattern.
fn energy(own: &OwnMatrix) -> Option<f64> {
    let energies = own.orthogonal.as_ref()?;
    let (least, most) = (energies.min(), energies.max());
    (energies.len() == own.size.area() && most - least <= SAME * most).then(|| energies.mean())
}

/// Coefficients with noise of the same size in each.
struct Model {
    found: Vec<f64>,
    /// What a dark level adds to each.
    constant: Vec<f64>,
    /// Squares of the expected sizes.
    sizes: Vec<f64>,
    /// All coefficients except the mean.
    details: Vec<usize>,
    fits_dark: bool,
    /// Variance of the noise of a coefficient, if it is known.
    known: Option<f64>,
}

impl Model {
    /// Sum over the details, each with its weight `1 / (s^2 + t)`.
    fn sum(&self, noise: f64, of: impl Fn(usize) -> f64) -> f64 {
        self.details.iter().map(|&j| of(j) / (self.sizes[j] + noise)).sum()
    }

    /// The likeliest dark level.
    fn dark(&self, noise: f64) -> f64 {
        match self.fits_dark {
            true => {
                self.sum(noise, |j| self.constant[j] * self.found[j])
                    / self.sum(noise, |j| self.constant[j].powi(2))
            }
            false => 0.0,
        }
    }

    /// The likeliest variance of the noise, for this ratio of noise to the expected sizes.
    fn variance(&self, noise: f64) -> f64 {
        let dark = self.dark(noise);
        let misfit = self.sum(noise, |j| (self.found[j] - dark * self.constant[j]).powi(2));
        noise * misfit / self.details.len().max(1) as f64
    }

    /// The strength at which the coefficients are most likely. `relative` times a strength is the
    /// noise.
    fn likeliest(&self, relative: f64) -> f64 {
        // More noise than light is likely only where it is known.
        let stronger: &[f64] = if self.known.is_some() { &[1e3, 1e2, 1e1] } else { &[] };
        let tried = [stronger, &STRENGTHS].concat();
        let strengths = tried.windows(2).flat_map(|two| {
            let ratio = (two[1] / two[0]).powf(1.0 / f64::from(BETWEEN));
            (0..BETWEEN).map(move |k| two[0] * ratio.powi(k as i32))
        });
        let strengths = strengths.chain(tried.last().copied());
        let likely = strengths.map(|strength| (self.likelihood(strength * relative), strength));
        likely.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(tried[0], |(_, strength)| strength)
    }

    /// Logarithm of the restricted likelihood, without what is the same for all strengths.
    fn likelihood(&self, noise: f64) -> f64 {
        let dark = self.dark(noise);
        let misfit = self.sum(noise, |j| (self.found[j] - dark * self.constant[j]).powi(2));
        let widths: f64 = self.details.iter().map(|&j| (self.sizes[j] + noise).ln()).sum();
        let freedom = match self.fits_dark {
            true => self.sum(noise, |j| self.constant[j].powi(2)).ln(),
            false => 0.0,
        };
        let count = self.details.len() - usize::from(self.fits_dark);
        let of_factor = match self.known {
            Some(variance) => misfit * noise / variance + count as f64 * (variance / noise).ln(),
            // Coefficients of 0 have no likeliest strength.
            None => count as f64 * misfit.max(f64::MIN_POSITIVE).ln(),
        };
        -0.5 * (widths + freedom + of_factor)
    }
}
