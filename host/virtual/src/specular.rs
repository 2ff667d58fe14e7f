//! A specular spot as a user writes it.

use nirspi_optics::{SIDE, Specular};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// A spot of the target that sends the LEDs' light straight back, as large as a pixel of the 32 x 32 and at this one while the
/// target is at rest. As text: `50` or `50@8,23`, its brightness and the pixel's row and column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpecularSpot {
    /// Its brightness, divided by that of white.
    pub times: f64,
    /// The row of its pixel from the top.
    pub row: usize,
    /// The column of its pixel from the left.
    pub column: usize,
}

/// Why a text or a place is no specular spot.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SpecularSpotError {
    /// Other text.
    #[error(
        "found {0}, expected how many times as bright as white a spot is, such as 50, or 50@8,23 with its row and column"
    )]
    Text(String),
    /// The array has no such pixel.
    #[error("a specular spot at row {row}, column {column}, expected 0 to {last} each", last = SIDE - 1)]
    Place {
        /// Row from the top.
        row: usize,
        /// Column from the left.
        column: usize,
    },
}

impl SpecularSpot {
    /// The spot on a target whose field is so wide.
    ///
    /// # Errors
    /// [`SpecularSpotError::Place`] for a place outside the field.
    pub fn of_field(self, field_mm: f64) -> Result<Specular, SpecularSpotError> {
        let Self { times, row, column } = self;
        if row.max(column) >= SIDE {
            return Err(SpecularSpotError::Place { row, column });
        }
        let side_mm = field_mm / SIDE as f64;
        let at_mm = |pixel: usize| (pixel as f64 + 0.5 - SIDE as f64 / 2.0) * side_mm;
        Ok(Specular { times, x_mm: at_mm(column), y_mm: at_mm(row), side_mm })
    }
}

impl FromStr for SpecularSpot {
    type Err = SpecularSpotError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let wrong = || SpecularSpotError::Text(text.to_owned());
        let (times, place) = text.split_once('@').unwrap_or((text, "8,23"));
        let (row, column) = place.split_once(',').ok_or_else(wrong)?;
        let number = |text: &str| text.trim().parse().map_err(|_| wrong());
        let times = times.trim().parse().map_err(|_| wrong())?;
        Ok(Self { times, row: number(row)?, column: number(column)? })
    }
}

impl fmt::Display for SpecularSpot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}@{},{}", self.times, self.row, self.column)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CameraModel, VirtualOptics};
    use nirspi_optics::Scene;

    #[test]
    fn a_text_is_a_spot_or_says_what_was_expected() {
        let spot: SpecularSpot = "50@3, 4".parse().unwrap();
        assert_eq!(spot, SpecularSpot { times: 50.0, row: 3, column: 4 });
        assert_eq!(spot.to_string().parse(), Ok(spot));
        assert_eq!("2.5".parse(), Ok(SpecularSpot { times: 2.5, row: 8, column: 23 }));
        for text in ["", "bright", "5@", "5@1", "5@1,-2", "5@1,2,3", "@1,2"] {
            let error = text.parse::<SpecularSpot>().unwrap_err();
            assert!(error.to_string().contains("such as 50"), "{error}");
        }
    }

    #[test]
    fn one_led_sees_the_spot_and_the_others_see_the_target() {
        let optics = |spot: &str| {
            let optics = VirtualOptics::of(CameraModel::paper(), Scene::white(), 300.0).unwrap();
            optics.with_specular(spot.parse().unwrap())
        };
        let seen = optics("50@3,4").unwrap();
        let weights = seen.footprint().weights();
        let brightest = (0..1024).max_by(|&a, &b| weights[a].total_cmp(&weights[b])).unwrap();
        assert_eq!(brightest, 3 * 32 + 4);
        assert!((weights[brightest] - 51.0).abs() < 0.1, "{}", weights[brightest]);
        assert_eq!(weights[3 * 32 + 10], 1.0);
        for (spot, words) in [("5@32,0", "row 32, column 0"), ("0", "0 times as bright")] {
            let error = optics(spot).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
