//! The veil: light that reaches the detector without having seen the target.
//!
//! Two sources, both uniform over the image: drops in the LEDs' own beams scatter some of it straight back, and drops
//! in daylight glow. In a differential measurement the first adds a constant to every pixel, the second nothing but
//! its shot noise.

use super::{BackwardLobe, Medium, RainError, ensure};
use crate::Projector;
use std::f64::consts::PI;

/// Steps of the integral along the path.
const STEPS: usize = 500;

/// Light from the air between camera and target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Veil {
    /// Light that comes back from the drops in one LED's beam, over that from a white target.
    pub backscatter: f64,
    /// Daylight that the drops send into the detector, over that from a white target: `albedo (1 - exp(-cL))`, the
    /// radiance of a scattering volume in uniform light (the paper's `L_b (1 - exp(-beta z))`).
    pub airlight: f64,
}

impl Veil {
    /// The veil before a target at `distance_mm`, the detector `baseline_mm` beside the projector, both aimed at the
    /// target's centre.
    ///
    /// The lidar equation: a slab dz at z returns `beta(theta) / z^2 dz` of the beam where a white (Lambertian) target
    /// returns `1 / (pi L^2)`. Collector and projector seen from z are `atan(baseline / z)` apart, so that the drops
    /// scatter by theta, that much less than 180 degrees: 172 to 178 in the stretches that count. Near the camera the
    /// detector does not see the beam: the squares that they cover, as wide as the field at z, are
    /// `baseline (1 - z / L)` apart. `backward` is `None` in dry air.
    ///
    /// # Errors
    /// [`RainError::Setting`] for lengths that are not positive.
    pub fn new(
        medium: &Medium,
        backward: Option<&BackwardLobe>,
        projector: &Projector,
        distance_mm: f64,
        baseline_mm: f64,
    ) -> Result<Self, RainError> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        ensure(positive(distance_mm), "distance", distance_mm, "a positive number of mm")?;
        ensure(positive(baseline_mm), "baseline", baseline_mm, "a positive number of mm")?;
        let step = distance_mm / STEPS as f64;
        let ratio: f64 = (0..STEPS)
            .map(|i| {
                let z = (i as f64 + 0.5) * step;
                let apart = baseline_mm * (1.0 - z / distance_mm);
                let overlap = (1.0 - apart / projector.field_mm(z)).max(0.0);
                let less_path = medium.transmission(2e-3 * (z - distance_mm));
                let angle_rad = PI - (baseline_mm / z).atan();
                let phase = backward.map_or(0.0, |lobe| lobe.phase(angle_rad));
                phase * overlap * (distance_mm / z).powi(2) * less_path
            })
            .sum();
        let path_m = distance_mm * 1e-3;
        Ok(Self {
            // beta = b p / (4 pi)
            backscatter: medium.scattering_per_m / 4.0 * ratio * step * 1e-3,
            airlight: medium.albedo() * (1.0 - medium.transmission(path_m)),
        })
    }
}
