//! The material of particles in the air: the complex refractive index by wavelength.

use crate::mie::Index;
use crate::water::{Water, WavelengthError};

/// Material of drops, droplets or grains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Substance {
    /// Liquid water.
    Water(Water),
    /// Soot of flames, by the dispersion formula of Chang and Charalampopoulos (Proc. R. Soc. A
    /// 430, 577, 1990; measured from 0.4 to 30 um).
    Soot,
    /// One measured or assumed index at every wavelength.
    Fixed(Index),
}

impl Default for Substance {
    fn default() -> Self {
        Self::Water(Water::default())
    }
}

impl From<Water> for Substance {
    fn from(water: Water) -> Self {
        Self::Water(water)
    }
}

impl Substance {
    /// The index at a wavelength.
    ///
    /// # Errors
    /// [`WavelengthError`] for water outside its tables. The same limits apply to soot.
    pub fn index(self, wavelength_nm: f64) -> Result<Index, WavelengthError> {
        match self {
            Self::Water(table) => table.index(wavelength_nm),
            Self::Soot => {
                // Refuses wavelengths for which the formula was not measured.
                Water::default().index(wavelength_nm)?;
                let l = (wavelength_nm * 1e-3).ln();
                Ok(Index {
                    real: 1.811 + 0.1263 * l + 0.027 * l.powi(2) + 0.0417 * l.powi(3),
                    imaginary: 0.5821 + 0.1213 * l + 0.2309 * l.powi(2) - 0.01 * l.powi(3),
                })
            }
            Self::Fixed(index) => Ok(index),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_substance_has_its_index() {
        let water = Substance::default().index(1550.0).unwrap();
        assert_eq!(water, Water::Segelstein.index(1550.0).unwrap());
        // By hand: ln 1.55 = 0.43825.
        let soot = Substance::Soot.index(1550.0).unwrap();
        assert!((soot.real - 1.8751).abs() < 1e-3 && (soot.imaginary - 0.6788).abs() < 1e-3);
        let glass = Index { real: 1.5, imaginary: 0.0 };
        assert_eq!(Substance::Fixed(glass).index(9e9), Ok(glass));
        assert!(Substance::Soot.index(300.0).is_err());
    }
}
