//! The photon budget: from watts, apertures and distance to electrons per ADC sample.
//!
//! # Invariant
//! **A detector cannot collect more than its etendue**
//! (`tests::a_larger_collector_helps_only_until_the_detector_is_full`). A collector of area A that
//! sees the field's solid angle W needs a detector of area at least `A W / (pi NA^2)`. With a
//! smaller detector, the smaller area counts. For the paper's FGA015 (0.15 mm) behind a collector
//! that sees the whole field, the detector and not the lens limits the light.
//!
//! # Formulas
//!
//! One LED on a white target, one sample: `P_LED * projected * A / (pi D^2) * F T * QE * t / (h c /
//! lambda)`, with a Lambertian target facing the camera, so that its on-axis radiance is `rho / pi`
//! times its irradiance. F is the share of the LED's spectrum that the filter passes, T that of the
//! glass.
//!
//! Daylight takes the same path back: `E * rho / pi * A W * T * QE * t / (h c / lambda)`, with E
//! the irradiance within the filter. The LED's spectral loss does not apply to daylight. The
//! detector's field of view is assumed to be the projected field, the smallest field of view that
//! loses no light.

use std::f64::consts::PI;

use thiserror::Error;

use crate::daylight::DaylightError;
use crate::lamp::LightSource;
use crate::{LEDS, Projector, ProjectorError};

/// Planck constant in J s (SI, exact).
const PLANCK_J_S: f64 = 6.626_070_15e-34;

/// Speed of light in m/s (SI, exact).
const LIGHT_M_PER_S: f64 = 299_792_458.0;

/// Why a budget cannot be computed.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum BudgetError {
    /// A setting is outside its physical range.
    #[error("photon budget: {name} is {value}, expected {expected}")]
    Setting {
        /// The setting.
        name: &'static str,
        /// The value found.
        value: f64,
        /// The allowed values.
        expected: &'static str,
    },
    /// The projector or the distance is not physical.
    #[error(transparent)]
    Projector(#[from] ProjectorError),
    /// The spectrum of daylight is not known within the filter.
    #[error(transparent)]
    Daylight(#[from] DaylightError),
}

/// The settings of the photon budget: a part of a [`CameraModel`](crate::CameraModel). The default
/// is the paper's camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BudgetSettings {
    /// Optical power of one lit LED, in mW.
    pub led_power_mw: f64,
    /// Angle off the LED's axis at which its radiant intensity has halved, in degrees. A field lens
    /// on the array points every LED at the projection lens.
    pub led_half_angle_deg: f64,
    /// Width of the LED's spectrum at half height, in nm; Gaussian.
    pub led_spectrum_nm: f64,
    /// Wavelength, in nm.
    pub wavelength_nm: f64,
    /// Diameter of the collecting optics, in mm. A small detector uses only part of this diameter.
    pub collector_aperture_mm: f64,
    /// Diameter of the detector's active area, in mm.
    pub detector_diameter_mm: f64,
    /// Numerical aperture of the light on the detector. 1 is a compound parabolic concentrator; an
    /// aspheric lens reaches about 0.6, and 0.36 times the light.
    pub detector_na: f64,
    /// Share of the light that the glass from LED to detector transmits.
    pub glass_transmission: f64,
    /// Light that a cover glass before the camera throws back into the collector, divided by that of a white target in
    /// the lens's focus.
    pub cover_veil: f64,
    /// Electrons per photon.
    pub quantum_efficiency: f64,
    /// Time of one ADC sample, in ns.
    pub sample_ns: f64,
    /// The source of the light on the target besides the LEDs.
    pub light: LightSource,
    /// Illuminance on the target, in klx.
    pub ambient_klx: f64,
    /// Width of the collector's band-pass filter around the wavelength, in nm.
    pub filter_width_nm: f64,
}

/// Energy of a photon, in J.
#[must_use]
pub fn photon_j(wavelength_nm: f64) -> f64 {
    PLANCK_J_S * LIGHT_M_PER_S / (wavelength_nm * 1e-9)
}

impl BudgetSettings {
    fn validate(&self) -> Result<(), BudgetError> {
        let positive = [
            ("wavelength_nm", self.wavelength_nm),
            ("led_spectrum_nm", self.led_spectrum_nm),
            ("collector_aperture_mm", self.collector_aperture_mm),
            ("detector_diameter_mm", self.detector_diameter_mm),
            ("sample_ns", self.sample_ns),
        ];
        for (name, value) in positive {
            ensure(value.is_finite() && value > 0.0, name, value, "more than 0")?;
        }
        let not_negative = [
            ("led_power_mw", self.led_power_mw),
            ("ambient_klx", self.ambient_klx),
            ("filter_width_nm", self.filter_width_nm),
            ("cover_veil", self.cover_veil),
        ];
        for (name, value) in not_negative {
            ensure(value.is_finite() && value >= 0.0, name, value, "0 or more")?;
        }
        let fractions = [
            ("detector_na", self.detector_na),
            ("glass_transmission", self.glass_transmission),
            ("quantum_efficiency", self.quantum_efficiency),
        ];
        for (name, value) in fractions {
            ensure(value > 0.0 && value <= 1.0, name, value, "more than 0 and at most 1")?;
        }
        let angle = self.led_half_angle_deg;
        let expected = "0.1 to 60 (a Lambertian LED)";
        ensure((0.1..=60.0).contains(&angle), "led_half_angle_deg", angle, expected)
    }

    /// Electrons in one sample for one watt within the filter on the collector.
    fn electrons_per_watt(&self) -> f64 {
        self.glass_transmission * self.quantum_efficiency * self.sample_ns * 1e-9
            / photon_j(self.wavelength_nm)
    }

    /// Share of the LED's spectrum that the filter passes: `erf(sqrt(ln 2) W / FWHM)` of a
    /// Gaussian.
    #[must_use]
    pub fn filtered_fraction(&self) -> f64 {
        erf(2.0_f64.ln().sqrt() * self.filter_width_nm / self.led_spectrum_nm)
    }

    /// The exponent m of an LED whose intensity goes with cos^m of the angle to its axis.
    #[must_use]
    pub fn led_exponent(&self) -> f64 {
        0.5_f64.ln() / self.led_half_angle_deg.to_radians().cos().ln()
    }

    /// Part of an LED's light that enters the projection lens: for an intensity cos^m of the angle,
    /// `1 - cos^(m+1)` of the angle of the lens's edge.
    #[must_use]
    pub fn projected_fraction(&self, projector: &Projector) -> f64 {
        let edge = (projector.aperture_mm / 2.0 / projector.array_distance_mm()).atan();
        1.0 - edge.cos().powf(self.led_exponent() + 1.0)
    }
}

/// The error function of `x`, which must be at least 0, by its series (Abramowitz and Stegun,
/// 7.1.6), to rounding.
fn erf(x: f64) -> f64 {
    if x > 6.0 {
        return 1.0;
    }
    let (mut term, mut sum, mut n) = (x, x, 0.0);
    while term > 1e-17 * sum {
        n += 1.0;
        term *= 2.0 * x * x / (2.0 * n + 1.0);
        sum += term;
    }
    2.0 / PI.sqrt() * (-x * x).exp() * sum
}

fn ensure(
    holds: bool,
    name: &'static str,
    value: f64,
    expected: &'static str,
) -> Result<(), BudgetError> {
    if holds { Ok(()) } else { Err(BudgetError::Setting { name, value, expected }) }
}

/// Electrons per ADC sample at one distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Budget {
    /// From one lit LED whose whole spot falls on a target of reflectance 1.
    pub electrons_per_led: f64,
    /// From one lit LED by way of the cover glass, without having seen the target: the same at every distance.
    pub cover_electrons_per_led: f64,
    /// From daylight on a field of reflectance 1.
    pub ambient_electrons_white: f64,
    /// Effective diameter of the collector, in mm: its own diameter, or the diameter that the
    /// detector's etendue allows.
    pub effective_collector_mm: f64,
    /// The factors of the budget.
    pub terms: BudgetTerms,
}

/// The factors of a [`Budget`], in the order of the light's path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BudgetTerms {
    /// Light of one LED, in mW.
    pub led_power_mw: f64,
    /// Part of the LED's light that enters the projection lens.
    pub projected: f64,
    /// Part of a white target's light that the collector takes: its area over `pi D^2`.
    pub collected: f64,
    /// Part of the LED's spectrum that the filter passes.
    pub filtered: f64,
    /// Part of the light within the filter that the glass transmits.
    pub glass: f64,
    /// Energy of a photon, in J.
    pub photon_j: f64,
    /// Electrons per photon.
    pub quantum_efficiency: f64,
    /// Time of a sample, in ns.
    pub sample_ns: f64,
    /// Daylight on the target within the filter, in W/m^2.
    pub daylight_w_per_m2: f64,
    /// Solid angle of the field, in sr.
    pub field_sr: f64,
}

impl Budget {
    /// The budget of a target at `distance_mm`.
    ///
    /// # Errors
    /// [`BudgetError`] naming the setting, projector length or distance that is not physical.
    pub fn new(
        settings: &BudgetSettings,
        projector: &Projector,
        distance_mm: f64,
    ) -> Result<Self, BudgetError> {
        settings.validate()?;
        projector.validate()?;
        let expected = "a positive length";
        let reachable = distance_mm.is_finite() && distance_mm > 0.0;
        ensure(reachable, "distance_mm", distance_mm, expected)?;

        let field_sr = (projector.field_mm(distance_mm) / distance_mm).powi(2);
        let effective_collector_mm = settings
            .collector_aperture_mm
            .min(settings.detector_diameter_mm * settings.detector_na * (PI / field_sr).sqrt());
        let area_m2 = PI / 4.0 * (effective_collector_mm * 1e-3).powi(2);

        let on_target_w = settings.led_power_mw * 1e-3 * settings.projected_fraction(projector);
        let collected = area_m2 / (PI * (distance_mm * 1e-3).powi(2));
        let (nm, width_nm) = (settings.wavelength_nm, settings.filter_width_nm);
        let klx = settings.ambient_klx;
        let daylight_w_per_m2 = settings.light.irradiance_w_per_m2(klx, nm, width_nm)?;
        let filtered = settings.filtered_fraction();
        let electrons_per_led = on_target_w * collected * filtered * settings.electrons_per_watt();
        let of_focus = (distance_mm / projector.focus_distance_mm).powi(2);
        Ok(Self {
            electrons_per_led,
            cover_electrons_per_led: settings.cover_veil * electrons_per_led * of_focus,
            ambient_electrons_white: daylight_w_per_m2 / PI
                * area_m2
                * field_sr
                * settings.electrons_per_watt(),
            effective_collector_mm,
            terms: BudgetTerms {
                led_power_mw: settings.led_power_mw,
                projected: settings.projected_fraction(projector),
                collected,
                filtered,
                glass: settings.glass_transmission,
                photon_j: photon_j(nm),
                quantum_efficiency: settings.quantum_efficiency,
                sample_ns: settings.sample_ns,
                daylight_w_per_m2,
                field_sr,
            },
        })
    }

    /// Daylight on the detector from a white field, in W, of this irradiance within the filter.
    #[must_use]
    pub fn daylight_on_detector_w(&self, irradiance_w_per_m2: f64) -> f64 {
        let area_m2 = PI / 4.0 * (self.effective_collector_mm * 1e-3).powi(2);
        irradiance_w_per_m2 / PI * area_m2 * self.terms.field_sr * self.terms.glass
    }

    /// Daylight from a field of this mean reflectance ([`crate::Footprint::mean`]), in electrons
    /// per sample.
    #[must_use]
    pub fn ambient_electrons(&self, mean_reflectance: f64) -> f64 {
        self.ambient_electrons_white * mean_reflectance
    }

    /// The brightest possible light: all LEDs and daylight on a white target, and the cover glass, in
    /// electrons per sample.
    #[must_use]
    pub fn brightest_electrons(&self) -> f64 {
        let of_a_led = self.electrons_per_led + self.cover_electrons_per_led;
        of_a_led * LEDS as f64 + self.ambient_electrons_white
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(distance_mm: f64, settings: BudgetSettings) -> Budget {
        Budget::new(&settings, &Projector::default(), distance_mm).unwrap()
    }

    fn assert_close(found: f64, expected: f64) {
        assert!((found / expected - 1.0).abs() < 1e-9, "{found} against {expected}");
    }

    #[test]
    fn led_light_falls_with_the_square_of_the_distance_and_daylight_does_not() {
        let (near, far) = (at(300.0, Default::default()), at(900.0, Default::default()));
        assert_close(near.electrons_per_led, 9.0 * far.electrons_per_led);
        assert_close(near.ambient_electrons_white, far.ambient_electrons_white);
    }

    #[test]
    fn the_veil_of_a_cover_glass_is_the_same_at_every_distance() {
        let veiled =
            |distance_mm| at(distance_mm, BudgetSettings { cover_veil: 0.2, ..Default::default() });
        let (focus, far) = (veiled(Projector::default().focus_distance_mm), veiled(900.0));
        assert_close(focus.cover_electrons_per_led, 0.2 * focus.electrons_per_led);
        assert_close(far.cover_electrons_per_led, focus.cover_electrons_per_led);
        let without = at(900.0, Default::default()).brightest_electrons();
        let more = far.brightest_electrons() - without;
        assert_close(more, 1024.0 * far.cover_electrons_per_led);
    }

    #[test]
    fn light_is_proportional_to_power_and_daylight_to_illuminance() {
        let one = at(300.0, Default::default());
        let brighter = at(
            300.0,
            BudgetSettings { led_power_mw: 8.0, ambient_klx: 45.0, ..Default::default() },
        );
        assert_close(brighter.electrons_per_led, 2.0 * one.electrons_per_led);
        assert_close(brighter.ambient_electrons_white, 3.0 * one.ambient_electrons_white);
    }

    #[test]
    fn a_larger_collector_helps_only_until_the_detector_is_full() {
        let with = |collector_aperture_mm, detector_diameter_mm| {
            let settings = BudgetSettings {
                collector_aperture_mm,
                detector_diameter_mm,
                ..Default::default()
            };
            at(300.0, settings)
        };
        assert_close(with(1.0, 0.15).electrons_per_led * 2.25, with(1.5, 0.15).electrons_per_led);
        assert_close(with(25.0, 0.15).electrons_per_led, with(50.0, 0.15).electrons_per_led);
        assert_close(with(25.0, 0.15).electrons_per_led * 4.0, with(25.0, 0.3).electrons_per_led);
        // 0.15 mm * sqrt(pi) / 0.16 rad
        assert_close(with(25.0, 0.15).effective_collector_mm, 0.15 * PI.sqrt() / 0.16);
    }

    #[test]
    fn a_narrower_filter_costs_the_led_its_flanks_and_daylight_its_width() {
        let with =
            |filter_width_nm| at(300.0, BudgetSettings { filter_width_nm, ..Default::default() });
        let share = with(50.0).electrons_per_led / with(100.0).electrons_per_led;
        // erf(0.41628) = 0.44394 and erf(0.83255) = 0.76096 (tables).
        assert!((share - 0.44394 / 0.76096).abs() < 1e-4, "{share}");
        let daylight = with(50.0).ambient_electrons_white / with(100.0).ambient_electrons_white;
        assert!((0.45..0.55).contains(&daylight), "{daylight}");
        assert!((with(1e3 - 800.0).terms.filtered - 0.98140).abs() < 1e-3);
    }

    #[test]
    fn a_lambertian_led_sends_the_sine_squared_of_the_edge_angle_into_the_lens() {
        let settings = BudgetSettings { led_half_angle_deg: 60.0, ..Default::default() };
        let edge = (10.0_f64 / 600.0).atan();
        assert_close(settings.projected_fraction(&Projector::default()), edge.sin().powi(2));
    }

    #[test]
    fn the_default_budget_agrees_with_one_worked_by_hand() {
        // P 4 mW; m = ln 0.5 / ln cos 5 deg = 181.81; edge atan(1/60): 2.5067 % projected; A = pi/4
        // (1.6617 mm)^2 = 2.1686 mm^2; A / pi D^2 = 7.670e-6; filter 0.7610, glass 0.79, QE 0.9:
        // 0.5411; 8 ns / 0.80 eV (1.2816e-19 J) = 6.2423e10 per W.
        let budget = at(300.0, Default::default());
        assert!((budget.electrons_per_led / 25.98 - 1.0).abs() < 1e-3, "{budget:?}");
        // 15 klx / 109.6 klx * 25.536 W/m^2 = 3.4949 W/m^2; / pi * A * 0.0256 sr = 6.1761e-8 W;
        // glass and QE 0.711.
        assert!((budget.ambient_electrons_white / 2741.1 - 1.0).abs() < 1e-3, "{budget:?}");
        let on_detector_w = budget.daylight_on_detector_w(budget.terms.daylight_w_per_m2);
        assert!((on_detector_w / (0.79 * 6.1761e-8) - 1.0).abs() < 1e-3, "{on_detector_w}");
    }

    #[test]
    fn settings_that_are_not_physical_are_named() {
        let default = BudgetSettings::default();
        let dark = BudgetSettings { wavelength_nm: 2500.0, ..default };
        let error = Budget::new(&dark, &Projector::default(), 300.0).unwrap_err().to_string();
        assert!(
            error.contains("2450 to 2550 nm, expected wavelengths within 400 to 1700"),
            "{error}"
        );
        let cases = [
            ("led_power_mw", BudgetSettings { led_power_mw: -1.0, ..default }),
            ("led_half_angle_deg", BudgetSettings { led_half_angle_deg: 0.0, ..default }),
            ("wavelength_nm", BudgetSettings { wavelength_nm: f64::NAN, ..default }),
            ("collector_aperture_mm", BudgetSettings { collector_aperture_mm: 0.0, ..default }),
            ("detector_diameter_mm", BudgetSettings { detector_diameter_mm: -0.1, ..default }),
            ("detector_na", BudgetSettings { detector_na: 1.1, ..default }),
            ("led_spectrum_nm", BudgetSettings { led_spectrum_nm: 0.0, ..default }),
            ("glass_transmission", BudgetSettings { glass_transmission: 2.0, ..default }),
            ("quantum_efficiency", BudgetSettings { quantum_efficiency: 0.0, ..default }),
            ("sample_ns", BudgetSettings { sample_ns: f64::INFINITY, ..default }),
            ("cover_veil", BudgetSettings { cover_veil: -0.1, ..default }),
            ("ambient_klx", BudgetSettings { ambient_klx: f64::NAN, ..default }),
            ("filter_width_nm", BudgetSettings { filter_width_nm: -1.0, ..default }),
        ];
        for (field, settings) in cases {
            let error = Budget::new(&settings, &Projector::default(), 300.0).unwrap_err();
            assert!(matches!(error, BudgetError::Setting { name, .. } if name == field), "{error}");
        }
        assert!(Budget::new(&default, &Projector::default(), 0.0).is_err());
        let flat = Projector { aperture_mm: 0.0, ..Default::default() };
        assert!(matches!(
            Budget::new(&default, &flat, 300.0),
            Err(BudgetError::Projector(ProjectorError::Length { name: "aperture_mm", .. }))
        ));
    }
}
