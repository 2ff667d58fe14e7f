//! Everything that one kind of weather does to light of one wavelength, worked out once and asked at any distance.

use super::{
    BackwardLobe, BlurKernel, Drops, ForwardBlur, Medium, RainError, ScatteringAngles, Veil, Window,
};
use crate::mie::Index;
use crate::substance::Substance;
use crate::{Projector, SIDE};

/// What is in the air and on the window, what it takes out of light, and where it sends it.
#[derive(Debug, Clone)]
pub struct Weather {
    drops: Drops,
    medium: Medium,
    angles: Option<ScatteringAngles>,
    backward: Option<BackwardLobe>,
    /// Drops on the window, and water's index.
    window: Option<(Window, Index)>,
}

impl Weather {
    /// This weather for light of `wavelength_nm`.
    ///
    /// # Errors
    /// As [`Medium::new`].
    pub fn new(
        drops: Drops,
        wavelength_nm: f64,
        substance: impl Into<Substance>,
    ) -> Result<Self, RainError> {
        let substance = substance.into();
        let medium = Medium::new(&drops, wavelength_nm, substance)?;
        let (angles, backward) = match drops.is_empty() {
            true => (None, None),
            false => (
                Some(ScatteringAngles::new(&drops, wavelength_nm, substance)?),
                Some(BackwardLobe::new(&drops, wavelength_nm, substance)?),
            ),
        };
        Ok(Self { drops, medium, angles, backward, window: None })
    }

    /// The same behind a window with drops of water on it.
    ///
    /// # Errors
    /// [`RainError::Wavelength`] where water's index is not known.
    pub fn behind(mut self, window: Window) -> Result<Self, RainError> {
        let water = Substance::default().index(self.medium.wavelength_nm)?;
        self.window = Some((window, water));
        Ok(self)
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
        let scattered = self.backward.as_ref().zip(self.angles.as_ref());
        let veil = Veil::new(&self.medium, scattered, projector, distance_mm, baseline_mm)?;
        let clear = self.clear();
        Ok(Veil { backscatter: veil.backscatter * clear * clear, airlight: veil.airlight * clear })
    }

    /// Share of the light that crosses the window beside the drops on it.
    #[must_use]
    pub fn clear(&self) -> f64 {
        self.window.map_or(1.0, |(window, _)| window.clear())
    }

    /// What the drops on the window do to a point-spread function, on a target at `distance_mm` on which the field is
    /// `field_mm` wide.
    pub(super) fn through_window(
        &self,
        kernel: BlurKernel,
        distance_mm: f64,
        field_mm: f64,
    ) -> BlurKernel {
        let Some((window, water)) = self.window else { return kernel };
        let disc_px = window.disc_mm(distance_mm, water) / field_mm * SIDE as f64;
        kernel.behind_drops(window.covered, disc_px)
    }

    /// What an ordinary camera sees of a target in daylight, white being 1: the target through the air and the window, light
    /// scattered from around, and daylight that the air scatters. `reflectance` is 32 x 32, row-major, over a field of
    /// `field_mm`. Daylight on the target is that of clear air.
    ///
    /// # Errors
    /// As [`Self::blur`].
    pub fn by_daylight(
        &self,
        reflectance: &[f32],
        distance_mm: f64,
        field_mm: f64,
    ) -> Result<Vec<f64>, RainError> {
        let blur = self.blur(distance_mm)?;
        let kernel =
            self.through_window(blur.kernel(field_mm / SIDE as f64), distance_mm, field_mm);
        let own = kernel.unscattered + kernel.scattered(0, 0);
        let halo = kernel.without_own(f64::INFINITY).halo(reflectance);
        let scattered = 1.0 - self.medium.transmission(distance_mm * 1e-3);
        let airlight = self.medium.albedo() * scattered * self.clear();
        let seen = |(&r, halo): (&f32, f64)| f64::from(r) * own + halo + airlight;
        Ok(reflectance.iter().zip(halo).map(seen).collect())
    }
}
