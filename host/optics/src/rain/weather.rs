//! Everything that one kind of weather does to light of one wavelength, worked out once and asked at any distance.

use super::{BackwardLobe, Drops, ForwardBlur, Medium, RainError, ScatteringAngles, Veil};
use crate::Projector;
use crate::water::Water;

/// Drops, what they take out of light, and where they send it.
#[derive(Debug, Clone)]
pub struct Weather {
    drops: Drops,
    medium: Medium,
    angles: Option<ScatteringAngles>,
    backward: Option<BackwardLobe>,
}

impl Weather {
    /// This weather for light of `wavelength_nm`.
    ///
    /// # Errors
    /// As [`Medium::new`].
    pub fn new(drops: Drops, wavelength_nm: f64, water: Water) -> Result<Self, RainError> {
        let medium = Medium::new(&drops, wavelength_nm, water)?;
        let (angles, backward) = match drops.is_empty() {
            true => (None, None),
            false => (
                Some(ScatteringAngles::new(&drops, wavelength_nm, water)?),
                Some(BackwardLobe::new(&drops, wavelength_nm, water)?),
            ),
        };
        Ok(Self { drops, medium, angles, backward })
    }

    /// What is in the air.
    #[must_use]
    pub fn drops(&self) -> &Drops {
        &self.drops
    }

    /// Optical coefficients.
    #[must_use]
    pub fn medium(&self) -> &Medium {
        &self.medium
    }

    /// The same weather with another extinction, scattering and absorption in proportion: for asking what would have
    /// to be assumed.
    #[must_use]
    pub fn with_extinction(mut self, extinction_per_m: f64) -> Self {
        if self.medium.extinction_per_m > 0.0 {
            let factor = extinction_per_m / self.medium.extinction_per_m;
            self.medium.extinction_per_m *= factor;
            self.medium.scattering_per_m *= factor;
            self.medium.absorption_per_m *= factor;
            self.medium.backscatter_per_m_sr *= factor;
        }
        self
    }

    /// The point-spread function of light on its way to a target.
    ///
    /// # Errors
    /// As [`ForwardBlur::new`].
    pub fn blur(&self, distance_mm: f64) -> Result<ForwardBlur, RainError> {
        ForwardBlur::new(self.medium, self.angles.clone(), distance_mm)
    }

    /// Light from the air before a target.
    ///
    /// # Errors
    /// As [`Veil::new`].
    pub fn veil(
        &self,
        projector: &Projector,
        distance_mm: f64,
        baseline_mm: f64,
    ) -> Result<Veil, RainError> {
        Veil::new(&self.medium, self.backward.as_ref(), projector, distance_mm, baseline_mm)
    }
}
