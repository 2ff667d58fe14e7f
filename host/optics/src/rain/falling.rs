//! Single drops in the LEDs' beams. In the paper's heavy rain there is half a drop between camera
//! and target at a metre: most frames have no drop, a few have one. A mean over many drops would
//! not show this difference.
//!
//! A drop is modelled as an opaque disc. The drop refracts or reflects light by far more than a
//! spot's width. (The other half of Q_ext = 2 is diffraction, by a quarter of a milliradian for a 2
//! mm drop, and stays within the spot.) [`super::blur`] computes the light that the drop scatters
//! onto the target.
//!
//! # Invariant
//! The drops are a stationary Poisson process: the seed determines place and time of entry, and the
//! fall speed determines the later position (`a_seed_repeats_its_rain_and_the_drops_stay_as_many`
//! in `host/optics/tests/rain.rs`).

use super::fall::fall_speed_m_per_s;
use super::{Drops, RainError, ensure};
use crate::{LEDS, Projector, SIDE};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Poisson};
use rand_pcg::Pcg64Mcg;
use std::f64::consts::PI;

/// The most drops that are simulated one by one.
const MOST_DROPS: f64 = 200_000.0;

/// Empty air around the beams, so that drops do not appear inside a beam.
const MARGIN_MM: f64 = 10.0;

/// The beams from projector to target and back to the detector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeamShadows {
    /// The projector, its lens at the origin.
    pub projector: Projector,
    /// Distance to the target.
    pub distance_mm: f64,
    /// Distance of the detector's collector from the projector's lens, to the right.
    pub baseline_mm: f64,
    /// Effective diameter of the collector ([`crate::Budget::effective_collector_mm`]).
    pub collector_mm: f64,
}

impl BeamShadows {
    /// Radius of an LED's beam at depth `z`: the lens's cone about the focus, and the emitter's
    /// image.
    fn out_radius_mm(&self, z: f64) -> f64 {
        let spot = self.projector.emitter_mm / 2.0 * self.projector.magnification(z);
        self.projector.blur_mm(z) / 2.0 + spot
    }

    /// Radius of the light from an LED's spot to the collector.
    fn back_radius_mm(&self, z: f64) -> f64 {
        let part = z / self.distance_mm;
        self.collector_mm / 2.0 * (1.0 - part) + self.out_radius_mm(self.distance_mm) * part
    }

    /// Multiplies into `kept` (32 x 32) the share of each LED's light that a drop leaves on the
    /// chosen paths.
    fn shade(&self, drop: &Drop, ways: Ways, kept: &mut [f32]) {
        let part = drop.z_mm / self.distance_mm;
        let pitch = self.projector.field_mm(self.distance_mm) / SIDE as f64 * part;
        let out = (0.0, self.out_radius_mm(drop.z_mm));
        let back = (self.baseline_mm * (1.0 - part), self.back_radius_mm(drop.z_mm));
        let both = [out, back];
        for &(offset, beam) in if ways == Ways::Both { &both[..] } else { &both[1..] } {
            let reach = beam + drop.radius_mm;
            let (x, y) = ((drop.x_mm - offset) / pitch, drop.y_mm / pitch);
            let centre = (SIDE as f64 - 1.0) / 2.0;
            let first = |at: f64| ((at + centre - reach / pitch).ceil().max(0.0)) as usize;
            let last = |at: f64| (at + centre + reach / pitch).floor().min(SIDE as f64 - 1.0);
            if last(x) < 0.0 || last(y) < 0.0 {
                continue;
            }
            for row in first(y)..=last(y) as usize {
                for column in first(x)..=last(x) as usize {
                    let dx = (column as f64 - centre - x) * pitch;
                    let dy = (row as f64 - centre - y) * pitch;
                    let hidden =
                        common_area(dx.hypot(dy), drop.radius_mm, beam) / (PI * beam * beam);
                    kept[row * SIDE + column] *= (1.0 - hidden) as f32;
                }
            }
        }
    }
}

/// The paths of light that a drop can block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ways {
    /// From the projector and back to the collector.
    Both,
    /// Only back to the collector: a camera in daylight.
    Back,
}

/// Common area of two discs whose centres are `apart`.
fn common_area(apart: f64, a: f64, b: f64) -> f64 {
    if apart >= a + b {
        return 0.0;
    }
    let smaller = a.min(b);
    if apart <= (a - b).abs() {
        return PI * smaller * smaller;
    }
    let angle = |r: f64, other: f64| {
        ((apart * apart + r * r - other * other) / (2.0 * apart * r)).clamp(-1.0, 1.0).acos()
    };
    let (alpha, gamma) = (angle(a, b), angle(b, a));
    let segment = |r: f64, angle: f64| r * r * (angle - (2.0 * angle).sin() / 2.0);
    segment(a, alpha) + segment(b, gamma)
}

#[derive(Debug, Clone, Copy)]
struct Drop {
    x_mm: f64,
    y_mm: f64,
    z_mm: f64,
    radius_mm: f64,
    speed_mm_per_s: f64,
}

/// Drops falling through the beams.
#[derive(Debug, Clone)]
pub struct FallingDrops {
    beams: BeamShadows,
    half_width_mm: f64,
    half_height_mm: f64,
    drops: Vec<Drop>,
    rng: Pcg64Mcg,
}

impl FallingDrops {
    /// Rain that started long ago. The same drops, beams and seed give the same rain.
    ///
    /// # Errors
    /// [`RainError::Setting`] for lengths that are not positive, or more than 200 000 drops in
    /// view.
    pub fn new(drops: &Drops, beams: BeamShadows, seed: u64) -> Result<Self, RainError> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        let lengths = [
            ("distance", beams.distance_mm),
            ("baseline", beams.baseline_mm),
            ("collector", beams.collector_mm),
        ];
        for (name, value) in lengths {
            ensure(positive(value), name, value, "a positive number of mm")?;
        }
        let field = beams.projector.field_mm(beams.distance_mm) / 2.0;
        let widest = beams.out_radius_mm(beams.distance_mm).max(beams.out_radius_mm(0.0));
        let half_height_mm = field + widest + MARGIN_MM;
        let half_width_mm = half_height_mm.max(beams.baseline_mm + beams.collector_mm + MARGIN_MM);
        let volume_m3 = 4.0 * half_width_mm * half_height_mm * beams.distance_mm * 1e-9;
        let expected_count = drops.concentration_per_m3() * volume_m3;
        let few = expected_count <= MOST_DROPS;
        ensure(few, "drops in view", expected_count.round(), "at most 200000: come nearer")?;

        let rng = Pcg64Mcg::seed_from_u64(seed);
        let mut rain = Self { beams, half_width_mm, half_height_mm, drops: Vec::new(), rng };
        for class in drops.classes() {
            let mean = class.per_m3 * volume_m3;
            let Ok(poisson) = Poisson::new(mean) else { continue };
            let count: f64 = poisson.sample(&mut rain.rng);
            for _ in 0..count as usize {
                let speed_mm_per_s = fall_speed_m_per_s(class.diameter_mm) * 1e3;
                let (x_mm, z_mm) = rain.entry();
                let y_mm = (2.0 * rain.rng.random::<f64>() - 1.0) * half_height_mm;
                let radius_mm = class.diameter_mm / 2.0;
                rain.drops.push(Drop { x_mm, y_mm, z_mm, radius_mm, speed_mm_per_s });
            }
        }
        Ok(rain)
    }

    /// The place in the top of the box where a drop enters.
    fn entry(&mut self) -> (f64, f64) {
        let x_mm = (2.0 * self.rng.random::<f64>() - 1.0) * self.half_width_mm;
        (x_mm, self.rng.random::<f64>() * self.beams.distance_mm)
    }

    /// Advances the drops by a time. Drops that leave at the bottom are replaced at the top.
    pub fn advance(&mut self, seconds: f64) {
        let height = 2.0 * self.half_height_mm;
        for i in 0..self.drops.len() {
            let fallen = self.drops[i].y_mm + self.drops[i].speed_mm_per_s * seconds;
            self.drops[i].y_mm = fallen;
            if fallen > self.half_height_mm {
                let (x_mm, z_mm) = self.entry();
                let y_mm = (fallen + self.half_height_mm) % height - self.half_height_mm;
                self.drops[i] = Drop { x_mm, y_mm, z_mm, ..self.drops[i] };
            }
        }
    }

    /// Share of each LED's light that the drops leave on both paths, 32 x 32, row-major.
    #[must_use]
    pub fn kept(&self) -> Vec<f32> {
        self.left(Ways::Both)
    }

    /// Share of each spot's light that the drops leave on the path back, 32 x 32, row-major, for a
    /// camera without LEDs.
    #[must_use]
    pub fn seen(&self) -> Vec<f32> {
        self.left(Ways::Back)
    }

    fn left(&self, ways: Ways) -> Vec<f32> {
        let mut kept = vec![1.0; LEDS];
        for drop in &self.drops {
            self.beams.shade(drop, ways, &mut kept);
        }
        kept
    }

    /// Number of drops in the air around the beams.
    #[must_use]
    pub fn count(&self) -> usize {
        self.drops.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn discs_share_what_geometry_says() {
        assert_eq!(common_area(3.0, 1.0, 2.0), 0.0);
        assert!((common_area(0.5, 1.0, 2.0) - PI).abs() < 1e-12);
        // Two unit discs a radius apart: 2 pi / 3 - sqrt(3) / 2.
        let lens = 2.0 * PI / 3.0 - 3_f64.sqrt() / 2.0;
        assert!((common_area(1.0, 1.0, 1.0) - lens).abs() < 1e-12);
    }

    fn beams() -> BeamShadows {
        let projector = Projector::default();
        BeamShadows { projector, distance_mm: 300.0, baseline_mm: 40.0, collector_mm: 1.66 }
    }

    #[test]
    fn a_drop_before_the_target_darkens_the_leds_it_stands_before_and_no_others() {
        let beams = beams();
        // At 299 mm an LED's beam is 1 mm wide every 1.5 mm. LED (10, 20) aims at ((20 - 15.5) 1.5,
        // (10 - 15.5) 1.5).
        let drop =
            Drop { x_mm: 6.73, y_mm: -8.22, z_mm: 299.0, radius_mm: 0.7, speed_mm_per_s: 0.0 };
        let mut kept = vec![1.0; LEDS];
        beams.shade(&drop, Ways::Both, &mut kept);
        assert!(kept[10 * SIDE + 20] < 0.1, "{}", kept[10 * SIDE + 20]);
        assert_eq!(kept.iter().filter(|&&k| k < 1.0).count(), 1);
    }
}
