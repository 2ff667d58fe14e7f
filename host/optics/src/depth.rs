//! The time-of-flight sensor: 8 x 8 zones at 940 nm (ST VL53L5CX and VL53L8CX), and the positions
//! of the zones in the camera's image.
//!
//! # Invariant
//! A zone without a distance reads 0
//! (`tests::invalid_zones_read_zero_and_the_others_the_distance`).
//!
//! The zones of the sensor cover 45 x 45 degrees (63 degrees along the diagonal; ST UM3109). The
//! camera's field covers some 3 to 9 degrees. One to four zones see the field, and the other zones
//! see the wall next to the target. [`DepthGeometry`] computes which zones see the field.

use crate::SIDE;
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
#[non_exhaustive]
pub enum DepthError {
    /// The distance is outside the sensor's range.
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
    /// A target at `distance_mm`, with Gaussian noise of `noise_mm` rms in each zone. Zones whose
    /// bit is set in `invalid_zones` (bit `8 * row + column`) have no reading.
    ///
    /// # Errors
    /// [`DepthError`] if the distance is outside the sensor's range, or the noise is negative or
    /// NaN.
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

    /// One reading: 8 x 8 distances in millimetres, row-major, 0 for a zone without a distance.
    pub fn reading(&mut self) -> [u16; DEPTH_ZONES] {
        std::array::from_fn(|zone| {
            let noise: f64 = self.rng.sample(StandardNormal);
            if self.invalid_zones >> zone & 1 == 1 {
                return 0;
            }
            let measured = (self.distance_mm + self.noise_mm * noise).round();
            // A measured value below 1 mm or above the reading's maximum is not a distance either.
            if (1.0..=f64::from(u16::MAX)).contains(&measured) { measured as u16 } else { 0 }
        })
    }
}

/// The positions of the sensor's zones, seen from the camera.
///
/// The sensor looks along the projector's axis. Zone row 0 is at the top and column 0 at the left,
/// like pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthGeometry {
    /// Angle that the 8 zones of a row, and of a column, cover.
    pub fov_deg: f64,
    /// Position of the sensor relative to the projector's axis: right, and down.
    pub offset_mm: [f64; 2],
}

/// A depth map in the camera's image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DepthView {
    /// Distance of each pixel, 32 x 32, row-major; 0 if its zone has no distance.
    pub pixels_mm: Vec<u16>,
    /// Median of the zones that see the field; `None` if none of these zones has a distance.
    pub median_mm: Option<u16>,
    /// Number of zones that see the field and have a distance.
    pub zones: usize,
}

impl DepthGeometry {
    /// The zone, along one axis, that sees a point at `at_mm` from the projector's axis on a plane
    /// at `distance_mm`: a pinhole camera with zones of equal width on a plane. A value below 0, or
    /// from [`DEPTH_SIDE`] on, means no zone.
    fn zone(&self, at_mm: f64, offset_mm: f64, distance_mm: f64) -> f64 {
        let half = (self.fov_deg.to_radians() / 2.0).tan();
        let tangent = (at_mm - offset_mm) / distance_mm;
        (tangent / half + 1.0) / 2.0 * DEPTH_SIDE as f64
    }

    /// The zones, along one axis, that see part of a field of `field_mm` on a plane at
    /// `distance_mm`.
    fn zones_of_field(
        &self,
        axis: usize,
        field_mm: f64,
        distance_mm: f64,
    ) -> std::ops::Range<usize> {
        let offset_mm = self.offset_mm[axis];
        let [from, to] = [-0.5, 0.5].map(|edge| self.zone(edge * field_mm, offset_mm, distance_mm));
        // A zone whose edge only touches the field does not see the field.
        let last = DEPTH_SIDE as f64;
        let from = (from + 1e-9).floor().clamp(0.0, last) as usize;
        let to = (to - 1e-9).ceil().clamp(0.0, last) as usize;
        from..to.max(from)
    }

    /// Transfers a reading of 8 x 8 zones into the camera's image. `field_over_distance` is the
    /// side of the field divided by the distance of the target
    /// ([`crate::Projector::field_over_distance`]).
    ///
    /// The sensor is next to the projector, so the zones that see the field depend on the target's
    /// distance. The middle zones give a first distance; the zones found with the first distance
    /// give the final distance.
    #[must_use]
    pub fn view(&self, zones_mm: &[u16; DEPTH_ZONES], field_over_distance: f64) -> DepthView {
        let middle = DEPTH_SIDE / 2 - 1..DEPTH_SIDE / 2 + 1;
        let seen = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
            let mut seen: Vec<u16> = rows
                .flat_map(|row| {
                    columns.clone().map(move |column| zones_mm[row * DEPTH_SIDE + column])
                })
                .filter(|&mm| mm > 0)
                .collect();
            seen.sort_unstable();
            seen
        };
        let median = |seen: &[u16]| seen.get(seen.len() / 2).copied();
        let whole = || median(&seen(0..DEPTH_SIDE, 0..DEPTH_SIDE));
        let mut nearest_guess = median(&seen(middle.clone(), middle)).or_else(whole);
        let mut in_field = Vec::new();
        for _ in 0..3 {
            let Some(mm) = nearest_guess.map(f64::from) else { break };
            let zones = |axis| self.zones_of_field(axis, field_over_distance * mm, mm);
            in_field = seen(zones(1), zones(0));
            nearest_guess = median(&in_field).or(nearest_guess);
        }
        let pixel_mm = |pixel: usize| {
            let mm = f64::from(nearest_guess?);
            let at = |i: usize| ((i as f64 + 0.5) / SIDE as f64 - 0.5) * field_over_distance * mm;
            let column = self.zone(at(pixel % SIDE), self.offset_mm[0], mm);
            let row = self.zone(at(pixel / SIDE), self.offset_mm[1], mm);
            let inside = 0.0..DEPTH_SIDE as f64;
            (inside.contains(&row) && inside.contains(&column))
                .then(|| zones_mm[row as usize * DEPTH_SIDE + column as usize])
        };
        DepthView {
            pixels_mm: (0..SIDE * SIDE).map(|pixel| pixel_mm(pixel).unwrap_or(0)).collect(),
            median_mm: median(&in_field),
            zones: in_field.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CameraModel, Projector};

    /// A reading of a square target in front of a wall. A zone sees the target if its middle does.
    fn before_a_wall(
        geometry: &DepthGeometry,
        target_mm: f64,
        at_mm: u16,
        wall_mm: u16,
    ) -> [u16; DEPTH_ZONES] {
        let half = (geometry.fov_deg.to_radians() / 2.0).tan();
        let middle = |i: usize| ((i as f64 + 0.5) / 4.0 - 1.0) * half * f64::from(at_mm);
        std::array::from_fn(|zone| {
            let x = middle(zone % DEPTH_SIDE) + geometry.offset_mm[0];
            let y = middle(zone / DEPTH_SIDE) + geometry.offset_mm[1];
            let hit = x.abs().max(y.abs()) < target_mm / 2.0;
            if hit { at_mm } else { wall_mm }
        })
    }

    #[test]
    fn the_wall_beside_the_target_is_not_taken_for_the_target() {
        let geometry = CameraModel::paper().depth_geometry();
        let field = Projector::default().field_over_distance();
        // A sheet a little wider than the field; at 0.6 m a zone is 62 mm wide.
        for at_mm in [300, 600, 1000] {
            let sheet_mm = 1.6 * field * f64::from(at_mm) + 40.0;
            let reading = before_a_wall(&geometry, sheet_mm, at_mm, 3000);
            assert!(
                reading.iter().filter(|&&mm| mm == 3000).count() > 32,
                "most zones see the wall"
            );
            let view = geometry.view(&reading, field);
            assert_eq!(view.median_mm, Some(at_mm), "{reading:?}");
            assert!((1..=6).contains(&view.zones), "{view:?}");
        }
    }

    #[test]
    fn a_pixel_has_the_distance_of_the_zone_that_sees_it() {
        // Each zone reads its number. With the sensor on the axis, the field lies on the middle
        // four zones.
        let reading: [u16; DEPTH_ZONES] = std::array::from_fn(|zone| 1000 + zone as u16);
        let geometry = DepthGeometry { fov_deg: 45.0, offset_mm: [0.0, 0.0] };
        let view = geometry.view(&reading, 0.16);
        let at = |row: usize, column: usize| view.pixels_mm[row * SIDE + column] - 1000;
        assert_eq!([at(0, 0), at(0, 31), at(31, 0), at(31, 31)], [27, 28, 35, 36]);
        assert_eq!(view.zones, 4);
        // A sensor to the left of the axis sees the field in its right half.
        let left = DepthGeometry { offset_mm: [-150.0, 0.0], ..geometry };
        let view = left.view(&reading, 0.16);
        assert_eq!(view.pixels_mm[0] - 1000, 28, "one zone farther to the right");
    }

    #[test]
    fn zones_without_a_distance_give_none() {
        let geometry = DepthGeometry { fov_deg: 45.0, offset_mm: [0.0, 0.0] };
        let view = geometry.view(&[0; DEPTH_ZONES], 0.16);
        assert_eq!((view.median_mm, view.zones), (None, 0));
        assert!(view.pixels_mm.iter().all(|&mm| mm == 0));
        let mut one = [0; DEPTH_ZONES];
        one[27] = 500;
        let view = geometry.view(&one, 0.16);
        assert_eq!((view.median_mm, view.zones), (Some(500), 1));
        assert_eq!(view.pixels_mm.iter().filter(|&&mm| mm == 500).count(), 16 * 16);
    }

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
        // With 12 800 values the variance is known to sqrt(2 / 12 800) = 1.25 %; the limit is four
        // times that.
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
