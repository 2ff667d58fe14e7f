//! Scattering by one homogeneous sphere (Lorenz-Mie theory).
//!
//! The crate `scatrs` solves the problem. This module converts units and names, and refuses values
//! that were not checked. Definitions are those of Bohren and Huffman, *Absorption and Scattering
//! of Light by Small Particles* (1983), chapter 4: size parameter `x = pi D / wavelength`,
//! refractive index `n + ik` with k >= 0 for a sphere that absorbs, and efficiencies as cross
//! section divided by `pi D^2 / 4`.
//!
//! # Invariant
//! Energy is conserved: `extinction = scattering + absorption`, and absorption is exactly 0 for a
//! real index (`energy_is_neither_made_nor_lost` in `host/optics/tests/mie.rs`). A phase function
//! has a mean of 1 over the sphere
//! (`a_phase_function_has_a_mean_of_one_and_the_asymmetry_as_its_mean_cosine`).

use num_complex::Complex64;
use scatrs::mie::{MieOptions, MieSolution, Normalization, PhaseBuffers};
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
    /// The solver refused.
    #[error("Mie: {0}")]
    Solver(String),
}

impl From<scatrs::Error> for MieError {
    fn from(error: scatrs::Error) -> Self {
        Self::Solver(error.to_string())
    }
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

/// A solver that reuses its memory for the next sphere.
#[derive(Debug, Clone, Default)]
pub struct Mie {
    workspace: scatrs::mie::Mie<f64>,
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
        // `scatrs` states its accuracy up to x = 20 000. For larger x, the comparison in
        // `tests/mie.rs` shows the accuracy.
        let options = MieOptions::new().with_allow_unvalidated(true);
        let m = Complex64::new(index.real, index.imaginary);
        Ok(Sphere { solution: self.workspace.compute(x, m, &options)? })
    }
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
    solution: MieSolution<'a, f64>,
}

impl Sphere<'_> {
    /// Efficiencies and asymmetry.
    #[must_use]
    pub fn efficiencies(&self) -> Efficiencies {
        let q = self.solution.efficiencies();
        Efficiencies {
            extinction: q.q_ext,
            scattering: q.q_sca,
            absorption: q.q_abs,
            backscatter: q.q_back,
            asymmetry: q.g,
        }
    }

    /// The phase function of unpolarised light at cosines of the scattering angle, one value for
    /// each cosine. The mean over the sphere is 1, so a value divided by 4 pi is the share of
    /// scattered light per steradian.
    ///
    /// # Errors
    /// [`MieError::Solver`] if a cosine is not in [-1, 1].
    pub fn phase(&self, cosines: &[f64]) -> Result<Vec<f64>, MieError> {
        let mut f11 = vec![0.0; cosines.len()];
        let [mut f12, mut f33, mut f34] = [f11.clone(), f11.clone(), f11.clone()];
        let out = PhaseBuffers { f11: &mut f11, f12: &mut f12, f33: &mut f33, f34: &mut f34 };
        self.solution.phase_matrix(cosines, Normalization::Normalized, out)?;
        Ok(f11)
    }
}
