//! What is known of an image's readings: the method that made the image, and their noise.

use nirspi_recon::Measurements;
use nirspi_recon::reconstruct::{Method, MethodSettings};

/// How the readings of an image were taken and the image was made, as the intervals need it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownReadings {
    /// The method that made the image, with its default settings.
    pub method: Method,
    /// Standard deviation of the noise of a pixel of the plain transform of all patterns, in the
    /// units of the image: the noise of one value (pattern minus complement) divided by the side of
    /// the image.
    pub noise: f32,
}

impl KnownReadings {
    /// The readings of an image that `method` made of `measurements`, whose values have the noise
    /// `noise` (a standard deviation, in their own units, as the camera measured it). `None` if the
    /// noise is not known, or the settings are not the method's defaults: there is no interval for
    /// either.
    #[must_use]
    pub fn new(
        method: Method,
        settings: &MethodSettings,
        measurements: &Measurements,
        noise: Option<f64>,
    ) -> Option<Self> {
        // The backend changes rounding alone.
        let default = MethodSettings {
            backend: settings.backend,
            network: settings.network.as_ref().map(|_| nirspi_nets::prior::shipped()),
            ..MethodSettings::default()
        };
        let side = measurements.side().pixels() as f64;
        let noise = noise.filter(|noise| *noise >= 0.0 && settings.taken_by(method) == default)?;
        Some(Self { method, noise: (noise / side) as f32 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_recon::reconstruct::Strength;
    use nirspi_recon::{Rows, Side};

    #[test]
    fn readings_of_unknown_noise_and_of_other_settings_are_not_known() {
        let rows = Rows::natural(Side::INSTRUMENT);
        let measured = Measurements::from_differential(&rows, &[1.0; 1024]).unwrap();
        let default = MethodSettings {
            network: Some(nirspi_nets::prior::shipped()),
            ..MethodSettings::default()
        };
        let of = |settings: &MethodSettings, noise| {
            KnownReadings::new(Method::TIKHONOV, settings, &measured, noise)
        };
        let known = of(&default, Some(64.0)).unwrap();
        assert_eq!((known.method, known.noise), (Method::TIKHONOV, 2.0));
        assert_eq!(of(&default, None), None);
        assert_eq!(of(&default, Some(f64::NAN)), None);
        let strong = MethodSettings { strength: Strength::Fixed(3.0), ..default };
        assert_eq!(of(&strong, Some(64.0)), None);
    }
}
