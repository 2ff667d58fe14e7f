//! The time-of-flight sensor's view of a flat target: 8 x 8 zones, as the common 850 nm sensors give.
//!
//! Law: a zone that has no distance reads 0, never a guess.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use thiserror::Error;

/// Zones along one side.
pub const DEPTH_SIDE: usize = 8;

/// Zones of one reading.
pub const DEPTH_ZONES: usize = DEPTH_SIDE * DEPTH_SIDE;

/// Why a depth sensor cannot be simulated.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DepthError {
    /// The distance does not fit the reading.
    #[error("depth: distance is {0} mm, expected more than 0 and at most 65535")]
    Distance(f64),
    /// The noise is not a standard deviation.
    #[error("depth: noise is {0} mm rms, expected 0 or more")]
    Noise(f64),
}

/// A seeded time-of-flight sensor facing a flat target.
#[derive(Debug, Clone)]
pub struct SimulatedDepth {
    distance_mm: f64,
    noise_mm: f64,
    invalid_zones: u64,
    rng: Pcg64Mcg,
}

impl SimulatedDepth {
    /// A target at `distance_mm`, Gaussian noise of `noise_mm` rms a zone, and no reading in the
    /// zones whose bit is set in `invalid_zones` (bit `8 * row + column`).
    ///
    /// # Errors
    /// [`DepthError`] if the distance does not fit a reading or the noise is negative or NaN.
    pub fn new(
        distance_mm: f64,
        noise_mm: f64,
        invalid_zones: u64,
        seed: u64,
    ) -> Result<Self, DepthError> {
        if !(distance_mm > 0.0 && distance_mm <= f64::from(u16::MAX)) {
            return Err(DepthError::Distance(distance_mm));
        }
        if !(noise_mm.is_finite() && noise_mm >= 0.0) {
            return Err(DepthError::Noise(noise_mm));
        }
        Ok(Self { distance_mm, noise_mm, invalid_zones, rng: Pcg64Mcg::seed_from_u64(seed) })
    }

    /// One reading: 8 x 8 distances in millimetres, row-major, 0 where there is none.
    pub fn reading(&mut self) -> [u16; DEPTH_ZONES] {
        std::array::from_fn(|zone| {
            let noise: f64 = self.rng.sample(StandardNormal);
            if self.invalid_zones >> zone & 1 == 1 {
                return 0;
            }
            let measured = (self.distance_mm + self.noise_mm * noise).round();
            // Noise below 1 mm or past the reading's end is no distance either.
            if (1.0..=f64::from(u16::MAX)).contains(&measured) { measured as u16 } else { 0 }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_zones_read_zero_and_the_others_the_distance() {
        let mask = 1 | 1 << 63 | 1 << 12;
        let reading = SimulatedDepth::new(600.4, 0.0, mask, 1).unwrap().reading();
        for (zone, &mm) in reading.iter().enumerate() {
            assert_eq!(mm, if mask >> zone & 1 == 1 { 0 } else { 600 }, "zone {zone}");
        }
    }

    #[test]
    fn noise_has_the_spread_asked_for_and_repeats_with_its_seed() {
        let mut sensor = SimulatedDepth::new(1000.0, 15.0, 0, 3).unwrap();
        let mut again = SimulatedDepth::new(1000.0, 15.0, 0, 3).unwrap();
        let mut squares = 0.0;
        let readings = 200;
        for _ in 0..readings {
            let reading = sensor.reading();
            assert_eq!(reading, again.reading());
            squares += reading.iter().map(|&mm| (f64::from(mm) - 1000.0).powi(2)).sum::<f64>();
        }
        // 12 800 values: the variance is known to sqrt(2 / 12 800) = 1.25 %; four of those.
        let variance = squares / (readings * DEPTH_ZONES) as f64;
        assert!((variance / (15.0 * 15.0) - 1.0).abs() < 0.05, "{variance}");
    }

    #[test]
    fn impossible_sensors_are_refused() {
        for mm in [0.0, -1.0, 70_000.0, f64::NAN] {
            assert!(matches!(SimulatedDepth::new(mm, 1.0, 0, 0), Err(DepthError::Distance(_))));
        }
        for mm in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(SimulatedDepth::new(300.0, mm, 0, 0), Err(DepthError::Noise(_))));
        }
    }

    #[test]
    fn noise_that_leaves_the_range_is_no_reading() {
        let reading = SimulatedDepth::new(2.0, 50.0, 0, 9).unwrap().reading();
        assert!(reading.contains(&0) && reading.iter().any(|&mm| mm > 0));
    }
}
