//! A scene in three dimensions: a picture, and the distance of each of its pixels.
//!
//! The picture is what a pinhole in the middle of the lens would see of the field. Pixels of one
//! distance are a flat part of the scene. The light of all parts adds up, and each part has the
//! defocus of its own distance ([`Projector::footprint`]). The model leaves out that a near part
//! hides a share of the wide cones that light a farther part next to its edge.
//!
//! # Invariant
//! A relief of one distance is a flat scene
//! (`tests::a_relief_of_one_distance_is_a_flat_scene`).

use crate::depth::{DEPTH_SIDE, DEPTH_ZONES, DepthError, DepthGeometry};
use crate::{LEDS, Projector, ProjectorError, Scene, SceneError};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use thiserror::Error;

/// The most parts of a relief: each one takes the time of a flat scene.
pub const MOST_PARTS: usize = 16;

/// Reflectance of the wall that the time-of-flight sensor sees beside the field (assumed).
const WALL_REFLECTANCE: f64 = 0.5;

/// Why a relief cannot be made or seen.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ReliefError {
    /// There is not one distance for each pixel.
    #[error("relief: {found} distances given, one for each of {expected} pixels expected")]
    Shape {
        /// Number of distances given.
        found: usize,
        /// Number of pixels.
        expected: usize,
    },
    /// A distance is not a positive length.
    #[error("relief: distance {found} mm at pixel {pixel}, expected a positive length")]
    Distance {
        /// Index of the pixel, row-major.
        pixel: usize,
        /// The value found.
        found: f32,
    },
    /// There are too many different distances.
    #[error("relief: {0} different distances, expected at most {MOST_PARTS}")]
    Parts(usize),
    /// The picture is not a scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A part cannot be lit.
    #[error(transparent)]
    Projector(#[from] ProjectorError),
    /// The depth sensor cannot be simulated.
    #[error(transparent)]
    Depth(#[from] DepthError),
}

/// A picture of the field, and the distance of each of its pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Relief {
    reflectance: Vec<f32>,
    distance_mm: Vec<f32>,
    size_px: usize,
    /// Different distances, nearest first.
    parts_mm: Vec<f32>,
}

impl Relief {
    /// A relief from `size_px` x `size_px` reflectances in [0, 1] and as many distances, row-major,
    /// which cover the field.
    ///
    /// # Errors
    /// [`ReliefError`] if a list has another length, a value is out of range, or there are more
    /// than [`MOST_PARTS`] different distances.
    pub fn new(
        reflectance: Vec<f32>,
        distance_mm: Vec<f32>,
        size_px: usize,
    ) -> Result<Self, ReliefError> {
        let (found, expected) = (distance_mm.len(), reflectance.len());
        if found != expected {
            return Err(ReliefError::Shape { found, expected });
        }
        if let Some(pixel) = distance_mm.iter().position(|mm| !(*mm > 0.0 && mm.is_finite())) {
            return Err(ReliefError::Distance { pixel, found: distance_mm[pixel] });
        }
        let mut parts_mm = distance_mm.clone();
        parts_mm.sort_unstable_by(f32::total_cmp);
        parts_mm.dedup();
        if parts_mm.len() > MOST_PARTS {
            return Err(ReliefError::Parts(parts_mm.len()));
        }
        // Shape and range of the reflectances are those of a scene.
        Scene::new(reflectance.clone(), size_px, 1.0)?;
        Ok(Self { reflectance, distance_mm, size_px, parts_mm })
    }

    /// Distance of each pixel in millimetres, row-major.
    #[must_use]
    pub fn distance_mm(&self) -> &[f32] {
        &self.distance_mm
    }

    /// Light from a target at `distance_mm` over that from the same target at the nearest part:
    /// the light that comes back falls with the square of the distance.
    fn falloff(&self, distance_mm: f32) -> f32 {
        (self.parts_mm[0] / distance_mm).powi(2)
    }

    /// The image without defocus, at the relief's own resolution, row-major: 1 is a white target at
    /// the nearest part.
    #[must_use]
    pub fn focused(&self) -> Vec<f32> {
        let each = self.reflectance.iter().zip(&self.distance_mm);
        each.map(|(reflectance, &mm)| reflectance * self.falloff(mm)).collect()
    }

    /// The light of each LED, 32 x 32, row-major: 1 is a white target at the nearest part.
    ///
    /// # Errors
    /// [`ReliefError::Projector`] for a part that is so far out of focus that no pattern remains.
    pub fn footprint(&self, projector: &Projector) -> Result<Vec<f32>, ReliefError> {
        let mut light = vec![0.0; LEDS];
        for &part_mm in &self.parts_mm {
            let of_part = self.reflectance.iter().zip(&self.distance_mm);
            let seen = of_part.map(|(&value, &mm)| if mm == part_mm { value } else { 0.0 });
            let at_mm = f64::from(part_mm);
            let scene = Scene::new(seen.collect(), self.size_px, projector.field_mm(at_mm))?;
            let footprint = projector.footprint(&scene, at_mm)?;
            for (light, weight) in light.iter_mut().zip(footprint.weights()) {
                *light += weight * self.falloff(part_mm);
            }
        }
        Ok(light)
    }

    /// One reading of a time-of-flight sensor: 8 x 8 distances in millimetres, row-major, 0 for a
    /// zone without a distance. Each zone says the distance from which most light comes back. A
    /// wall at `wall_mm` fills what the zones see beside the field. Each zone has Gaussian noise of
    /// `noise_mm` rms.
    ///
    /// # Errors
    /// [`ReliefError::Depth`] if the noise is negative or NaN.
    pub fn reading(
        &self,
        geometry: &DepthGeometry,
        field_over_distance: f64,
        wall_mm: u16,
        noise_mm: f64,
        seed: u64,
    ) -> Result<[u16; DEPTH_ZONES], ReliefError> {
        if !(noise_mm.is_finite() && noise_mm >= 0.0) {
            return Err(DepthError::Noise(noise_mm).into());
        }
        let pixel = field_over_distance / self.size_px as f64;
        let tangent = |i: usize| (i as f64 + 0.5 - self.size_px as f64 / 2.0) * pixel;
        let parts = self.parts_mm.len();
        // Light from each part in each zone, and the share of the zone that the field covers.
        let mut light = vec![0.0; DEPTH_ZONES * parts];
        let mut covered = [0.0; DEPTH_ZONES];
        let zone_width = geometry.zone_width();
        for (at, (&value, &mm)) in self.reflectance.iter().zip(&self.distance_mm).enumerate() {
            let z = f64::from(mm);
            let column = geometry.zone_of(0, tangent(at % self.size_px) * z, z);
            let row = geometry.zone_of(1, tangent(at / self.size_px) * z, z);
            let (Some(row), Some(column)) = (row, column) else { continue };
            let zone = row * DEPTH_SIDE + column;
            let share = (pixel / zone_width).powi(2);
            let part = self.parts_mm.partition_point(|&part| part < mm);
            light[zone * parts + part] += share * f64::from(value) / (z * z);
            covered[zone] += share;
        }
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        Ok(std::array::from_fn(|zone| {
            let noise: f64 = rng.sample(StandardNormal);
            let wall = f64::from(wall_mm);
            let beside = (1.0 - covered[zone]).max(0.0) * WALL_REFLECTANCE / (wall * wall);
            let of_parts = light[zone * parts..][..parts].iter().copied();
            let seen = of_parts.zip(self.parts_mm.iter().map(|&mm| f64::from(mm)));
            let (most, mm) = seen.fold((beside, wall), |a, b| if b.0 > a.0 { b } else { a });
            let measured = (mm + noise_mm * noise).round();
            let read = most > 0.0 && (1.0..=f64::from(u16::MAX)).contains(&measured);
            if read { measured as u16 } else { 0 }
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CameraModel;

    const SIZE: usize = 64;

    /// A stripe pattern whose left half is at `left_mm` and whose right half is at `right_mm`.
    fn halves(left_mm: f32, right_mm: f32) -> Relief {
        let stripe = |at: usize| if (at % SIZE / 4).is_multiple_of(2) { 0.9 } else { 0.1 };
        let half = |at: usize| if at % SIZE < SIZE / 2 { left_mm } else { right_mm };
        let all = || 0..SIZE * SIZE;
        Relief::new(all().map(stripe).collect(), all().map(half).collect(), SIZE).unwrap()
    }

    /// Contrast of the stripes in LED row 16 over some columns.
    fn contrast(light: &[f32], columns: std::ops::Range<usize>) -> f32 {
        let row = &light[16 * 32..17 * 32][columns];
        let (low, high) = row.iter().fold((1.0_f32, 0.0_f32), |(l, h), &v| (l.min(v), h.max(v)));
        (high - low) / (high + low)
    }

    #[test]
    fn a_relief_of_one_distance_is_a_flat_scene() {
        let projector = Projector::default();
        for mm in [300.0, 450.0] {
            let relief = halves(mm, mm);
            let side_mm = projector.field_mm(f64::from(mm));
            let scene = Scene::new(relief.reflectance.clone(), SIZE, side_mm).unwrap();
            let flat = projector.footprint(&scene, f64::from(mm)).unwrap();
            assert_eq!(relief.footprint(&projector).unwrap(), flat.weights());
            assert_eq!(relief.focused(), relief.reflectance);
        }
    }

    #[test]
    fn each_part_has_the_defocus_and_the_light_of_its_own_distance() {
        let light = halves(300.0, 600.0).footprint(&Projector::default()).unwrap();
        let flat = halves(600.0, 600.0).footprint(&Projector::default()).unwrap();
        let (near, far) = (contrast(&light, 2..14), contrast(&light, 20..30));
        assert!(near > 0.7, "the part in focus keeps its stripes: {near}");
        assert!((far - contrast(&flat, 20..30)).abs() < 0.02, "{far}");
        let mean = |light: &[f32]| light[16 * 32 + 20..16 * 32 + 30].iter().sum::<f32>();
        assert!((mean(&light) / mean(&flat) - 0.25).abs() < 0.01, "a quarter of the light");
    }

    #[test]
    fn a_zone_says_the_distance_from_which_most_light_comes_back() {
        let field = Projector::default().field_over_distance();
        // With the sensor on the axis, the middle of the field lies between two zones.
        let geometry = DepthGeometry { fov_deg: 45.0, offset_mm: [0.0, 0.0] };
        let reading = halves(300.0, 600.0).reading(&geometry, field, 3000, 0.0, 1).unwrap();
        let row = &reading[3 * DEPTH_SIDE..4 * DEPTH_SIDE];
        assert_eq!(row, [3000, 3000, 3000, 300, 600, 3000, 3000, 3000]);
        // A wide zone with both parts sees the near one, which sends four times the light.
        let wide = DepthGeometry { fov_deg: 160.0, offset_mm: [-20.0, -20.0] };
        let reading = halves(300.0, 600.0).reading(&wide, field, 60_000, 0.0, 1).unwrap();
        assert_eq!(reading[4 * DEPTH_SIDE + 4], 300);
    }

    #[test]
    fn noise_of_the_sensor_has_the_spread_asked_for() {
        let geometry = CameraModel::paper().depth_geometry();
        let relief = halves(400.0, 400.0);
        let mut squares = 0.0;
        for seed in 0..200 {
            let reading = relief.reading(&geometry, 0.16, 400, 10.0, seed).unwrap();
            squares += reading.iter().map(|&mm| (f64::from(mm) - 400.0).powi(2)).sum::<f64>();
        }
        let variance = squares / (200.0 * DEPTH_ZONES as f64);
        assert!((variance / 100.0 - 1.0).abs() < 0.05, "{variance}");
        assert!(relief.reading(&geometry, 0.16, 400, f64::NAN, 0).is_err());
    }

    #[test]
    fn impossible_reliefs_are_refused_with_the_place_named() {
        let of = |distances: Vec<f32>| Relief::new(vec![0.5; 4], distances, 2).unwrap_err();
        assert_eq!(of(vec![1.0; 3]), ReliefError::Shape { found: 3, expected: 4 });
        let error = of(vec![1.0, 1.0, 0.0, 1.0]);
        assert_eq!(error, ReliefError::Distance { pixel: 2, found: 0.0 });
        assert!(matches!(
            of(vec![1.0, f32::NAN, 1.0, 1.0]),
            ReliefError::Distance { pixel: 1, .. }
        ));
        let slope = (1..=25).map(|mm| mm as f32).collect();
        assert_eq!(Relief::new(vec![0.5; 25], slope, 5).unwrap_err(), ReliefError::Parts(25));
        let bright = Relief::new(vec![2.0; 4], vec![1.0; 4], 2);
        assert!(matches!(bright, Err(ReliefError::Scene(_))));
    }
}
