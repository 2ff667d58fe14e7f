//! Eye and skin safety: the limits for infrared light, and the camera's irradiance.
//!
//! The limits are those of ICNIRP (*Guidelines on limits of exposure to incoherent visible and
//! infrared radiation*, Health Phys. 105, 74, 2013) and IEC 62471:
//!
//! | part | wavelengths | exposure of t seconds | limit in W/m^2 |
//! | -- | -- | -- | -- |
//! | cornea and lens | 780 to 3000 nm | below 1000 s | `18 000 t^-0.75` |
//! | cornea and lens | 780 to 3000 nm | 1000 s and longer | 100 |
//! | skin | 380 nm to 1 mm | below 10 s | `20 000 t^-0.75` |
//!
//! For skin and longer exposures there is no limit: pain comes before damage.
//!
//! A risk group of IEC 62471 ([`RiskGroup`]) says for how long the eye's limit is not reached at 0.2 m: 1000, 100 or 10 s.
//!
//! From 1400 nm on the retina gets nothing, because the water of the eye absorbs the light. Below 1400 nm the retina has
//! limits of its own (thermal; blue light below 700 nm), which depend on radiance and on the size of the source. These are
//! not implemented, so a camera of such a wavelength is refused: [`OutsideTheLimits`].
//!
//! The result is computed from a description, and is neither a measurement nor a certificate.

use crate::{CameraModel, LEDS, SIDE};
use serde::Serialize;
use std::f64::consts::{FRAC_PI_4, PI};
use std::fmt::{self, Display};
use thiserror::Error;

/// Allowed irradiance of the eye for 1000 s and longer, in W/m^2.
pub const LONG_EXPOSURE_LIMIT_W_PER_M2: f64 = 100.0;

/// Factor of the eye's limit for exposures below 1000 s, in W/m^2 s^0.75.
const EYE: f64 = 18_000.0;
/// Factor of the skin's limit, in W/m^2 s^0.75.
const SKIN: f64 = 20_000.0;
/// Longest exposure for which the skin has a limit, in s.
const SKIN_LONGEST_S: f64 = 10.0;

/// Shortest and longest wavelength of the limits above that leave out no part of the eye, in nm.
pub const WAVELENGTHS_NM: std::ops::RangeInclusive<f64> = 1400.0..=3000.0;

/// A wavelength whose limits are not implemented.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error(
    "no eye limits for a wavelength of {wavelength_nm} nm, expected {first} to {last}: below {first} nm light reaches the \
     retina, and nirspi does not have the retina's limits (thermal and blue light, ICNIRP 2013). Ask a laser safety officer",
    first = WAVELENGTHS_NM.start(), last = WAVELENGTHS_NM.end()
)]
pub struct OutsideTheLimits {
    /// The camera's wavelength.
    pub wavelength_nm: f64,
}

/// Distance at which IEC 62471 assesses a lamp, in mm.
const JUDGED_AT_MM: f64 = 200.0;

/// The largest share of the LEDs that a sweep lights on average.
const LIT_SHARE: f64 = 0.5;

/// Allowed irradiance of the eye for an exposure of this time, in W/m^2.
#[must_use]
pub fn eye_limit_w_per_m2(exposure_s: f64) -> f64 {
    (EYE * exposure_s.powf(-0.75)).max(LONG_EXPOSURE_LIMIT_W_PER_M2)
}

/// Longest exposure of the eye to this irradiance; `None` means unlimited.
#[must_use]
pub fn longest_for_eyes_s(w_per_m2: f64) -> Option<f64> {
    (w_per_m2 > LONG_EXPOSURE_LIMIT_W_PER_M2).then(|| (EYE / w_per_m2).powf(4.0 / 3.0))
}

/// Longest exposure of the skin to this irradiance; `None` means that the limits name none.
#[must_use]
pub fn longest_for_skin_s(w_per_m2: f64) -> Option<f64> {
    let longest = (SKIN / w_per_m2).powf(4.0 / 3.0);
    (longest < SKIN_LONGEST_S).then_some(longest)
}

/// The risk group of IEC 62471 (6.1) for the hazard of infrared light to cornea and lens. At wavelengths of
/// [`WAVELENGTHS_NM`] no other hazard of the standard has a group.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RiskGroup {
    /// The limit is not reached within 1000 s, at which it is that of all longer times.
    Exempt,
    /// Not within 100 s.
    Low,
    /// Not within 10 s.
    Moderate,
    /// Within 10 s.
    High,
}

/// The most irradiance of each group, in W/m^2 (IEC 62471, table 6).
const GROUPS: [(RiskGroup, f64); 3] =
    [(RiskGroup::Exempt, 100.0), (RiskGroup::Low, 570.0), (RiskGroup::Moderate, 3_200.0)];

impl RiskGroup {
    /// The group of a lamp with this irradiance at 0.2 m.
    #[must_use]
    pub fn of(w_per_m2_at_200_mm: f64) -> Self {
        let found = GROUPS.iter().find(|(_, most)| w_per_m2_at_200_mm <= *most);
        found.map_or(Self::High, |(group, _)| *group)
    }
}

/// As the standard names it.
impl Display for RiskGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Exempt => "exempt group",
            Self::Low => "risk group 1 (low risk)",
            Self::Moderate => "risk group 2 (moderate risk)",
            Self::High => "risk group 3 (high risk)",
        })
    }
}

/// The light of a camera at the places where eye and skin may be.
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
    /// Irradiance at the surface of the bare array.
    pub at_array_w_per_m2: f64,
    /// Irradiance 0.2 m in front of the bare array, on its axis.
    pub before_array_w_per_m2: f64,
    /// The limit for long exposures.
    pub limit_w_per_m2: f64,
    /// Longest exposure at the lens; `null` means unlimited.
    pub longest_at_lens_s: Option<f64>,
}

impl EyeSafety {
    /// The light of this camera, averaged over a sweep: half of the LEDs are lit.
    ///
    /// # Errors
    /// [`OutsideTheLimits`].
    pub fn of(camera: &CameraModel) -> Result<Self, OutsideTheLimits> {
        Self::with_lit(camera, LIT_SHARE)
    }

    /// The light of this camera with this share of its LEDs lit, 0 to 1.
    ///
    /// # Errors
    /// [`OutsideTheLimits`].
    pub fn with_lit(camera: &CameraModel, lit_share: f64) -> Result<Self, OutsideTheLimits> {
        let wavelength_nm = camera.wavelength_nm;
        if !WAVELENGTHS_NM.contains(&wavelength_nm) {
            return Err(OutsideTheLimits { wavelength_nm });
        }
        let (settings, lens) = (camera.budget_settings(), camera.projector());
        let array_mw = LEDS as f64 * lit_share * settings.led_power_mw;
        let through_lens_mw = array_mw * settings.projected_fraction(&lens);
        let disc = |mm: f64| FRAC_PI_4 * mm * mm;
        // At a distance the beam is the field convolved with the disc of defocus. Its maximum is as
        // if the light covered the larger of the two. 1 mW/mm^2 is 1000 W/m^2.
        let (field, blur) = (lens.field_mm(JUDGED_AT_MM), lens.blur_mm(JUDGED_AT_MM));
        let at_200_mm_w_per_m2 = 1e3 * through_lens_mw / (field * field).max(disc(blur));
        let at_lens_w_per_m2 = 1e3 * through_lens_mw / disc(lens.aperture_mm);
        let side_mm = SIDE as f64 * lens.led_pitch_mm;
        let at_array_w_per_m2 = 1e3 * array_mw / (side_mm * side_mm);
        // Intensity on the axis of a source whose intensity goes with cos^m of the angle:
        // (m + 1) / (2 pi) of its power a steradian, as if all LEDs were in one place. A narrow
        // beam is no brighter than at the array's surface.
        let on_axis_mw_per_sr = array_mw * (settings.led_exponent() + 1.0) / (2.0 * PI);
        Ok(Self {
            through_lens_mw,
            at_lens_w_per_m2,
            at_200_mm_w_per_m2,
            array_mw,
            at_array_w_per_m2,
            before_array_w_per_m2: (1e3 * on_axis_mw_per_sr / (JUDGED_AT_MM * JUDGED_AT_MM))
                .min(at_array_w_per_m2),
            limit_w_per_m2: LONG_EXPOSURE_LIMIT_W_PER_M2,
            longest_at_lens_s: longest_for_eyes_s(at_lens_w_per_m2),
        })
    }
}

/// In one line.
impl Display for EyeSafety {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:.1} mW through the lens, {:.1} W/m2 at it and {:.1} W/m2 at 0.2 m; the limit for long exposures is {} W/m2 \
             (ICNIRP 2013, IEC 62471): ",
            self.through_lens_mw,
            self.at_lens_w_per_m2,
            self.at_200_mm_w_per_m2,
            self.limit_w_per_m2,
        )?;
        match self.longest_at_lens_s {
            None => f.write_str("without end")?,
            Some(s) => write!(f, "for {:.0} minutes at the lens", s / 60.0)?,
        }
        write!(f, "; {:.0} mW leave the bare array. Computed, not measured", self.array_mw)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_camera_is_above_the_limit_at_the_lens_and_below_it_at_200_mm() {
        // By hand: 512 * 4 mW * 2.51 % = 51.4 mW; over pi/4 (20 mm)^2 163 W/m^2, over (32 mm)^2 50
        // W/m^2.
        let paper = EyeSafety::of(CameraModel::paper()).unwrap();
        assert!((paper.at_lens_w_per_m2 / 163.4 - 1.0).abs() < 0.01, "{paper:?}");
        assert!((paper.at_200_mm_w_per_m2 / 50.1 - 1.0).abs() < 0.01, "{paper:?}");
        // (18 000 / 163.4)^(4/3) = 528 s.
        assert!((paper.longest_at_lens_s.unwrap() / 528.0 - 1.0).abs() < 0.02, "{paper:?}");
    }

    #[test]
    fn the_one_metre_camera_is_within_the_limit_everywhere() {
        let safety = EyeSafety::of(&CameraModel::named("one-metre").unwrap()).unwrap();
        let most = safety.at_lens_w_per_m2.max(safety.at_200_mm_w_per_m2);
        assert!(most <= safety.limit_w_per_m2, "{safety:?}");
        assert_eq!(safety.longest_at_lens_s, None);
    }

    #[test]
    fn the_limits_are_those_of_the_guideline() {
        // Table of ICNIRP 2013: 1 s, 10 s, 1000 s and longer.
        assert!((eye_limit_w_per_m2(1.0) / 18_000.0 - 1.0).abs() < 1e-12);
        assert!((eye_limit_w_per_m2(10.0) / 3_200.9 - 1.0).abs() < 1e-3);
        assert_eq!(eye_limit_w_per_m2(1e4), 100.0);
        for w_per_m2 in [101.0, 326.8, 28_444.0] {
            let longest = longest_for_eyes_s(w_per_m2).unwrap();
            assert!((eye_limit_w_per_m2(longest) / w_per_m2 - 1.0).abs() < 1e-9 || longest > 990.0);
        }
        assert_eq!(longest_for_eyes_s(100.0), None);
        // The skin: 20 000 J/m^2 t^0.25 in t seconds, that is 3557 W/m^2 for 10 s.
        assert_eq!(longest_for_skin_s(3_556.0), None);
        assert!((longest_for_skin_s(20_000.0).unwrap() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_risk_group_is_as_far_from_the_eyes_limit_as_the_standard_says() {
        for (seconds, group) in
            [(1_000.0, RiskGroup::Exempt), (100.0, RiskGroup::Low), (10.0, RiskGroup::Moderate)]
        {
            // The standard's table has two digits.
            let limit = eye_limit_w_per_m2(seconds);
            assert_eq!(RiskGroup::of(0.98 * limit), group, "{limit}");
            assert!(RiskGroup::of(1.02 * limit) > group, "{limit}");
        }
        assert_eq!(RiskGroup::of(0.0), RiskGroup::Exempt);
        assert_eq!(RiskGroup::of(1e6).to_string(), "risk group 3 (high risk)");
    }

    #[test]
    fn the_bare_array_is_as_bright_as_by_hand() {
        // 1024 * 4 mW over (32 * 3 mm)^2. A beam of 5 degrees is 35 mm wide at 0.2 m, less than the
        // array: it is as bright there as at the surface.
        let all = EyeSafety::with_lit(CameraModel::paper(), 1.0).unwrap();
        assert!((all.at_array_w_per_m2 / 444.4 - 1.0).abs() < 1e-3, "{all:?}");
        assert_eq!(all.before_array_w_per_m2, all.at_array_w_per_m2);
        let half = EyeSafety::of(CameraModel::paper()).unwrap();
        assert!((all.at_lens_w_per_m2 / half.at_lens_w_per_m2 - 2.0).abs() < 1e-12);
        // 60 degrees are an intensity like the cosine: P / pi a steradian, 4.096 W over 0.04 m^2.
        let chips = EyeSafety::with_lit(&CameraModel::named("one-metre").unwrap(), 1.0).unwrap();
        assert!((chips.before_array_w_per_m2 / 32.6 - 1.0).abs() < 1e-3, "{chips:?}");
        assert!((chips.at_array_w_per_m2 / 28_444.0 - 1.0).abs() < 1e-3, "{chips:?}");
    }

    #[test]
    fn a_wavelength_that_reaches_the_retina_is_refused() {
        for wavelength_nm in [450.0, 550.0, 850.0, 940.0, 1399.9] {
            let camera = CameraModel { wavelength_nm, ..CameraModel::paper().clone() };
            assert_eq!(EyeSafety::of(&camera), Err(OutsideTheLimits { wavelength_nm }));
        }
        for wavelength_nm in [1400.0, 1550.0, 1700.0] {
            let camera = CameraModel { wavelength_nm, ..CameraModel::paper().clone() };
            assert!(EyeSafety::of(&camera).is_ok(), "{wavelength_nm}");
        }
    }
}
