//! The share of all patterns that a measurement shows or a reconstruction uses.

use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// A share of the patterns: more than 0, at most 1.
///
/// People write a share as `0.3` or `30%`; [`Sampling::from_str`] reads both. A number above 1
/// without a percent sign is refused: `2` may be meant as 2 % or as twice as many patterns.
///
/// # Invariant
/// The share is more than 0 and at most 1 (`tests::every_way_to_write_a_share_gives_the_share`).
///
/// ```
/// use nirspi_patterns::Sampling;
///
/// for text in ["0.3", "30%", "30 %"] {
///     assert_eq!(text.parse(), Sampling::new(0.3));
/// }
/// # Ok::<(), nirspi_patterns::SamplingError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Sampling(f64);

/// Why a text is not a share of the patterns.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SamplingError {
    /// No number, or a number that is out of range.
    #[error("expected more than 0 and at most 1 (0.3), or a percentage (30%)")]
    Range,
    /// A percentage without its sign.
    #[error("expected at most 1, or a percentage with its sign: write {found}% or {share}")]
    NoSign {
        /// The number.
        found: String,
        /// The number as a share.
        share: String,
    },
}

impl Sampling {
    /// All patterns.
    pub const ALL: Self = Self(1.0);
    /// Half of the patterns.
    pub const HALF: Self = Self(0.5);

    /// This share of the patterns.
    ///
    /// # Errors
    /// [`SamplingError::Range`] if the share is not more than 0 and at most 1.
    pub fn new(share: f64) -> Result<Self, SamplingError> {
        if share > 0.0 && share <= 1.0 { Ok(Self(share)) } else { Err(SamplingError::Range) }
    }

    /// The share, more than 0 and at most 1.
    #[must_use]
    pub fn share(self) -> f64 {
        self.0
    }
}

impl FromStr for Sampling {
    type Err = SamplingError;

    /// Reads a share (`0.3`) or a percentage (`30%`, `30 %`).
    fn from_str(text: &str) -> Result<Self, SamplingError> {
        let text = text.trim();
        let (number, percent) = match text.strip_suffix('%') {
            Some(number) => (number.trim_end(), true),
            None => (text, false),
        };
        let value: f64 = number.parse().map_err(|_| SamplingError::Range)?;
        let of_percent = Self::new(value / 100.0);
        match of_percent {
            Ok(_) if !percent && value > 1.0 => {
                // A share of 1.5 % is 0.015, and not the nearest binary fraction in all its digits.
                let digits = format!("{:.6}", value / 100.0);
                let share = digits.trim_end_matches('0').trim_end_matches('.').to_owned();
                Err(SamplingError::NoSign { found: number.to_owned(), share })
            }
            _ if percent => of_percent,
            _ => Self::new(value),
        }
    }
}

impl fmt::Display for Sampling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_way_to_write_a_share_gives_the_share(percent in 2_u32..=100, space in " {0,2}") {
            let share = Sampling::new(f64::from(percent) / 100.0).unwrap();
            for text in [
                format!("{percent}%"),
                format!("{percent}{space}%"),
                format!("{percent}.0%"),
                format!("{share}"),
            ] {
                prop_assert_eq!(text.parse(), Ok(share), "{}", text);
            }
        }

        #[test]
        fn what_is_read_is_a_share_or_refused(text in "\\PC{0,8}", number: f64) {
            for text in [text, number.to_string(), format!("{number}%")] {
                if let Ok(read) = text.parse::<Sampling>() {
                    prop_assert!(read.share() > 0.0 && read.share() <= 1.0, "{}", text);
                }
            }
        }
    }

    #[test]
    fn what_is_no_share_is_refused() {
        for text in
            ["0", "-0.1", "101", "100.5%", "nan", "inf", "", "%", "x", "0%", "-30%", "1e400"]
        {
            assert_eq!(text.parse::<Sampling>(), Err(SamplingError::Range), "{text}");
        }
        for (text, advice) in [
            ("1.5", "write 1.5% or 0.015"),
            ("2", "write 2% or 0.02"),
            ("30", "write 30% or 0.3"),
            ("100", "write 100% or 1"),
        ] {
            let error = text.parse::<Sampling>().unwrap_err().to_string();
            assert!(error.ends_with(advice), "{error}");
        }
        assert_eq!("1.5%".parse(), Sampling::new(0.015));
        assert_eq!("1".parse(), Ok(Sampling::ALL));
    }
}
