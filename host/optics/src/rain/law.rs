//! A law of drop sizes as a user writes it.

use super::{Drops, RainError};
use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;
use thiserror::Error;

/// A law of drop sizes without its rain rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DropLaw {
    /// Natural rain: `marshall-palmer`.
    MarshallPalmer,
    /// Drops of one diameter: `mono:MM`.
    Monodisperse {
        /// The diameter.
        drop_mm: f64,
    },
    /// A gamma law: `gamma:SHAPE,SLOPE`.
    Gamma {
        /// The paper's mu.
        shape: f64,
        /// The paper's Lambda.
        slope_per_mm: f64,
    },
    /// Fog. The rain rate follows from its water: `fog:UM,G`.
    Fog {
        /// The most frequent diameter.
        mode_um: f64,
        /// Water in the air.
        water_g_per_m3: f64,
    },
}

/// Error: the text does not name a law. `Display` is one line with what was found and what is
/// expected.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("found {found}, expected {expected}")]
pub struct ParseDropLawError {
    /// The text.
    pub found: String,
    /// The laws, or the number of parameters of the law.
    pub expected: String,
}

impl DropLaw {
    /// The allowed texts.
    pub const EXPECTED: &str = "marshall-palmer, mono:MM, gamma:SHAPE,SLOPE or fog:UM,G";

    /// Whether the law was fitted to measured drops of a rain rate, so that its own drops carry another
    /// rate at the speeds at which they fall.
    #[must_use]
    pub fn is_fitted(&self) -> bool {
        matches!(self, Self::MarshallPalmer)
    }

    /// The drops of this law at a rain rate.
    ///
    /// # Errors
    /// [`RainError`] for a rate or a parameter out of range.
    pub fn drops(self, rate_mm_per_h: f64) -> Result<Drops, RainError> {
        match self {
            Self::MarshallPalmer => Drops::marshall_palmer(rate_mm_per_h),
            Self::Monodisperse { drop_mm } => Drops::monodisperse(rate_mm_per_h, drop_mm),
            Self::Gamma { shape, slope_per_mm } => Drops::gamma(rate_mm_per_h, shape, slope_per_mm),
            Self::Fog { mode_um, water_g_per_m3 } => Drops::fog(mode_um, water_g_per_m3),
        }
    }
}

impl fmt::Display for DropLaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::MarshallPalmer => f.write_str("marshall-palmer"),
            Self::Monodisperse { drop_mm } => write!(f, "mono:{drop_mm}"),
            Self::Gamma { shape, slope_per_mm } => write!(f, "gamma:{shape},{slope_per_mm}"),
            Self::Fog { mode_um, water_g_per_m3 } => write!(f, "fog:{mode_um},{water_g_per_m3}"),
        }
    }
}

impl FromStr for DropLaw {
    type Err = ParseDropLawError;

    fn from_str(text: &str) -> Result<Self, ParseDropLawError> {
        let unknown =
            || ParseDropLawError { found: text.to_owned(), expected: Self::EXPECTED.to_owned() };
        let (law, parameters) = match text.split_once(':') {
            None if text == "marshall-palmer" => return Ok(Self::MarshallPalmer),
            None => return Err(unknown()),
            Some(parts) => parts,
        };
        Ok(match law {
            "mono" => {
                let [drop_mm] = numbers(text, parameters)?;
                Self::Monodisperse { drop_mm }
            }
            "gamma" => {
                let [shape, slope_per_mm] = numbers(text, parameters)?;
                Self::Gamma { shape, slope_per_mm }
            }
            "fog" => {
                let [mode_um, water_g_per_m3] = numbers(text, parameters)?;
                Self::Fog { mode_um, water_g_per_m3 }
            }
            _ => return Err(unknown()),
        })
    }
}

/// As many numbers as `counts` allows, separated by commas.
pub(super) fn numbers_between(
    text: &str,
    parameters: &str,
    counts: RangeInclusive<usize>,
) -> Result<Vec<f64>, ParseDropLawError> {
    let found: Option<Vec<f64>> = parameters.split(',').map(|n| n.trim().parse().ok()).collect();
    found.filter(|found| counts.contains(&found.len())).ok_or_else(|| ParseDropLawError {
        found: text.to_owned(),
        expected: match (*counts.start(), *counts.end()) {
            (1, 1) => "1 number after the colon".to_owned(),
            (low, high) if low == high => format!("{low} numbers after the colon"),
            (low, high) => format!("{low} to {high} numbers after the colon"),
        },
    })
}

/// Exactly `COUNT` numbers, separated by commas.
fn numbers<const COUNT: usize>(
    text: &str,
    parameters: &str,
) -> Result<[f64; COUNT], ParseDropLawError> {
    let mut found = numbers_between(text, parameters, COUNT..=COUNT)?.into_iter();
    // The count was checked above, so no default is used.
    Ok(std::array::from_fn(|_| found.next().unwrap_or(f64::NAN)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_law_is_read_as_it_is_written() {
        for law in [
            DropLaw::MarshallPalmer,
            DropLaw::Monodisperse { drop_mm: 2.5 },
            DropLaw::Gamma { shape: -0.5, slope_per_mm: 3.0 },
            DropLaw::Fog { mode_um: 10.0, water_g_per_m3: 0.1 },
        ] {
            assert_eq!(law.to_string().parse(), Ok(law));
            assert!(!law.drops(5.6).unwrap().is_empty(), "{law}");
        }
        assert_eq!("gamma: 2 , 3".parse(), Ok(DropLaw::Gamma { shape: 2.0, slope_per_mm: 3.0 }));
    }

    #[test]
    fn text_that_names_no_law_says_what_is_expected() {
        for (text, told) in [
            ("hail", "found hail, expected marshall-palmer, mono:MM"),
            ("snow:1", "found snow:1, expected marshall-palmer"),
            ("mono:", "found mono:, expected 1 number after the colon"),
            ("mono:1,2", "found mono:1,2, expected 1 number after the colon"),
            ("gamma:2", "found gamma:2, expected 2 numbers after the colon"),
            ("fog:ten,1", "found fog:ten,1, expected 2 numbers after the colon"),
        ] {
            let error = text.parse::<DropLaw>().unwrap_err().to_string();
            assert!(error.starts_with(told), "{error}");
        }
    }
}
