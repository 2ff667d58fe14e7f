//! Dry air or one of the paper's two kinds of rain.

use super::{Drops, PaperRain, RainError};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Dry air or rain as in the paper's Table 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Rainfall {
    /// Dry air.
    #[default]
    None,
    /// [`PaperRain::LIGHT`].
    Light,
    /// [`PaperRain::HEAVY`].
    Heavy,
}

impl Rainfall {
    /// All kinds, from dry to heavy.
    pub const ALL: [Self; 3] = [Self::None, Self::Light, Self::Heavy];

    /// `none`, `light` or `heavy`, as on the command line and in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Light => "light",
            Self::Heavy => "heavy",
        }
    }

    /// The rain's rate and drop size; `None` for dry air.
    #[must_use]
    pub fn rain(self) -> Option<PaperRain> {
        match self {
            Self::None => None,
            Self::Light => Some(PaperRain::LIGHT),
            Self::Heavy => Some(PaperRain::HEAVY),
        }
    }

    /// The drops in the air; `None` for dry air.
    ///
    /// # Errors
    /// Does not occur: both kinds of rain are in range.
    pub fn drops(self) -> Result<Option<Drops>, RainError> {
        self.rain().map(|rain| rain.drops()).transpose()
    }
}

impl fmt::Display for Rainfall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heavier_rain_falls_at_a_higher_rate_and_dry_air_has_no_drops() {
        let rate = |rainfall: Rainfall| {
            rainfall.drops().unwrap().map_or(0.0, |drops| drops.rate_mm_per_h())
        };
        let [none, light, heavy] = Rainfall::ALL.map(rate);
        assert!(none == 0.0 && none < light && light < heavy, "{none} {light} {heavy}");
        assert_eq!(Rainfall::ALL.map(Rainfall::name), ["none", "light", "heavy"]);
    }
}
