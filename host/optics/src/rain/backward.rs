//! Light that drops scatter back towards the camera: the phase function from 140 to 180 degrees,
//! averaged over angles and sizes.
//!
//! Straight back, a single drop size scatters by orders of magnitude more or less than a size one
//! percent larger (the glory and its resonances). A camera does not see exactly that angle, because
//! collector and projector are next to each other. The phase function is therefore averaged over
//! bands of two degrees, and each drop class over sizes within 5 % of its own. Drops of a nozzle
//! differ at least as much, and classes of a law of sizes are wider.

use super::medium::{GOLDEN_RATIO, representative, size_parameter};
use super::{Drops, RainError};
use crate::mie::Mie;
use crate::substance::Substance;

/// Width of a band, in degrees.
const BAND_DEG: f64 = 2.0;

/// Bands up to 180 degrees.
const BANDS: usize = 20;

/// Angles in a band.
const ANGLES: usize = 8;

/// Drop sizes over all classes, at least one a class.
const SIZES: usize = 16;

/// Half of the relative width over which a class is averaged.
const SPREAD: f64 = 0.05;

/// The phase function close to the direction back, with a mean of 1 over the sphere.
#[derive(Debug, Clone, PartialEq)]
pub struct BackwardLobe {
    /// Means over bands of 2 degrees, from 140 to 180 degrees.
    bands: [f64; BANDS],
}

impl BackwardLobe {
    /// Start of the bands, in degrees of the scattering angle.
    pub(super) const FIRST_DEG: f64 = 140.0;

    /// Backscatter of `drops` for light of `wavelength_nm`. Each size contributes in proportion to
    /// the light that it scatters.
    ///
    /// # Errors
    /// As [`super::Medium::new`], and [`RainError::NoDrops`] for dry air.
    pub fn new(
        drops: &Drops,
        wavelength_nm: f64,
        substance: impl Into<Substance>,
    ) -> Result<Self, RainError> {
        let index = substance.into().index(wavelength_nm)?;
        let angle_deg = |i: usize| {
            let jitter = (i as f64 * GOLDEN_RATIO).fract();
            Self::FIRST_DEG
                + BAND_DEG * (i / ANGLES) as f64
                + BAND_DEG * ((i % ANGLES) as f64 + jitter) / ANGLES as f64
        };
        let cosines: Vec<f64> =
            (0..BANDS * ANGLES).map(|i| angle_deg(i).to_radians().cos()).collect();
        let per_class = SIZES.div_ceil(representative(drops).count().max(1));
        let mut mie = Mie::new();
        let mut bands = [0.0; BANDS];
        let mut scattering = 0.0;
        for class in representative(drops) {
            for k in 0..per_class {
                let part = (k as f64 + 0.5) / per_class as f64;
                // The largest drop is averaged downwards, because there are no larger drops.
                let diameter_mm = (class.diameter_mm * (1.0 + SPREAD * (2.0 * part - 1.0)))
                    .min(super::drops::LARGEST_RAINDROP_MM);
                let sphere = mie.sphere(size_parameter(diameter_mm, wavelength_nm), index)?;
                let area = class.per_m3 * diameter_mm.powi(2);
                let weight = area * sphere.efficiencies().scattering;
                scattering += weight;
                for (i, phase) in sphere.phase(&cosines)?.iter().enumerate() {
                    bands[i / ANGLES] += weight * phase / ANGLES as f64;
                }
            }
        }
        if scattering == 0.0 {
            return Err(RainError::NoDrops);
        }
        Ok(Self { bands: bands.map(|sum| sum / scattering) })
    }

    /// The phase function at a scattering angle. Below 140 degrees the value is that at 140
    /// degrees.
    #[must_use]
    pub fn phase(&self, angle_rad: f64) -> f64 {
        let band = (angle_rad.to_degrees() - Self::FIRST_DEG) / BAND_DEG;
        self.bands[(band.max(0.0) as usize).min(BANDS - 1)]
    }
}
