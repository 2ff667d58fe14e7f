//! Differential reflectivity: the drop shape as seen by a weather radar, an input of the paper's
//! Algorithm 2.
//!
//! Large drops flatten as they fall and reflect more horizontal than vertical polarisation. The
//! reflectivity depends on drop sizes, but does not affect light.

use super::Drops;
use num_complex::Complex64;

/// Refractive index of water at 10 cm wavelength and 20 degrees C (Battan, *Radar Observation of
/// the Atmosphere*, 1973).
const WATER_AT_10_CM: Complex64 = Complex64::new(8.88, 0.63);

/// `10 log10(horizontal / vertical)` of two reflectivities, in dB: Algorithm 2's Z_dr.
#[must_use]
pub fn differential_reflectivity_db(horizontal: f64, vertical: f64) -> f64 {
    10.0 * (horizontal / vertical).log10()
}

/// Height over width of a falling drop: `1.03 - 0.062 D`, D in mm, at most 1 (Pruppacher and Beard,
/// Q. J. R. Meteorol. Soc. 96, 247, 1970).
#[must_use]
pub fn axis_ratio(diameter_mm: f64) -> f64 {
    (1.03 - 0.062 * diameter_mm).clamp(0.4, 1.0)
}

/// Z_dr of these drops, in dB; `None` without drops. The drops are oblate spheroids that are small
/// compared with the wavelength (Rayleigh-Gans; Bringi and Chandrasekar, *Polarimetric Doppler
/// Weather Radar*, 2001, appendix 1), with vertical symmetry axes.
#[must_use]
pub fn drops_reflectivity_db(drops: &Drops) -> Option<f64> {
    let both = |vertical: bool| {
        drops.sum(|d| d.powi(6) * polarisability(axis_ratio(d), vertical).norm_sqr())
    };
    let (horizontal, vertical) = (both(false), both(true));
    (vertical > 0.0).then(|| differential_reflectivity_db(horizontal, vertical))
}

/// `(eps - 1) / (1 + L (eps - 1))` for a field along or across the symmetry axis.
fn polarisability(axis_ratio: f64, along: bool) -> Complex64 {
    let across = {
        let f2 = axis_ratio.powi(-2) - 1.0;
        if f2 < 1e-6 {
            1.0 / 3.0
        } else {
            let f = f2.sqrt();
            let along = (1.0 + f2) / f2 * (1.0 - f.atan() / f);
            (1.0 - along) / 2.0
        }
    };
    let depolarisation = if along { 1.0 - 2.0 * across } else { across };
    let contrast = WATER_AT_10_CM * WATER_AT_10_CM - 1.0;
    contrast / (1.0 + contrast * depolarisation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_drops_look_the_same_in_both_polarisations_and_large_ones_do_not() {
        let of = |mm| drops_reflectivity_db(&Drops::monodisperse(5.0, mm).unwrap()).unwrap();
        assert!(of(0.4).abs() < 1e-9);
        assert!(of(1.0) < of(2.0) && of(2.0) < of(4.0));
        // The common rule of thumb: under 1 dB at 2 mm, 2 to 3 dB at 4 mm.
        assert!((0.5..1.0).contains(&of(2.0)), "{}", of(2.0));
        assert!((1.8..3.0).contains(&of(4.0)), "{}", of(4.0));
        assert_eq!(drops_reflectivity_db(&Drops::none()), None);
    }

    #[test]
    fn twice_the_power_is_three_decibels() {
        assert!((differential_reflectivity_db(2.0, 1.0) - 3.0103).abs() < 1e-4);
    }
}
