//! A volume of air with drops: what a metre of air removes from a beam, and the angles into which
//! it scatters.
//!
//! Drops are far apart (a 2 mm drop every 26 cm in the paper's heavy rain), so each scatters
//! independently and the cross sections add (independent scattering; van de Hulst, *Light
//! Scattering by Small Particles*, 1957, 1.21).

use super::{DropClass, Drops, RainError};
use crate::mie::Mie;
use crate::substance::Substance;
use std::f64::consts::PI;

/// Optical coefficients of air with drops in it, at one wavelength.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Medium {
    /// Wavelength.
    pub wavelength_nm: f64,
    /// Extinction: removed from a beam per metre, `sum N Q_ext pi/4 D^2`.
    pub extinction_per_m: f64,
    /// The scattered part of the extinction.
    pub scattering_per_m: f64,
    /// The absorbed part of the extinction.
    pub absorption_per_m: f64,
    /// Mean cosine of the scattering angle; 0 without drops.
    pub asymmetry: f64,
    /// Scattered straight back, at exactly 180 degrees, per metre and steradian. A camera beside
    /// its projector does not see that angle; see [`super::BackwardLobe`].
    pub backscatter_per_m_sr: f64,
}

impl Medium {
    /// The medium of `drops` for light of `wavelength_nm`.
    ///
    /// # Errors
    /// [`RainError`] for a wavelength outside the water table or a drop outside the Mie solver's
    /// range.
    pub fn new(
        drops: &Drops,
        wavelength_nm: f64,
        substance: impl Into<Substance>,
    ) -> Result<Self, RainError> {
        let index = substance.into().index(wavelength_nm)?;
        let mut mie = Mie::new();
        let mut medium = Self {
            wavelength_nm,
            extinction_per_m: 0.0,
            scattering_per_m: 0.0,
            absorption_per_m: 0.0,
            asymmetry: 0.0,
            backscatter_per_m_sr: 0.0,
        };
        for class in drops.classes() {
            let q =
                mie.sphere(size_parameter(class.diameter_mm, wavelength_nm), index)?.efficiencies();
            let area_per_m = class.per_m3 * PI / 4.0 * (class.diameter_mm * 1e-3).powi(2);
            medium.extinction_per_m += q.extinction * area_per_m;
            medium.scattering_per_m += q.scattering * area_per_m;
            medium.absorption_per_m += q.absorption * area_per_m;
            medium.asymmetry += q.asymmetry * q.scattering * area_per_m;
            medium.backscatter_per_m_sr += q.backscatter * area_per_m / (4.0 * PI);
        }
        if medium.scattering_per_m > 0.0 {
            medium.asymmetry /= medium.scattering_per_m;
        }
        Ok(medium)
    }

    /// Scattered share of the extinction; 1 without drops.
    #[must_use]
    pub fn albedo(&self) -> f64 {
        if self.extinction_per_m > 0.0 {
            self.scattering_per_m / self.extinction_per_m
        } else {
            1.0
        }
    }

    /// Extinction in dB/km.
    #[must_use]
    pub fn extinction_db_per_km(&self) -> f64 {
        self.extinction_per_m * 1e3 * 10.0 / 10.0_f64.ln()
    }

    /// Share of a beam left after `path_m` (Beer and Lambert).
    #[must_use]
    pub fn transmission(&self, path_m: f64) -> f64 {
        (-self.extinction_per_m * path_m).exp()
    }

    /// Distance at which the contrast of a black object against the sky falls to 2 %, `3.912 /
    /// extinction` (Koschmieder); infinite in dry air.
    #[must_use]
    pub fn visibility_m(&self) -> f64 {
        3.912 / self.extinction_per_m
    }
}

pub(super) fn size_parameter(diameter_mm: f64, wavelength_nm: f64) -> f64 {
    PI * diameter_mm * 1e6 / wavelength_nm
}

/// Representative classes for expensive computations: at most some 20, evenly chosen from classes
/// with more than a thousandth of the largest class's area.
pub(super) fn representative(drops: &Drops) -> impl Iterator<Item = &DropClass> {
    let area = |class: &DropClass| class.per_m3 * class.diameter_mm.powi(2);
    let most = drops.classes().iter().map(area).fold(0.0, f64::max);
    let counts = move |class: &&DropClass| area(class) > 1e-3 * most;
    let step = drops.classes().iter().filter(counts).count().div_ceil(20).max(1);
    drops.classes().iter().filter(counts).step_by(step)
}

/// Bins of the scattering angle.
const BINS: usize = 120;

/// Samples of the phase function in each bin.
const SAMPLES: usize = 16;

/// Fractional part of the golden ratio. Its multiples are distributed most evenly over 0 to 1.
pub(super) const GOLDEN_RATIO: f64 = 0.618_033_988_749_895;

/// First edge after 0, in radians: a twentieth of the diffraction lobe of an 8 mm drop in violet
/// light.
const FIRST_EDGE_RAD: f64 = 2e-6;

/// The distribution of a medium's scattering angles, cumulative.
#[derive(Debug, Clone, PartialEq)]
pub struct ScatteringAngles {
    /// Upper edges of the bins, ascending, the last pi; the first bin begins at 0.
    edges_rad: Vec<f64>,
    /// Share of all scattered light up to each edge, the last 1.
    cumulative: Vec<f64>,
    /// Integral of the sampled phase function before normalisation.
    raw_total: f64,
}

impl ScatteringAngles {
    /// The angles into which `drops` scatter light of `wavelength_nm`. Each size contributes in
    /// proportion to the light that it scatters.
    ///
    /// # Errors
    /// As [`Medium::new`], and [`RainError::NoDrops`] for dry air.
    pub fn new(
        drops: &Drops,
        wavelength_nm: f64,
        substance: impl Into<Substance>,
    ) -> Result<Self, RainError> {
        let index = substance.into().index(wavelength_nm)?;
        let growth = (PI / FIRST_EDGE_RAD).powf(1.0 / (BINS - 1) as f64);
        let edges_rad: Vec<f64> =
            (0..BINS).map(|i| (FIRST_EDGE_RAD * growth.powi(i as i32)).min(PI)).collect();
        let angles: Vec<f64> = (0..BINS * SAMPLES)
            .map(|i| {
                let low = if i < SAMPLES { 0.0 } else { edges_rad[i / SAMPLES - 1] };
                let high = edges_rad[i / SAMPLES];
                // The samples are distributed evenly, but not in step with the lobes of a single
                // drop size.
                let jitter = (i as f64 * GOLDEN_RATIO).fract();
                low + (high - low) * ((i % SAMPLES) as f64 + jitter) / SAMPLES as f64
            })
            .collect();
        let cosines: Vec<f64> = angles.iter().map(|angle| angle.cos()).collect();

        let mut mie = Mie::new();
        let mut bins = vec![0.0; BINS];
        let mut scattering = 0.0;
        for class in representative(drops) {
            let area = class.per_m3 * class.diameter_mm.powi(2);
            let sphere = mie.sphere(size_parameter(class.diameter_mm, wavelength_nm), index)?;
            let weight = area * sphere.efficiencies().scattering;
            scattering += weight;
            for (i, (phase, angle)) in sphere.phase(&cosines)?.iter().zip(&angles).enumerate() {
                let bin = i / SAMPLES;
                let low = if bin == 0 { 0.0 } else { edges_rad[bin - 1] };
                let width = (edges_rad[bin] - low) / SAMPLES as f64;
                bins[bin] += weight * phase / 2.0 * angle.sin() * width;
            }
        }
        if scattering == 0.0 {
            return Err(RainError::NoDrops);
        }
        let mut sum = 0.0;
        let mut cumulative: Vec<f64> = bins
            .iter()
            .map(|bin| {
                sum += bin / scattering;
                sum
            })
            .collect();
        for share in &mut cumulative {
            *share /= sum;
        }
        Ok(Self { edges_rad, cumulative, raw_total: sum })
    }

    /// Share of the scattered light that leaves within `angle_rad` of the beam.
    #[must_use]
    pub fn within(&self, angle_rad: f64) -> f64 {
        let bin = self.edges_rad.partition_point(|&edge| edge < angle_rad);
        if bin >= BINS {
            return 1.0;
        }
        let (low_angle, low) =
            if bin == 0 { (0.0, 0.0) } else { (self.edges_rad[bin - 1], self.cumulative[bin - 1]) };
        let part = (angle_rad - low_angle).max(0.0) / (self.edges_rad[bin] - low_angle);
        low + (self.cumulative[bin] - low) * part
    }

    /// The angle within which a share of the scattered light leaves. A random `share` in 0 to 1
    /// gives a random angle.
    #[must_use]
    pub fn quantile_rad(&self, share: f64) -> f64 {
        let bin = self.cumulative.partition_point(|&sum| sum < share).min(BINS - 1);
        let (low_angle, low) =
            if bin == 0 { (0.0, 0.0) } else { (self.edges_rad[bin - 1], self.cumulative[bin - 1]) };
        let width = self.cumulative[bin] - low;
        let part = if width > 0.0 { ((share - low) / width).clamp(0.0, 1.0) } else { 1.0 };
        low_angle + (self.edges_rad[bin] - low_angle) * part
    }

    /// The phase function at an angle, which is that of its bin. The mean over the sphere is 1.
    #[must_use]
    pub fn phase(&self, angle_rad: f64) -> f64 {
        let bin = self.edges_rad.partition_point(|&edge| edge < angle_rad).min(BINS - 1);
        let (low_angle, low) =
            if bin == 0 { (0.0, 0.0) } else { (self.edges_rad[bin - 1], self.cumulative[bin - 1]) };
        2.0 * (self.cumulative[bin] - low) / (low_angle.cos() - self.edges_rad[bin].cos())
    }

    /// Mean cosine of the scattering angle, from the bins' centres.
    #[must_use]
    pub fn asymmetry(&self) -> f64 {
        let mut low = (0.0, 0.0);
        let mut mean = 0.0;
        for (&edge, &sum) in self.edges_rad.iter().zip(&self.cumulative) {
            mean += (sum - low.1) * ((edge + low.0) / 2.0).cos();
            low = (edge, sum);
        }
        mean
    }

    /// Integral of the sampled phase function before normalisation, which shows how well the bins
    /// resolve the function.
    #[must_use]
    pub fn raw_total(&self) -> f64 {
        self.raw_total
    }
}
