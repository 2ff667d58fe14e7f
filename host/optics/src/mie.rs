//! Scattering by one homogeneous sphere (Lorenz-Mie theory).
//!
//! Definitions and equations are those of Bohren and Huffman, *Absorption and Scattering of Light by
//! Small Particles* (1983), chapter 4: size parameter `x = pi D / wavelength`, refractive index `m =
//! n + ik` with k >= 0 for a sphere that absorbs, and efficiencies as cross section divided by
//! `pi D^2 / 4`. Values outside the range that was compared with other codes are refused.
//!
//! # Invariant
//! Energy is conserved: `extinction = scattering + absorption`, and absorption is exactly 0 for a
//! real index (`energy_is_neither_made_nor_lost` in `host/optics/tests/mie.rs`). A phase function
//! has a mean of 1 over the sphere
//! (`a_phase_function_has_a_mean_of_one_and_the_asymmetry_as_its_mean_cosine`).

use num_complex::Complex64;
use std::ops::RangeInclusive;
use thiserror::Error;

/// Accepted size parameters. `tests/mie.rs` and `scripts/mie_reference.py` compare this range with
/// other codes. The range reaches from Rayleigh scattering to an 8 mm drop in violet light.
pub const SIZE_PARAMETERS: RangeInclusive<f64> = 0.01..=65_000.0;

/// Real parts of the refractive index accepted.
pub const REAL_INDICES: RangeInclusive<f64> = 0.1..=10.0;

/// Imaginary parts of the refractive index accepted.
pub const IMAGINARY_INDICES: RangeInclusive<f64> = 0.0..=10.0;

/// Why a sphere cannot be solved.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum MieError {
    /// A number is outside the checked range.
    #[error("Mie: {name} is {value}, expected {} to {}", allowed.start(), allowed.end())]
    Range {
        /// The name of the number.
        name: &'static str,
        /// The value found.
        value: f64,
        /// The allowed values.
        allowed: RangeInclusive<f64>,
    },
}

/// A complex refractive index `n + ik`, relative to the medium around the sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Index {
    /// n.
    pub real: f64,
    /// k, 0 or more; positive absorbs.
    pub imaginary: f64,
}

/// Effects of a sphere on light, per geometric cross section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Efficiencies {
    /// Q_ext: removed from the beam.
    pub extinction: f64,
    /// Q_sca: scattered into other directions.
    pub scattering: f64,
    /// Q_abs: converted to heat.
    pub absorption: f64,
    /// Q_back: 4 pi times the light scattered straight back into a unit solid angle.
    pub backscatter: f64,
    /// g: mean cosine of the scattering angle.
    pub asymmetry: f64,
}

/// Cosines of an angle.
const COSINES: RangeInclusive<f64> = -1.0..=1.0;

/// A solver that reuses its memory for the next sphere.
#[derive(Debug, Clone, Default)]
pub struct Mie {
    /// `D_n(m x)`, the logarithmic derivative of `psi_n` inside the sphere, by n.
    derivative: Vec<Complex64>,
    /// The coefficients `(a_n, b_n)` of the scattered wave, the first for n = 1.
    coefficients: Vec<[Complex64; 2]>,
}

impl Mie {
    /// A solver.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Solves the sphere of size parameter `x`.
    ///
    /// # Errors
    /// [`MieError::Range`] naming the number outside [`SIZE_PARAMETERS`], [`REAL_INDICES`] or
    /// [`IMAGINARY_INDICES`].
    pub fn sphere(&mut self, x: f64, index: Index) -> Result<Sphere<'_>, MieError> {
        ensure("size parameter x", x, &SIZE_PARAMETERS)?;
        ensure("refractive index n", index.real, &REAL_INDICES)?;
        ensure("refractive index k", index.imaginary, &IMAGINARY_INDICES)?;
        let m = Complex64::new(index.real, index.imaginary);
        let terms = terms(x);
        self.differentiate(m * x, terms);
        self.expand(x, m, terms);
        Ok(Sphere { x, absorbs: m.im > 0.0, coefficients: &self.coefficients })
    }

    /// `D_n(z)` for n up to `terms`, by downward recurrence (Eq. 4.89). It is stable for every `z`. Above
    /// `n = |z|` an error at the beginning shrinks by `exp(-1.9 u^1.5)` over `u |z|^(1/3)` orders, so 8
    /// such steps leave none.
    fn differentiate(&mut self, z: Complex64, terms: usize) {
        let size = z.norm();
        let start = terms.max((size + 8.0 * size.cbrt()).ceil() as usize) + 16;
        self.derivative.clear();
        self.derivative.resize(terms + 1, Complex64::ZERO);
        let (mut derivative, inverse) = (Complex64::ZERO, z.inv());
        for n in (1..=start).rev() {
            let ratio = inverse * n as f64;
            derivative = ratio - (derivative + ratio).inv();
            if n <= terms + 1 {
                self.derivative[n - 1] = derivative;
            }
        }
    }

    /// `a_n` and `b_n` (Eq. 4.88), with `psi_n` and `xi_n = psi_n - i chi_n` by upward recurrence.
    /// Above `n = x` the recurrence loses `psi_n`, but by then `chi_n` has grown as much, so the
    /// coefficients keep their absolute error.
    fn expand(&mut self, x: f64, m: Complex64, terms: usize) {
        self.coefficients.clear();
        let mut psi = [x.cos(), x.sin()];
        let mut chi = [-x.sin(), x.cos()];
        for n in 1..=terms {
            let n_of_x = n as f64 / x;
            let up = |[before, now]: [f64; 2]| [now, (2.0 * n_of_x - 1.0 / x) * now - before];
            (psi, chi) = (up(psi), up(chi));
            let [psi_before, psi_now] = psi;
            let [xi_before, xi_now] = [0, 1].map(|at| Complex64::new(psi[at], -chi[at]));
            let [a, b] = [self.derivative[n] / m, self.derivative[n] * m].map(|inside| {
                let factor = inside + n_of_x;
                (factor * psi_now - psi_before) / (factor * xi_now - xi_before)
            });
            self.coefficients.push([a, b]);
        }
    }
}

/// Number of terms of the series. Wiscombe's `x + 4.05 x^(1/3) + 2` (*Applied Optics* 19, 1505, 1980)
/// ends too early for light straight back by 1e-5.
fn terms(x: f64) -> usize {
    (x + 6.0 * x.cbrt() + 4.0).ceil() as usize
}

fn ensure(name: &'static str, value: f64, allowed: &RangeInclusive<f64>) -> Result<(), MieError> {
    if allowed.contains(&value) {
        Ok(())
    } else {
        Err(MieError::Range { name, value, allowed: allowed.clone() })
    }
}

/// A solved sphere.
#[derive(Debug, Clone, Copy)]
pub struct Sphere<'a> {
    x: f64,
    absorbs: bool,
    coefficients: &'a [[Complex64; 2]],
}

impl Sphere<'_> {
    /// Efficiencies and asymmetry (Eqs. 4.61 and 4.62, section 4.5).
    #[must_use]
    pub fn efficiencies(&self) -> Efficiencies {
        let [mut extinction, mut scattering, mut asymmetry] = [0.0; 3];
        let mut back = Complex64::ZERO;
        let mut sign = -1.0;
        for (n, &[a, b], next) in self.terms() {
            let weight = 2.0 * n + 1.0;
            extinction += weight * (a + b).re;
            scattering += weight * (a.norm_sqr() + b.norm_sqr());
            back += (a - b) * (weight * sign);
            sign = -sign;
            let with_next = (a * next[0].conj() + b * next[1].conj()).re;
            asymmetry += n * (n + 2.0) / (n + 1.0) * with_next
                + weight / (n * (n + 1.0)) * (a * b.conj()).re;
        }
        let per_shadow = 2.0 / (self.x * self.x);
        let scattering = per_shadow * scattering;
        // The difference of the two sums is rounding where nothing absorbs.
        let taken = if self.absorbs { per_shadow * extinction - scattering } else { 0.0 };
        let absorption = taken.max(0.0);
        Efficiencies {
            extinction: scattering + absorption,
            scattering,
            absorption,
            backscatter: back.norm_sqr() * per_shadow / 2.0,
            asymmetry: 2.0 * per_shadow * asymmetry / scattering,
        }
    }

    /// The phase function of unpolarised light at cosines of the scattering angle, one value for
    /// each cosine. The mean over the sphere is 1, so a value divided by 4 pi is the share of
    /// scattered light per steradian.
    ///
    /// # Errors
    /// [`MieError::Range`] if a cosine is not in [-1, 1].
    pub fn phase(&self, cosines: &[f64]) -> Result<Vec<f64>, MieError> {
        let all: f64 = self
            .terms()
            .map(|(n, [a, b], _)| (2.0 * n + 1.0) * (a.norm_sqr() + b.norm_sqr()))
            .sum();
        cosines
            .iter()
            .map(|&cosine| {
                ensure("cosine", cosine, &COSINES)?;
                let [s1, s2] = self.amplitudes(cosine);
                Ok((s1.norm_sqr() + s2.norm_sqr()) / all)
            })
            .collect()
    }

    /// The amplitudes `S_1` and `S_2` across and along the plane of scattering (Eq. 4.74).
    fn amplitudes(&self, cosine: f64) -> [Complex64; 2] {
        let [mut across, mut along] = [Complex64::ZERO; 2];
        let [mut pi_before, mut pi] = [0.0, 1.0];
        for (n, &[a, b], _) in self.terms() {
            let tau = n * cosine * pi - (n + 1.0) * pi_before;
            let weight = (2.0 * n + 1.0) / (n * (n + 1.0));
            across += (a * pi + b * tau) * weight;
            along += (a * tau + b * pi) * weight;
            // Eq. 4.47
            let pi_next = ((2.0 * n + 1.0) * cosine * pi - (n + 1.0) * pi_before) / n;
            (pi_before, pi) = (pi, pi_next);
        }
        [across, along]
    }

    /// Every n with its coefficients and the next ones; 0 after the last.
    fn terms(&self) -> impl Iterator<Item = (f64, &[Complex64; 2], [Complex64; 2])> {
        let after = self.coefficients.iter().skip(1).copied().chain([[Complex64::ZERO; 2]]);
        self.coefficients
            .iter()
            .zip(after)
            .enumerate()
            .map(|(at, (these, next))| (at as f64 + 1.0, these, next))
    }
}
