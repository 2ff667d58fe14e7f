//! The complex refractive index of liquid water from 0.4 to 2 um.
//!
//! Two published tables, copied digit for digit by `scripts/water_tables.py`; both are for 25
//! degrees C. Segelstein's table is denser (222 rows here, against 30) and the default. Hale and
//! Querry's table has one row every 200 nm above 1 um and misses the shape of the absorption band
//! at 1.45 um.
//!
//! # Invariant
//! Every index comes from a table. Between rows, n is linear and ln k is linear in ln(wavelength)
//! (`tests::an_index_lies_between_its_neighbouring_rows`). Wavelengths outside the tables are an
//! error (`tests::other_wavelengths_are_refused_with_the_range`).

mod hale;
mod segelstein;

use crate::mie::Index;
use std::f64::consts::PI;
use std::ops::RangeInclusive;
use thiserror::Error;

/// Wavelengths covered, in nm.
pub const WAVELENGTHS_NM: RangeInclusive<f64> = 400.0..=2000.0;

/// Error: the tables do not cover the wavelength.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("water: wavelength is {found_nm} nm, expected 400 to 2000 nm")]
pub struct WavelengthError {
    /// The requested wavelength.
    pub found_nm: f64,
}

/// A table of water's index.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Water {
    /// Segelstein (1981).
    #[default]
    Segelstein,
    /// Hale and Querry (1973).
    HaleQuerry,
}

impl Water {
    /// The index at a wavelength.
    ///
    /// # Errors
    /// [`WavelengthError`] outside [`WAVELENGTHS_NM`].
    pub fn index(self, wavelength_nm: f64) -> Result<Index, WavelengthError> {
        if !WAVELENGTHS_NM.contains(&wavelength_nm) {
            return Err(WavelengthError { found_nm: wavelength_nm });
        }
        let rows: &[(f64, f64, f64)] = match self {
            Self::Segelstein => &segelstein::ROWS,
            Self::HaleQuerry => &hale::ROWS,
        };
        let um = wavelength_nm * 1e-3;
        // Both tables begin at or before the first wavelength and end at or after the last.
        let above = rows.partition_point(|row| row.0 < um).clamp(1, rows.len() - 1);
        let (low, high) = (rows[above - 1], rows[above]);
        let part = (um / low.0).ln() / (high.0 / low.0).ln();
        Ok(Index {
            real: low.1 + (high.1 - low.1) * part,
            imaginary: low.2 * (high.2 / low.2).powf(part),
        })
    }

    /// Absorption coefficient `4 pi k / wavelength` of bulk water, in 1/cm.
    ///
    /// # Errors
    /// [`WavelengthError`] outside [`WAVELENGTHS_NM`].
    pub fn absorption_per_cm(self, wavelength_nm: f64) -> Result<f64, WavelengthError> {
        Ok(4.0 * PI * self.index(wavelength_nm)?.imaginary / (wavelength_nm * 1e-7))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn rows_of_the_tables_come_back_as_they_are() {
        for (table, rows) in
            [(Water::Segelstein, &segelstein::ROWS[..]), (Water::HaleQuerry, &hale::ROWS[..])]
        {
            for &(um, n, k) in rows.iter().filter(|row| (0.4..=2.0).contains(&row.0)) {
                let index = table.index(um * 1e3).unwrap();
                assert!((index.real - n).abs() < 1e-12 && (index.imaginary / k - 1.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn water_absorbs_some_250_times_more_at_1550_nm_than_at_850() {
        let at = |nm| Water::Segelstein.absorption_per_cm(nm).unwrap();
        // Expected are about 10.8 and 0.04 per cm.
        assert!((at(1550.0) - 10.8).abs() < 0.3, "{}", at(1550.0));
        assert!((at(850.0) - 0.042).abs() < 0.003, "{}", at(850.0));
    }

    #[test]
    fn the_two_tables_agree_where_both_are_dense() {
        for nm in [450.0, 550.0, 650.0, 850.0, 1000.0] {
            let (a, b) =
                (Water::Segelstein.index(nm).unwrap(), Water::HaleQuerry.index(nm).unwrap());
            assert!((a.real - b.real).abs() < 0.008, "{nm}: {a:?} {b:?}");
            assert!((a.imaginary / b.imaginary).ln().abs() < 0.6, "{nm}: {a:?} {b:?}");
        }
    }

    proptest! {
        #[test]
        fn an_index_lies_between_its_neighbouring_rows(nm in 400.0..=2000.0) {
            for table in [Water::Segelstein, Water::HaleQuerry] {
                let index = table.index(nm).unwrap();
                prop_assert!(index.real > 1.29 && index.real < 1.36);
                prop_assert!(index.imaginary > 5e-10 && index.imaginary < 2e-3);
            }
        }

        #[test]
        fn other_wavelengths_are_refused_with_the_range(nm in prop_oneof![-1e4..399.99, 2000.01..1e6]) {
            let error = Water::Segelstein.index(nm).unwrap_err();
            prop_assert!(error.to_string().contains("400 to 2000 nm"), "{}", error);
        }
    }
}
