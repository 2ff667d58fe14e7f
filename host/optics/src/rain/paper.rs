//! The two kinds of rain of the paper's Table 2. Each has one drop size.

use super::{Drops, RainError};

/// Rain of drops of one diameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PaperRain {
    /// Rain rate.
    pub rate_mm_per_h: f64,
    /// Diameter of every drop.
    pub drop_mm: f64,
}

impl PaperRain {
    /// Light rain.
    pub const LIGHT: Self = Self { rate_mm_per_h: 1.93, drop_mm: 0.5 };

    /// Heavy rain.
    pub const HEAVY: Self = Self { rate_mm_per_h: 5.6, drop_mm: 2.0 };

    /// The drops in the air.
    ///
    /// # Errors
    /// As [`Drops::monodisperse`]; neither [`LIGHT`](Self::LIGHT) nor [`HEAVY`](Self::HEAVY) fails.
    pub fn drops(&self) -> Result<Drops, RainError> {
        Drops::monodisperse(self.rate_mm_per_h, self.drop_mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_kinds_of_rain_fall_at_their_rate() {
        for rain in [PaperRain::LIGHT, PaperRain::HEAVY] {
            let rate = rain.drops().unwrap().rate_mm_per_h();
            assert!((rate / rain.rate_mm_per_h - 1.0).abs() < 1e-9, "{rate}");
        }
    }
}
