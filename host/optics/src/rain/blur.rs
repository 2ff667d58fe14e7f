//! Forward-scatter blur: where light scattered by a drop lands on the target.
//!
//! A pencil of light that is scattered by `theta` at `s` before the target lands `s tan(theta)`
//! beside its aim. Summed over the path, the landing points are the point-spread function of rain
//! (Wells, *AGARD Lecture Series* 61, 1973, in its single-scattering limit). The share within a
//! radius r is `exp(-cL) b * integral over s of P(< atan(r / s))`, with extinction c, scattering b,
//! and P the cumulative scattering angle.
//!
//! Light scattered twice is left out. The error is half the square of the optical depth: 0.0000002
//! over a metre of the paper's heavy rain. Above an optical depth of 0.5, single photons are
//! simulated instead (module `follow`). As an independent check, `tests/rain.rs` simulates its own
//! photons through thin air.

use super::follow::{Landing, Slab};
use super::{Medium, RainError, ScatteringAngles, ensure};
use crate::{LEDS, SIDE};
use std::f64::consts::PI;

/// Optical depth above which light scattered twice must be included.
pub const DEEPEST_SINGLE: f64 = 0.5;

/// Largest accepted optical depth: `exp(-10)` of the light remains, 20 ppm there and back.
pub const DEEPEST: f64 = 5.0;

/// Seed of the simulated photons: the same air gives the same blur.
const SEED: u64 = 1;

/// Steps of the integral along the path.
const STEPS: usize = 200;

/// Offsets from one LED's spot to another, along one axis: -31 to 31.
const REACH: usize = 2 * SIDE - 1;

/// The blur of a pencil of light on its path to a target.
#[derive(Debug, Clone)]
pub struct ForwardBlur {
    medium: Medium,
    angles: Option<ScatteringAngles>,
    distance_mm: f64,
    /// Landing points of light in air too dense for single scattering.
    landing: Option<Landing>,
}

impl ForwardBlur {
    /// A target at `distance_mm` behind this medium. `angles` is `None` in dry air.
    ///
    /// # Errors
    /// [`RainError::Setting`] for a distance that is not positive, or air too dense for any light.
    pub fn new(
        medium: Medium,
        angles: Option<ScatteringAngles>,
        distance_mm: f64,
    ) -> Result<Self, RainError> {
        let reachable = distance_mm.is_finite() && distance_mm > 0.0;
        ensure(reachable, "distance", distance_mm, "a positive number of mm")?;
        let depth = medium.extinction_per_m * distance_mm * 1e-3;
        let expected = "at most 5, beyond which no picture is left";
        ensure(depth <= DEEPEST, "optical depth", depth, expected)?;
        let dense = angles.as_ref().filter(|_| is_dense(&medium, distance_mm));
        let landing =
            dense.map(|angles| Slab { medium: &medium, angles, distance_mm }.landing(SEED));
        Ok(Self { medium, angles, distance_mm, landing })
    }

    /// Share of the light that reaches its aim without scattering, `exp(-cL)`.
    #[must_use]
    pub fn unscattered(&self) -> f64 {
        self.medium.transmission(self.distance_mm * 1e-3)
    }

    /// Share of the light that is scattered and lands within `radius_mm` of its aim.
    #[must_use]
    pub fn scattered_within(&self, radius_mm: f64) -> f64 {
        if let Some(landing) = &self.landing {
            return landing.within(radius_mm);
        }
        let Some(angles) = &self.angles else { return 0.0 };
        let step_mm = self.distance_mm / STEPS as f64;
        let sum: f64 = (0..STEPS)
            .map(|i| angles.within((radius_mm / ((i as f64 + 0.5) * step_mm)).atan()))
            .sum();
        self.unscattered() * self.medium.scattering_per_m * step_mm * 1e-3 * sum
    }

    /// Share of a target point's light that reaches a bucket detector with a field of `field_rad`:
    /// the light without scattering, plus light scattered by less than half the field. In dense
    /// air, the share is that of a pencil of light from the detector that lands within its field on
    /// the target, because light paths can be reversed.
    #[must_use]
    pub fn returned(&self, field_rad: f64) -> f64 {
        if let Some(landing) = &self.landing {
            return self.unscattered() + landing.within(field_rad / 2.0 * self.distance_mm);
        }
        let depth = self.medium.scattering_per_m * self.distance_mm * 1e-3;
        let kept = self.angles.as_ref().map_or(0.0, |angles| angles.within(field_rad / 2.0));
        self.unscattered() * (1.0 + depth * kept)
    }

    /// The point-spread function on the grid of LED spots, `pitch_mm` apart on the target.
    #[must_use]
    pub fn kernel(&self, pitch_mm: f64) -> BlurKernel {
        // Density at radius r, from the cumulative share at radii a sixth of an octave apart.
        let smallest = pitch_mm / PI.sqrt();
        let rings = 48;
        let radius = |i: usize| smallest * 2_f64.powf(i as f64 / 6.0);
        let within: Vec<f64> = (0..=rings).map(|i| self.scattered_within(radius(i))).collect();
        let density = |r: f64| {
            let at = (6.0 * (r / smallest).log2()).clamp(0.0, (rings - 1) as f64) as usize;
            let area = PI * (radius(at + 1).powi(2) - radius(at).powi(2));
            (within[at + 1] - within[at]) / area
        };
        let share = |row: usize, column: usize| {
            let offset = |i: usize| i.abs_diff(SIDE - 1) as f64;
            if row == SIDE - 1 && column == SIDE - 1 {
                // A circle of a spot's area is used, because the density of the forward peak cannot
                // be sampled.
                return within[0];
            }
            let points = 4;
            let part = |k: usize| (k as f64 + 0.5) / points as f64 - 0.5;
            let mut sum = 0.0;
            for i in 0..points {
                for j in 0..points {
                    let (y, x) = (offset(row) + part(i), offset(column) + part(j));
                    sum += density((x.hypot(y) * pitch_mm).max(smallest));
                }
            }
            sum / (points * points) as f64 * pitch_mm * pitch_mm
        };
        let shares = (0..REACH * REACH).map(|i| share(i / REACH, i % REACH)).collect();
        BlurKernel { unscattered: self.unscattered(), shares }
    }
}

/// Whether the air is too dense for single scattering.
pub(super) fn is_dense(medium: &Medium, distance_mm: f64) -> bool {
    medium.extinction_per_m * distance_mm * 1e-3 > DEEPEST_SINGLE
}

/// A point-spread function on the LED grid.
#[derive(Debug, Clone, PartialEq)]
pub struct BlurKernel {
    /// Share of an LED's light that reaches its spot without scattering.
    pub unscattered: f64,
    /// Scattered shares by offset, 63 x 63, the LED's own spot in the middle.
    shares: Vec<f64>,
}

impl BlurKernel {
    /// Scattered share that lands `rows` below and `columns` right of an LED's own spot; 0 beyond
    /// the grid.
    #[must_use]
    pub fn scattered(&self, rows: i32, columns: i32) -> f64 {
        let at =
            |offset: i32| usize::try_from(offset + SIDE as i32 - 1).ok().filter(|&i| i < REACH);
        match (at(rows), at(columns)) {
            (Some(row), Some(column)) => self.shares[row * REACH + column],
            _ => 0.0,
        }
    }

    /// The same kernel, with `own_spot` subtracted from the light that stays in the LED's own spot,
    /// because that light is included elsewhere.
    #[must_use]
    pub fn without_own(mut self, own_spot: f64) -> Self {
        let own = &mut self.shares[REACH * REACH / 2];
        *own = (*own - own_spot).max(0.0);
        self
    }

    /// The same kernel behind a window with drops. The drops cover a share of the window and spread
    /// their light evenly over a disc. Scattering of that light in the air is left out.
    #[must_use]
    pub fn behind_drops(mut self, covered: f64, disc_px: f64) -> Self {
        let clear = 1.0 - covered;
        let covered = covered * self.unscattered;
        self.unscattered *= clear;
        // Points of a pixel that are inside the disc.
        let points = 8;
        let part = |k: usize| (k as f64 + 0.5) / points as f64 - 0.5;
        let offset = |i: usize| i as f64 - (SIDE - 1) as f64;
        let density = covered / (PI * disc_px * disc_px);
        let smaller_than_a_pixel = disc_px * PI.sqrt() <= 1.0;
        for (i, share) in self.shares.iter_mut().enumerate() {
            let (row, column) = (i / REACH, i % REACH);
            let inside = (0..points * points)
                .filter(|k| {
                    let (y, x) =
                        (offset(row) + part(k / points), offset(column) + part(k % points));
                    x.hypot(y) < disc_px
                })
                .count();
            let own = i == REACH * REACH / 2;
            let spread = match smaller_than_a_pixel {
                true => covered * f64::from(u8::from(own)),
                false => density * inside as f64 / (points * points) as f64,
            };
            *share = *share * clear + spread;
        }
        self
    }

    /// The scattered light only: what each LED (32 x 32, row-major) receives from the reflectances
    /// around its spot. Reflectance beyond the grid counts as 0.
    ///
    /// # Panics
    /// If `reflectance` does not hold 1024 values.
    #[must_use]
    pub fn halo(&self, reflectance: &[f32]) -> Vec<f64> {
        assert_eq!(reflectance.len(), LEDS, "a 32 x 32 grid");
        let lit: Vec<(usize, usize, f64)> = reflectance
            .iter()
            .enumerate()
            .filter(|&(_, &r)| r > 0.0)
            .map(|(i, &r)| (i / SIDE, i % SIDE, f64::from(r)))
            .collect();
        (0..LEDS)
            .map(|led| {
                let (row, column) = (led / SIDE, led % SIDE);
                lit.iter()
                    .map(|&(r, c, value)| {
                        value * self.shares[(r + SIDE - 1 - row) * REACH + c + SIDE - 1 - column]
                    })
                    .sum()
            })
            .collect()
    }
}
