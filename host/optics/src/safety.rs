//! Eye safety: the infrared limit for cornea and lens, and the camera's irradiance.
//!
//! The limit is that of ICNIRP (*Guidelines on limits of exposure to incoherent visible and
//! infrared radiation*, Health Phys. 105, 74, 2013) and IEC 62471 for 780 to 3000 nm: 100 W/m^2 for
//! 1000 s and longer, `18 000 t^-0.75` W/m^2 for shorter exposures of t seconds. Half of the LEDs
//! are lit on average over a sweep.
//!
//! The result is computed from a description, and is neither a measurement nor a certificate.

use crate::{CameraModel, LEDS};
use serde::Serialize;
use std::f64::consts::FRAC_PI_4;

/// Allowed irradiance of the eye for 1000 s and longer, in W/m^2.
pub const LONG_EXPOSURE_LIMIT_W_PER_M2: f64 = 100.0;

/// Distance at which IEC 62471 assesses a lamp, in mm.
const JUDGED_AT_MM: f64 = 200.0;

/// The light at an eye in front of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EyeSafety {
    /// Light from the projection lens, averaged over a sweep.
    pub through_lens_mw: f64,
    /// Irradiance at the lens.
    pub at_lens_w_per_m2: f64,
    /// Irradiance 0.2 m in front of the lens.
    pub at_200_mm_w_per_m2: f64,
    /// Light from the bare array, for an eye in front of a camera without its lens.
    pub array_mw: f64,
    /// The limit for long exposures.
    pub limit_w_per_m2: f64,
    /// Longest exposure at the lens; `null` means unlimited.
    pub longest_at_lens_s: Option<f64>,
}

impl EyeSafety {
    /// The light at an eye in front of this camera.
    #[must_use]
    pub fn of(camera: &CameraModel) -> Self {
        let (settings, lens) = (camera.budget_settings(), camera.projector());
        let array_mw = LEDS as f64 / 2.0 * settings.led_power_mw;
        let through_lens_mw = array_mw * settings.projected_fraction(&lens);
        let disc = |mm: f64| FRAC_PI_4 * mm * mm;
        // At a distance the beam is the field convolved with the disc of defocus. Its maximum is as
        // if the light covered the larger of the two. 1 mW/mm^2 is 1000 W/m^2.
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

    /// Whether an eye may stay at the lens without a time limit.
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
        // By hand: 512 * 4 mW * 2.51 % = 51.4 mW; over pi/4 (20 mm)^2 163 W/m^2, over (32 mm)^2 50
        // W/m^2.
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
