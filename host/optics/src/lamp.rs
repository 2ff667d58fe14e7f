//! The source of the light on the target besides the LEDs: daylight, a halogen lamp or an LED lamp.
//!
//! At 1550 nm, the same illuminance means very different light. A halogen lamp has some ten times
//! the light of daylight, because most of its light is infrared. A white LED lamp has no light at
//! 1550 nm.

use crate::daylight::{self, DaylightError};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Temperature of a halogen lamp's filament: CIE standard illuminant A, in K.
const HALOGEN_K: f64 = 2856.0;

/// Second radiation constant `h c / k`, in nm K (SI).
const SECOND_RADIATION_NM_K: f64 = 1.438_776_877e7;

/// Lumen per watt at 555 nm (SI, exact at 540 THz).
const LUMEN_PER_WATT: f64 = 683.0;

/// The longest wavelength of a white LED lamp, in nm.
const LED_LAMP_ENDS_NM: f64 = 800.0;

/// A source of light other than the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LightSource {
    /// The sun and the sky: ASTM G173-03, global tilt.
    #[default]
    Daylight,
    /// A filament at 2856 K, as a black body.
    Halogen,
    /// White LEDs: no light beyond 800 nm.
    LedLamp,
}

impl LightSource {
    /// All sources.
    pub const ALL: [Self; 3] = [Self::Daylight, Self::Halogen, Self::LedLamp];

    /// `daylight`, `halogen` or `led-lamp`, as in a camera description.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Daylight => "daylight",
            Self::Halogen => "halogen",
            Self::LedLamp => "led-lamp",
        }
    }

    /// Irradiance in W/m^2 of `klx` of this light within a filter of `width_nm` around
    /// `wavelength_nm`.
    ///
    /// # Errors
    /// [`DaylightError`] for wavelengths at which the source's spectrum is not known: outside 400
    /// to 1700 nm, and for an LED lamp below 800 nm.
    pub fn irradiance_w_per_m2(
        self,
        klx: f64,
        wavelength_nm: f64,
        width_nm: f64,
    ) -> Result<f64, DaylightError> {
        let daylight = daylight::irradiance_w_per_m2(klx, wavelength_nm, width_nm)?;
        let (low_nm, high_nm) = (wavelength_nm - width_nm / 2.0, wavelength_nm + width_nm / 2.0);
        match self {
            Self::Daylight => Ok(daylight),
            Self::Halogen => Ok(halogen_w_per_m2(klx, low_nm, high_nm)),
            Self::LedLamp if low_nm >= LED_LAMP_ENDS_NM => Ok(0.0),
            Self::LedLamp => {
                Err(DaylightError { low_nm, high_nm, expected: "800 to 1700 nm for an LED lamp" })
            }
        }
    }
}

impl fmt::Display for LightSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A black body's light within a band, scaled to an illuminance.
fn halogen_w_per_m2(klx: f64, low_nm: f64, high_nm: f64) -> f64 {
    // The unit does not matter, because only ratios are used.
    let planck = |nm: f64| nm.powi(-5) / (SECOND_RADIATION_NM_K / (nm * HALOGEN_K)).exp_m1();
    let lumen = integral(360.0, 830.0, |nm| LUMEN_PER_WATT * luminosity(nm) * planck(nm));
    integral(low_nm, high_nm, planck) / lumen * klx * 1e3
}

/// Simpson's rule in 200 parts, for smooth curves.
fn integral(low: f64, high: f64, of: impl Fn(f64) -> f64) -> f64 {
    const PARTS: usize = 200;
    let step = (high - low) / PARTS as f64;
    let weight = |i: usize| match i {
        0 | PARTS => 1.0,
        i if i % 2 == 1 => 4.0,
        _ => 2.0,
    };
    (0..=PARTS).map(|i| weight(i) * of(low + step * i as f64)).sum::<f64>() * step / 3.0
}

/// The CIE 1931 luminosity function: the fit of Wyman, Sloan and Shirley (*Simple analytic
/// approximations to the CIE XYZ color matching functions*, JCGT 2(2), 2013).
#[must_use]
pub fn luminosity(nm: f64) -> f64 {
    let lobe = |mean: f64, below: f64, above: f64| {
        let t = (nm - mean) * if nm < mean { below } else { above };
        (-t * t / 2.0).exp()
    };
    0.821 * lobe(568.8, 0.0213, 0.0247) + 0.286 * lobe(530.9, 0.0613, 0.0322)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_halogen_lamp_has_ten_times_daylights_near_infrared() {
        let at = |source: LightSource| source.irradiance_w_per_m2(15.0, 1550.0, 100.0).unwrap();
        // A black body of 2856 K has 16.47 lm for each watt of all its light, and 4.472 % of it are
        // within 1500 to 1600 nm: 15 klx are 910.5 W/m^2 in all, 40.72 within the filter.
        assert!(
            (at(LightSource::Halogen) / 40.7 - 1.0).abs() < 0.02,
            "{}",
            at(LightSource::Halogen)
        );
        assert!((at(LightSource::Halogen) / at(LightSource::Daylight) - 11.6).abs() < 0.3);
        assert_eq!(at(LightSource::LedLamp), 0.0);
    }

    #[test]
    fn an_led_lamps_visible_light_is_not_known() {
        let error = LightSource::LedLamp.irradiance_w_per_m2(15.0, 550.0, 100.0).unwrap_err();
        assert!(error.to_string().contains("800 to 1700 nm"), "{error}");
    }
}
