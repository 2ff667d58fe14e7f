//! Daylight by wavelength: the irradiance that a band-pass filter transmits at an illuminance.
//!
//! # Invariant
//! A filter's daylight is the integral of the spectrum over the filter
//! (`tests::a_filter_gets_the_integral_over_it`). Lines and bands of the atmosphere are narrower
//! than filters: the value at the filter's middle is 6 % below the mean at 850 nm, and 6 % above
//! the mean at 1550 nm.
//!
//! # Spectrum
//!
//! The spectrum is ASTM G173-03, global tilt (`AM1.5G`, 1000 W/m^2), in means over 10 nm, made from
//! the table in PyPI's `pvlib` 0.16.1. Weighted by 683 lm/W times the CIE 1931 luminosity function
//! (the fit of Wyman, Sloan and Shirley, *Simple analytic approximations to the CIE XYZ color
//! matching functions*, JCGT 2(2), 2013), the spectrum has 109.6 klx.
//!
//! Assumption: haze and cloud dim every wavelength as they dim visible light. Liquid water in
//! clouds dims 1550 nm more, so the paper's half-cloudy 15 klx is overestimated rather than
//! underestimated at 1550 nm.

use std::ops::RangeInclusive;
use thiserror::Error;

/// Wavelengths of the table, in nm.
pub const WAVELENGTHS_NM: RangeInclusive<f64> = 400.0..=1700.0;

/// Illuminance of the whole spectrum, in klx.
const SPECTRUM_KLX: f64 = 109.6;

/// Width of a row of the table, in nm.
const STEP_NM: f64 = 10.0;

/// Mean irradiance from 400 nm on in steps of 10 nm, in W m^-2 nm^-1.
#[rustfmt::skip]
const SPECTRUM: [f64; 130] = [
    1.1547, 1.2012, 1.1878, 1.1998, 1.4340, 1.5444, 1.5586, 1.5794, 1.5296, 1.5685,
    1.5417, 1.4913, 1.5304, 1.5483, 1.5271, 1.5273, 1.5062, 1.4848, 1.4909, 1.4535,
    1.4748, 1.4548, 1.4189, 1.4327, 1.4195, 1.3608, 1.4072, 1.4047, 1.2771, 1.2733,
    1.2975, 1.1959, 1.0875, 1.1875, 1.2368, 1.1788, 0.7190, 1.1740, 1.1488, 1.0929,
    1.0753, 0.9258, 0.9113, 0.9660, 0.9958, 0.9563, 0.9575, 0.9497, 0.9254, 0.7901,
    0.7072, 0.6613, 0.6878, 0.2729, 0.3353, 0.3579, 0.5241, 0.6257, 0.7142, 0.7448,
    0.7226, 0.7115, 0.6939, 0.6800, 0.6631, 0.6444, 0.6201, 0.6078, 0.5810, 0.5354,
    0.4598, 0.2485, 0.1169, 0.1822, 0.1885, 0.2593, 0.3957, 0.4391, 0.4179, 0.4453,
    0.4317, 0.4462, 0.4565, 0.4651, 0.4588, 0.4437, 0.3774, 0.4136, 0.4134, 0.3980,
    0.3533, 0.3073, 0.2621, 0.1796, 0.0892, 0.0015, 0.0000, 0.0002, 0.0001, 0.0003,
    0.0010, 0.0096, 0.0262, 0.0314, 0.0535, 0.0921, 0.0850, 0.0794, 0.1171, 0.1947,
    0.2232, 0.2529, 0.2694, 0.2714, 0.2715, 0.2684, 0.2625, 0.2366, 0.2481, 0.2495,
    0.2296, 0.2350, 0.2393, 0.2304, 0.2198, 0.2207, 0.2140, 0.2135, 0.2056, 0.2032,
];

/// Error: the table does not cover the filter.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("daylight: a filter from {low_nm} to {high_nm} nm, expected wavelengths within {expected}")]
pub struct DaylightError {
    /// Start of the filter, in nm.
    pub low_nm: f64,
    /// End of the filter, in nm.
    pub high_nm: f64,
    /// The range of the light's known spectrum.
    pub expected: &'static str,
}

/// Irradiance in W/m^2 of `klx` of daylight within a filter of `width_nm` around `wavelength_nm`.
///
/// # Errors
/// [`DaylightError`] if the filter reaches beyond the table.
pub fn irradiance_w_per_m2(
    klx: f64,
    wavelength_nm: f64,
    width_nm: f64,
) -> Result<f64, DaylightError> {
    let (low_nm, high_nm) = (wavelength_nm - width_nm / 2.0, wavelength_nm + width_nm / 2.0);
    if !(WAVELENGTHS_NM.contains(&low_nm) && WAVELENGTHS_NM.contains(&high_nm)) {
        return Err(DaylightError { low_nm, high_nm, expected: "400 to 1700 nm" });
    }
    let overlap = |row: usize| {
        let start = WAVELENGTHS_NM.start() + STEP_NM * row as f64;
        (high_nm.min(start + STEP_NM) - low_nm.max(start)).max(0.0)
    };
    let whole: f64 = SPECTRUM.iter().enumerate().map(|(row, mean)| mean * overlap(row)).sum();
    Ok(whole * klx / SPECTRUM_KLX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spectrum_is_as_bright_as_it_says() {
        let middle = |row: usize| 405.0 + 10.0 * row as f64;
        let weighted =
            SPECTRUM.iter().enumerate().map(|(row, e)| e * crate::lamp::luminosity(middle(row)));
        let klx = 683.0 * STEP_NM * weighted.sum::<f64>() * 1e-3;
        assert!((klx / SPECTRUM_KLX - 1.0).abs() < 2e-3, "{klx}");
    }

    #[test]
    fn a_filter_gets_the_integral_over_it() {
        let all = |nm, width| irradiance_w_per_m2(SPECTRUM_KLX, nm, width).unwrap();
        // The table's own 1 nm rows, summed by hand.
        for (nm, expected) in [(550.0, 151.013), (850.0, 94.531), (1550.0, 25.536)] {
            assert!((all(nm, 100.0) / expected - 1.0).abs() < 1e-4, "{nm} nm: {}", all(nm, 100.0));
        }
        assert!((all(850.0, 7.0) + all(857.0, 7.0) - all(853.5, 14.0)).abs() < 1e-12);
        assert_eq!(all(850.0, 0.0), 0.0);
        // Water vapour absorbs nearly all light at 1.4 um.
        assert!(all(1400.0, 20.0) < 0.01 * all(1550.0, 20.0));
    }

    #[test]
    fn a_filter_beyond_the_table_is_refused_with_what_there_is() {
        for (nm, width) in [(380.0, 10.0), (1690.0, 100.0), (f64::NAN, 10.0), (550.0, f64::NAN)] {
            let error = irradiance_w_per_m2(15.0, nm, width).unwrap_err().to_string();
            assert!(error.contains("400 to 1700 nm"), "{error}");
        }
    }
}
