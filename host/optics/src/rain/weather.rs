//! The effects of one weather on light of one wavelength, computed once for any distance.

use super::{
    BackwardLobe, BlurKernel, Drops, ForwardBlur, Medium, RainError, ScatteringAngles, Veil, Window,
};
use crate::mie::Index;
use crate::substance::Substance;
use crate::{Projector, SIDE};

/// The particles in the air and on the window, and their effects on light.
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

    /// The same weather behind a window with drops of water.
    ///
    /// # Errors
    /// [`RainError::Wavelength`] if water's index is not known.
    pub fn behind(mut self, window: Window) -> Result<Self, RainError> {
        let water = Substance::default().index(self.medium.wavelength_nm)?;
        self.window = Some((window, water));
        Ok(self)
    }

    /// The particles in the air.
    #[must_use]
    pub fn drops(&self) -> &Drops {
        &self.drops
    }

    /// Optical coefficients.
    #[must_use]
    pub fn medium(&self) -> &Medium {
        &self.medium
    }

    /// The same weather with another extinction, and scattering and absorption in proportion, for
    /// finding the extinction that a result would need.
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

    /// The point-spread function of light on its path to a target.
    ///
    /// # Errors
    /// As [`ForwardBlur::new`].
    pub fn blur(&self, distance_mm: f64) -> Result<ForwardBlur, RainError> {
        ForwardBlur::new(self.medium, self.angles.clone(), distance_mm)
    }

    /// Light from the air in front of a target.
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

    /// Share of the light that crosses the window outside its drops.
    #[must_use]
    pub fn clear(&self) -> f64 {
        self.window.map_or(1.0, |(window, _)| window.clear())
    }

    /// The effect of the drops on the window on a point-spread function, for a target at
    /// `distance_mm` with a field of `field_mm`.
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

    /// The image of an ordinary camera of a target in daylight, with white as 1: the target through
    /// the air and the window, light scattered from the surroundings, and daylight scattered by the
    /// air. `reflectance` is 32 x 32, row-major, over a field of `field_mm`. Daylight on the target
    /// is that of clear air.
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
