//! Is the light safe for eyes? The infrared limit for cornea and lens, and what the camera sends.
//!
//! The limit is that of ICNIRP (*Guidelines on limits of exposure to incoherent visible and infrared radiation*, Health
//! Phys. 105, 74, 2013) and IEC 62471 for 780 to 3000 nm: 100 W/m^2 for 1000 s and longer, `18 000 t^-0.75` W/m^2 for
//! shorter exposures of t seconds. Half of the LEDs are lit on average over a sweep.
//!
//! This is a computation about a description, no measurement and no certificate.

use crate::{CameraModel, LEDS};
use serde::Serialize;
use std::f64::consts::FRAC_PI_4;

/// Irradiance of the eye that is allowed for 1000 s and longer, in W/m^2.
pub const LONG_EXPOSURE_LIMIT_W_PER_M2: f64 = 100.0;

/// Distance at which IEC 62471 judges a lamp, in mm.
const JUDGED_AT_MM: f64 = 200.0;

/// What an eye before the camera receives.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EyeSafety {
    /// Light that leaves the projection lens, on average over a sweep.
    pub through_lens_mw: f64,
    /// Irradiance of an eye at the lens.
    pub at_lens_w_per_m2: f64,
    /// Irradiance of an eye 0.2 m before the lens.
    pub at_200_mm_w_per_m2: f64,
    /// Light that leaves the bare array: what an eye may meet with the lens taken off.
    pub array_mw: f64,
    /// The limit for long exposures.
    pub limit_w_per_m2: f64,
    /// Longest exposure at the lens; `null`: without end.
    pub longest_at_lens_s: Option<f64>,
}

impl EyeSafety {
    /// The exposure of an eye before this camera.
    #[must_use]
    pub fn of(camera: &CameraModel) -> Self {
        let (settings, lens) = (camera.budget_settings(), camera.projector());
        let array_mw = LEDS as f64 / 2.0 * settings.led_power_mw;
        let through_lens_mw = array_mw * settings.projected_fraction(&lens);
        let disc = |mm: f64| FRAC_PI_4 * mm * mm;
        // At a distance the beam is the field convolved with the disc of defocus: at its brightest as if spread over the
        // larger of the two. 1 mW/mm^2 is 1000 W/m^2.
        let (field, blur) = (lens.field_mm(JUDGED_AT_MM), lens.blur_mm(JUDGED_AT_MM));
        let at_200_mm_w_per_m2 = 1e3 * through_lens_mw / (field * field).max(disc(blur));
        let at_lens_w_per_m2 = 1e3 * through_lens_mw / disc(lens.aperture_mm);
        let limit_w_per_m2 = LONG_EXPOSURE_LIMIT_W_PER_M2;
        let longest_at_lens_s = (at_lens_w_per_m2 > limit_w_per_m2)
            .then(|| (18_000.0 / at_lens_w_per_m2).powf(4.0 / 3.0));
        Self {
            through_lens_mw,
            at_lens_w_per_m2,
            at_200_mm_w_per_m2,
            array_mw,
            limit_w_per_m2,
            longest_at_lens_s,
        }
    }

    /// Whether an eye may stay at the lens without end.
    #[must_use]
    pub fn is_within_the_limit(&self) -> bool {
        self.at_lens_w_per_m2.max(self.at_200_mm_w_per_m2) <= self.limit_w_per_m2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_camera_is_above_the_limit_at_the_lens_and_below_it_at_200_mm() {
        // By hand: 512 * 4 mW * 2.51 % = 51.4 mW; over pi/4 (20 mm)^2 163 W/m^2, over (32 mm)^2 50 W/m^2.
        let paper = EyeSafety::of(CameraModel::paper());
        assert!((paper.at_lens_w_per_m2 / 163.4 - 1.0).abs() < 0.01, "{paper:?}");
        assert!((paper.at_200_mm_w_per_m2 / 50.1 - 1.0).abs() < 0.01, "{paper:?}");
        assert!(!paper.is_within_the_limit());
        // (18 000 / 163.4)^(4/3) = 528 s.
        assert!((paper.longest_at_lens_s.unwrap() / 528.0 - 1.0).abs() < 0.02, "{paper:?}");
    }

    #[test]
    fn the_one_metre_camera_is_within_the_limit_everywhere() {
        let safety = EyeSafety::of(&CameraModel::named("one-metre").unwrap());
        assert!(safety.is_within_the_limit(), "{safety:?}");
        assert_eq!(safety.longest_at_lens_s, None);
    }
}
