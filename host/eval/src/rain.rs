//! The effects of rain, fog and single drops on light, and the uniformity of a rain simulator.

pub mod budget;
pub mod curves;
pub mod rig;

use crate::error::{EvalError, Result};
use nirspi_optics::mie::{Index, Mie};
use nirspi_optics::rain::fall::{
    beta, fall_speed_from_rest_m_per_s, fall_speed_m_per_s, fall_time_constant_s,
};
use nirspi_optics::rain::radar::drops_reflectivity_db;
use nirspi_optics::rain::{Drops, Medium};
use nirspi_optics::water::Water;
use serde::Serialize;

/// The effects of one sphere on light: efficiencies relative to its geometric shadow.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SphereReport {
    /// Size parameter, pi times diameter divided by wavelength.
    pub x: f64,
    /// Real part of the refractive index.
    pub m_re: f64,
    /// Imaginary part, positive for a sphere that absorbs.
    pub m_im: f64,
    /// Extinction.
    pub qext: f64,
    /// Scattering.
    pub qsca: f64,
    /// Absorption.
    pub qabs: f64,
    /// Backscatter.
    pub qback: f64,
    /// Asymmetry of the scattering.
    pub g: f64,
}

/// The efficiencies of a sphere of size parameter `x` and refractive index `index`.
///
/// # Errors
/// [`EvalError::Mie`] for a sphere for which the solver was not checked.
pub fn sphere(x: f64, index: Index) -> Result<SphereReport> {
    let q = Mie::new().sphere(x, index)?.efficiencies();
    Ok(SphereReport {
        x,
        m_re: index.real,
        m_im: index.imaginary,
        qext: q.extinction,
        qsca: q.scattering,
        qabs: q.absorption,
        qback: q.backscatter,
        g: q.asymmetry,
    })
}

/// The effects of rain or fog on light.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RainReport {
    /// The caller's name for the drops.
    pub drops: String,
    /// Rain rate: the volume of the drops at the speeds at which they fall.
    pub rate_mm_per_h: f64,
    /// The rate for which a fitted law was asked; `null` where the drops carry the rate asked for.
    pub asked_mm_per_h: Option<f64>,
    /// Drops in a cubic metre.
    pub drops_per_m3: f64,
    /// Water in the air.
    pub water_g_per_m3: f64,
    /// Differential reflectivity for a radar; `null` if not requested, or in dry air.
    pub z_dr_db: Option<f64>,
    /// Distance of the losses, there and back.
    pub path_m: f64,
    /// The effects at each wavelength.
    pub wavelengths: Vec<WavelengthReport>,
    /// The fall of a drop, only for drops of one size.
    pub fall: Option<FallReport>,
    /// How to interpret the extinction.
    pub note: &'static str,
}

/// The effects at one wavelength.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WavelengthReport {
    /// The wavelength.
    pub wavelength_nm: f64,
    /// Extinction: light removed from a beam.
    pub extinction_per_m: f64,
    /// The scattered part of the extinction.
    pub scattering_per_m: f64,
    /// The absorbed part of the extinction.
    pub absorption_per_m: f64,
    /// Extinction in dB/km.
    pub extinction_db_per_km: f64,
    /// Scattering divided by extinction.
    pub albedo: f64,
    /// Mean cosine of the scattering angle.
    pub asymmetry: f64,
    /// Loss over the path and back, without light regained by forward scattering.
    pub loss_there_and_back: f64,
    /// `null` in dry air.
    pub visibility_m: Option<f64>,
}

/// The fall of a drop, compared with exposures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FallReport {
    /// The drop.
    pub diameter_mm: f64,
    /// Its speed.
    pub speed_m_per_s: f64,
    /// Time in which it falls twice its diameter.
    pub time_constant_ms: f64,
    /// The paper's beta for an exposure of 25 us (one pattern).
    pub beta_25_us: f64,
    /// The paper's beta for an exposure of 20 ms (an image).
    pub beta_20_ms: f64,
    /// The same rain in a rig as high as the paper's.
    pub rig: RigReport,
}

/// A drop half way down the paper's rig of 0.5 m. The drop has not reached its terminal speed, so
/// the same mm/h means more drops. Drops are assumed to leave the nozzles at rest, which gives an
/// upper bound.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RigReport {
    /// Height fallen from the nozzles.
    pub height_m: f64,
    /// Speed at that height.
    pub speed_m_per_s: f64,
    /// Drops in a cubic metre at that height.
    pub drops_per_m3: f64,
    /// Number of drops divided by their number at terminal speed. Extinction grows by the same
    /// factor.
    pub times_as_many: f64,
}

/// Half of the paper's rig's height (section 4).
const HALF_RIG_M: f64 = 0.25;

/// How to interpret the extinction of a [`RainReport`].
const NOTE: &str = "extinction counts light diffracted by under a milliradian, half of it, as lost; \
                    a camera of this resolution does not lose it (docs/rain.md)";

/// The effects of `drops` on light of these wavelengths over `distance_m` and back. `radar` adds
/// their differential reflectivity, which fog drops do not have.
///
/// # Errors
/// [`EvalError::Setting`] for a distance, [`EvalError::Refused`] for a wavelength out of range.
pub fn rain(
    name: &str,
    drops: &Drops,
    wavelengths_nm: &[f64],
    distance_m: f64,
    radar: bool,
) -> Result<RainReport> {
    check_distance(distance_m)?;
    let mut wavelengths = Vec::new();
    for &nm in wavelengths_nm {
        let medium = Medium::new(drops, nm, Water::Segelstein)
            .map_err(|error| EvalError::refused("wavelengths_nm", &error))?;
        wavelengths.push(WavelengthReport {
            wavelength_nm: nm,
            extinction_per_m: medium.extinction_per_m,
            scattering_per_m: medium.scattering_per_m,
            absorption_per_m: medium.absorption_per_m,
            extinction_db_per_km: medium.extinction_db_per_km(),
            albedo: medium.albedo(),
            asymmetry: medium.asymmetry,
            loss_there_and_back: 1.0 - medium.transmission(2.0 * distance_m),
            visibility_m: Some(medium.visibility_m()).filter(|v| v.is_finite()),
        });
    }
    let fall = match drops.classes() {
        [one] => Some(FallReport {
            diameter_mm: one.diameter_mm,
            speed_m_per_s: fall_speed_m_per_s(one.diameter_mm),
            time_constant_ms: fall_time_constant_s(one.diameter_mm) * 1e3,
            beta_25_us: beta(one.diameter_mm, 25e-6),
            beta_20_ms: beta(one.diameter_mm, 20e-3),
            rig: in_rig(drops, one.diameter_mm)?,
        }),
        _ => None,
    };
    Ok(RainReport {
        drops: name.to_owned(),
        rate_mm_per_h: drops.rate_mm_per_h(),
        asked_mm_per_h: None,
        drops_per_m3: drops.concentration_per_m3(),
        water_g_per_m3: drops.liquid_water_g_per_m3(),
        z_dr_db: drops_reflectivity_db(drops).filter(|_| radar),
        path_m: distance_m,
        wavelengths,
        fall,
        note: NOTE,
    })
}

fn in_rig(drops: &Drops, diameter_mm: f64) -> Result<RigReport> {
    let rig = drops.below_nozzles(HALF_RIG_M)?;
    Ok(RigReport {
        height_m: HALF_RIG_M,
        speed_m_per_s: fall_speed_from_rest_m_per_s(diameter_mm, HALF_RIG_M),
        drops_per_m3: rig.concentration_per_m3(),
        times_as_many: rig.concentration_per_m3() / drops.concentration_per_m3(),
    })
}

fn check_distance(distance_m: f64) -> Result<()> {
    match distance_m.is_finite() && distance_m > 0.0 {
        true => Ok(()),
        false => Err(EvalError::setting("distance_m", distance_m, "a positive number of metres")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sphere_has_the_efficiencies_of_miepython() {
        // miepython 3.3.0: 2.1007189, 2.0589971, 0.8738868
        let q = sphere(100.0, Index { real: 1.33, imaginary: 1e-4 }).unwrap();
        for (found, expected) in [(q.qext, 2.100_718_9), (q.qsca, 2.058_997_1), (q.g, 0.873_886_8)]
        {
            assert!((found - expected).abs() < 1e-6, "{q:?}");
        }
        assert!((q.qext - q.qsca - q.qabs).abs() < 1e-12);
        assert!(sphere(1e6, Index { real: 1.3, imaginary: 0.0 }).unwrap_err().is_setting());
    }

    #[test]
    fn losses_follow_from_the_extinction_and_the_path() {
        let drops = Drops::monodisperse(5.6, 2.0).unwrap();
        let report = rain("mono:2", &drops, &[550.0, 1550.0], 3.0, true).unwrap();
        for at in &report.wavelengths {
            let lost = 1.0 - (-at.extinction_per_m * 6.0).exp();
            assert!((at.loss_there_and_back - lost).abs() < 1e-12, "{at:?}");
            assert!(
                (at.extinction_per_m - at.scattering_per_m - at.absorption_per_m).abs() < 1e-12
            );
        }
        let fall = report.fall.as_ref().unwrap();
        assert_eq!((fall.diameter_mm, fall.rig.height_m), (2.0, 0.25));
        assert!((fall.rig.times_as_many - 3.04).abs() < 0.02, "{fall:?}");
        assert!(report.z_dr_db.is_some());
        assert!(rain("mono:2", &drops, &[550.0], 3.0, false).unwrap().z_dr_db.is_none());
    }

    #[test]
    fn dry_air_has_no_visibility_and_wrong_settings_are_named() {
        let dry = rain("none", &Drops::none(), &[550.0], 1.0, false).unwrap();
        assert_eq!((dry.wavelengths[0].visibility_m, dry.fall), (None, None));
        let wrong = |nm, m| rain("none", &Drops::none(), &[nm], m, false).unwrap_err().to_string();
        assert_eq!(wrong(550.0, -1.0), "distance_m is -1, expected a positive number of metres");
        assert!(wrong(300.0, 1.0).starts_with("wavelengths_nm: "), "{}", wrong(300.0, 1.0));
    }
}
