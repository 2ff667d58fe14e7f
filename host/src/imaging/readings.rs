//! What is known of an image's readings: the method that made the image, and their noise.

use super::MethodReport;
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
    /// The readings of an image in the units of `measurements`, of which the method of this report
    /// made it with these settings. `None` if the noise of the readings is not known, if the
    /// settings are not the method's defaults, or if the image started from the images before it:
    /// there is no interval for these.
    #[must_use]
    pub fn new(
        report: &MethodReport,
        settings: &MethodSettings,
        measurements: &Measurements,
    ) -> Option<Self> {
        let method = report.used();
        // The backend changes rounding alone.
        let default = MethodSettings {
            backend: settings.backend,
            network: settings.network.as_ref().map(|_| nirspi_nets::prior::shipped()),
            ..MethodSettings::default()
        };
        let side = measurements.side().pixels() as f64;
        let is_calibrated = !report.made.warm && settings.taken_by(method) == default;
        let noise = measurements.noise().filter(|_| is_calibrated)?;
        Some(Self { method, noise: (noise / side) as f32 })
    }

    /// The readings of the same image in shares of `white`, a level in its units.
    #[must_use]
    pub fn in_shares_of(self, white: f32) -> Self {
        Self { noise: self.noise / white, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_recon::reconstruct::{Report, Strength};
    use nirspi_recon::{Rows, Side};

    #[test]
    fn only_readings_of_a_known_noise_by_a_calibrated_method_are_known() {
        let rows = Rows::natural(Side::INSTRUMENT);
        let unknown = Measurements::from_differential(&rows, &[1.0; 1024]).unwrap();
        let measured = unknown.clone().with_noise(64.0).unwrap();
        let default = MethodSettings {
            network: Some(nirspi_nets::prior::shipped()),
            ..MethodSettings::default()
        };
        let strong = MethodSettings { strength: Strength::Fixed(3.0), ..default.clone() };
        let report = |method| MethodReport { method, made: Report::new("") };
        let plain = report(Method::TIKHONOV);
        let known = KnownReadings::new(&plain, &default, &measured).unwrap();
        assert_eq!((known.method, known.noise), (Method::TIKHONOV, 2.0));
        assert_eq!(known.in_shares_of(8.0).noise, 0.25);
        assert_eq!(KnownReadings::new(&plain, &default, &unknown), None);
        assert_eq!(KnownReadings::new(&plain, &strong, &measured), None);
        // The method that was chosen made the image, and not the one that chose.
        let mut chosen = report(Method::AUTO);
        chosen.made.chosen = Some(Method::OMP.argument());
        assert_eq!(KnownReadings::new(&chosen, &default, &measured).unwrap().method, Method::OMP);
        let mut warm = plain;
        warm.made.warm = true;
        assert_eq!(KnownReadings::new(&warm, &default, &measured), None);
    }
}
