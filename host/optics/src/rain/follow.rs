//! Simulates light photon by photon through dense air: any number of scatterings, in three
//! dimensions.
//!
//! A photon flies a free path drawn from Beer and Lambert's law, loses the absorbed share of its
//! weight, turns by an angle drawn from [`ScatteringAngles`], and continues until it crosses the
//! plane of the target or of the camera (Monte Carlo; Wang, Jacques and Zheng, Comput. Methods
//! Programs Biomed. 47, 131, 1995). For light back to the detector, each collision contributes its
//! expected direct light at the detector (the local estimate; Marchuk and others, *The Monte Carlo
//! Methods in Atmospheric Optics*, 1980), because too few photons hit a lens for counting.
//!
//! # Invariant
//! In thin air the results are those of single scattering (`tests::thin_air_scatters_once`).

use super::{BackwardLobe, Medium, ScatteringAngles};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::f64::consts::{PI, TAU};

/// Number of simulated photons.
const PHOTONS: u32 = 60_000;

/// Below this weight a photon survives one time in ten, with ten times the weight.
const FAINT: f64 = 1e-3;

/// The smallest distance of a collision from the detector, in mm: about the radius of its lens.
const NEAREST_MM: f64 = 10.0;

/// Rings of the landing radius per octave.
const RINGS_PER_OCTAVE: f64 = 6.0;

/// Number of rings: from a millionth of the path to eight paths.
const RINGS: usize = 138;

/// Where the scattered light of a pencil lands on a target.
#[derive(Debug, Clone, PartialEq)]
pub struct Landing {
    smallest_mm: f64,
    /// Share of all light that lands within each ring's outer edge.
    within: Vec<f64>,
}

impl Landing {
    /// Share of the light that is scattered and lands within `radius_mm` of its aim. Between rings
    /// the share grows with the logarithm of the radius.
    #[must_use]
    pub fn within(&self, radius_mm: f64) -> f64 {
        let at = RINGS_PER_OCTAVE * (radius_mm / self.smallest_mm).log2();
        let last = self.within.len() - 1;
        if at <= 0.0 {
            return self.within[0] * (radius_mm / self.smallest_mm).powi(2);
        }
        let low = (at as usize).min(last);
        let part = (at - low as f64).min(1.0);
        self.within[low] + part * (self.within[(low + 1).min(last)] - self.within[low])
    }
}

/// A photon on its way.
struct Photon {
    /// In mm; the camera's plane is z = 0.
    at: [f64; 3],
    /// Unit vector.
    along: [f64; 3],
    weight: f64,
    scattered: bool,
}

/// The air that photons fly through.
pub(super) struct Slab<'a> {
    pub medium: &'a Medium,
    pub angles: &'a ScatteringAngles,
    pub distance_mm: f64,
}

impl Slab<'_> {
    /// Flies a photon from collision to collision. `collided` receives the photon before each turn.
    /// Returns where the photon crosses the target's plane, if it does.
    fn fly(
        &self,
        photon: &mut Photon,
        rng: &mut Pcg64Mcg,
        mut collided: impl FnMut(&Photon),
    ) -> Option<[f64; 2]> {
        let free_mm = 1e3 / self.medium.extinction_per_m;
        loop {
            let path_mm = -(1.0 - rng.random::<f64>()).ln() * free_mm;
            let Photon { at, along, .. } = &mut *photon;
            let to_target = (self.distance_mm - at[2]) / along[2];
            if along[2] > 0.0 && path_mm >= to_target {
                return Some([at[0] + along[0] * to_target, at[1] + along[1] * to_target]);
            }
            *at = std::array::from_fn(|i| at[i] + along[i] * path_mm);
            if at[2] < 0.0 {
                return None;
            }
            photon.weight *= self.medium.albedo();
            if photon.weight < FAINT {
                if rng.random::<f64>() > 0.1 {
                    return None;
                }
                photon.weight *= 10.0;
            }
            collided(photon);
            photon.scattered = true;
            let angle = self.angles.quantile_rad(rng.random());
            photon.along = turned(photon.along, angle, rng.random::<f64>() * TAU);
        }
    }

    /// Where the scattered light of a pencil that flies straight at the target lands.
    pub(super) fn landing(&self, seed: u64) -> Landing {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let smallest_mm = self.distance_mm * 1e-6;
        let mut rings = vec![0.0; RINGS];
        for _ in 0..PHOTONS {
            let mut photon =
                Photon { at: [0.0; 3], along: [0.0, 0.0, 1.0], weight: 1.0, scattered: false };
            let Some([x, y]) = self.fly(&mut photon, &mut rng, |_| {}) else { continue };
            if photon.scattered {
                let ring = (RINGS_PER_OCTAVE * (x.hypot(y) / smallest_mm).log2()).ceil();
                if ring < RINGS as f64 {
                    rings[ring.max(0.0) as usize] += photon.weight / f64::from(PHOTONS);
                }
            }
        }
        let mut sum = 0.0;
        for ring in &mut rings {
            sum += *ring;
            *ring = sum;
        }
        Landing { smallest_mm, within: rings }
    }

    /// Light that the air scatters back into a detector `baseline_mm` beside the projector before
    /// reaching the target, divided by the light of a white target in dry air. Projector and
    /// detector see a field of `field_mm` on the target.
    pub(super) fn backscatter(
        &self,
        lobe: &BackwardLobe,
        baseline_mm: f64,
        field_mm: f64,
        seed: u64,
    ) -> f64 {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let distance_mm = self.distance_mm;
        let mut sum = 0.0;
        for _ in 0..PHOTONS {
            let aim = [0.0; 2].map(|_: f64| field_mm * (rng.random::<f64>() - 0.5));
            let along = unit([aim[0], aim[1], distance_mm]);
            let mut photon = Photon { at: [0.0; 3], along, weight: 1.0, scattered: false };
            self.fly(&mut photon, &mut rng, |photon| {
                let [x, y, z] = photon.at;
                // Where the detector's line of sight through the collision meets the target.
                let seen = [(x - baseline_mm) * distance_mm / z + baseline_mm, y * distance_mm / z];
                if seen.iter().any(|s| s.abs() > field_mm / 2.0) {
                    return;
                }
                let to = [baseline_mm - x, -y, -z];
                let length_mm = to.iter().map(|v| v * v).sum::<f64>().sqrt().max(NEAREST_MM);
                let cosine = unit(to).iter().zip(photon.along).map(|(a, b)| a * b).sum::<f64>();
                let angle_rad = cosine.clamp(-1.0, 1.0).acos();
                // The bins of the angles are 20 degrees wide there, wider than the glory of
                // droplets.
                let phase = match angle_rad >= BackwardLobe::FIRST_DEG.to_radians() {
                    true => lobe.phase(angle_rad),
                    false => self.angles.phase(angle_rad),
                };
                sum += photon.weight * phase / (4.0 * PI) / length_mm.powi(2)
                    * self.medium.transmission(length_mm * 1e-3);
            });
        }
        // A white (Lambertian) target returns 1 / (pi L^2).
        sum / f64::from(PHOTONS) * PI * distance_mm.powi(2)
    }
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    v.map(|x| x / v.iter().map(|y| y * y).sum::<f64>().sqrt())
}

/// A direction turned by `angle`, around itself by `azimuth`.
fn turned(along: [f64; 3], angle: f64, azimuth: f64) -> [f64; 3] {
    let helper = if along[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let side = unit(cross(along, helper));
    let other = cross(along, side);
    let (sin, cos) = angle.sin_cos();
    unit(std::array::from_fn(|i| {
        along[i] * cos + (side[i] * azimuth.cos() + other[i] * azimuth.sin()) * sin
    }))
}

#[cfg(test)]
mod tests {
    use super::super::{Drops, ForwardBlur, Veil};
    use super::*;
    use crate::Projector;
    use crate::water::Water;

    #[test]
    fn thin_air_scatters_once() {
        let fog = Drops::fog(10.0, 0.2).unwrap();
        let medium = Medium::new(&fog, 1550.0, Water::Segelstein).unwrap();
        let angles = ScatteringAngles::new(&fog, 1550.0, Water::Segelstein).unwrap();
        let lobe = BackwardLobe::new(&fog, 1550.0, Water::Segelstein).unwrap();
        let distance_mm = 1000.0;
        let slab = Slab { medium: &medium, angles: &angles, distance_mm };
        let depth = medium.extinction_per_m;
        assert!((0.02..0.1).contains(&depth), "{depth}");

        let landing = slab.landing(5);
        let blur = ForwardBlur::new(medium, Some(angles.clone()), distance_mm).unwrap();
        for radius_mm in [10.0, 50.0, 200.0, 1000.0] {
            let (followed, once) = (landing.within(radius_mm), blur.scattered_within(radius_mm));
            // The limit is four standard deviations plus light scattered twice.
            let allowed = 4.0 * (once / f64::from(PHOTONS)).sqrt() + depth * depth / 2.0;
            assert!((followed - once).abs() < allowed, "{radius_mm} mm: {followed}, {once}");
            assert!(once > 5.0 * allowed || radius_mm < 50.0, "{once} {allowed}");
        }

        let projector = Projector::default();
        let once =
            Veil::new(&medium, Some((&lobe, &angles)), &projector, distance_mm, 40.0).unwrap();
        let followed = slab.backscatter(&lobe, 40.0, projector.field_mm(distance_mm), 5);
        // The single-scattering veil approximates the common part of the two fields along one axis.
        assert!((followed / once.backscatter - 1.0).abs() < 0.15, "{followed} {once:?}");
    }

    #[test]
    fn the_veil_is_hardly_brighter_or_darker_where_photons_take_over() {
        // An optical depth of 0.45. Against a dimmed white target the veil would be exp(0.9) = 2.5 times as bright.
        let fog = Drops::fog(10.0, 2.0).unwrap();
        let medium = Medium::new(&fog, 1550.0, Water::Segelstein).unwrap();
        let angles = ScatteringAngles::new(&fog, 1550.0, Water::Segelstein).unwrap();
        let lobe = BackwardLobe::new(&fog, 1550.0, Water::Segelstein).unwrap();
        let distance_mm = 450.0 / medium.extinction_per_m;
        let projector = Projector::default();
        let once =
            Veil::new(&medium, Some((&lobe, &angles)), &projector, distance_mm, 40.0).unwrap();
        let slab = Slab { medium: &medium, angles: &angles, distance_mm };
        let followed = slab.backscatter(&lobe, 40.0, projector.field_mm(distance_mm), 5);
        assert!((0.8..1.5).contains(&(followed / once.backscatter)), "{followed} {once:?}");
    }

    #[test]
    fn a_share_between_two_rings_lies_between_theirs() {
        let landing = Landing { smallest_mm: 1.0, within: vec![0.1, 0.2, 0.4] };
        assert_eq!(landing.within(1.0), 0.1);
        assert!((landing.within(0.5) - 0.025).abs() < 1e-12);
        assert!((0.1..0.2).contains(&landing.within(1.05)));
        assert_eq!(landing.within(1e9), 0.4);
    }

    #[test]
    fn a_turned_direction_stays_a_unit_vector_at_that_angle() {
        for (along, angle) in
            [([0.0, 0.0, 1.0], 0.3), ([0.6, 0.0, 0.8], 2.0), ([0.0, 1.0, 0.0], 1e-4)]
        {
            let new = turned(along, angle, 1.0);
            let dot: f64 = new.iter().zip(along).map(|(a, b)| a * b).sum();
            assert!((dot - f64::cos(angle)).abs() < 1e-9);
            assert!((new.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
