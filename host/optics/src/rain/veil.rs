//! The veil: light that reaches the detector without reaching the target.
//!
//! There are two sources, both uniform over the image. Drops in the LEDs' beams scatter light
//! straight back. Drops in daylight glow. In a differential measurement the first source adds a
//! constant to every pixel, and the second source adds only its shot noise.

use super::follow::Slab;
use super::{BackwardLobe, Medium, RainError, ScatteringAngles, blur, ensure};
use crate::Projector;
use std::f64::consts::PI;

/// Steps of the integral along the path.
const STEPS: usize = 500;

/// Seed of the simulated photons: the same air gives the same veil.
const SEED: u64 = 2;

/// Light from the air between camera and target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Veil {
    /// Light from the drops in one LED's beam, divided by that from a white target in dry air.
    pub backscatter: f64,
    /// Daylight that the drops scatter into the detector, divided by that from a white target in
    /// dry air: `albedo (1 - exp(-cL))`, the radiance of a scattering volume in uniform light (the
    /// paper's `L_b (1 - exp(-beta z))`).
    pub airlight: f64,
}

impl Veil {
    /// The veil in front of a target at `distance_mm`. The detector is `baseline_mm` beside the
    /// projector, and both aim at the target's centre.
    ///
    /// By the lidar equation, a slab dz at z returns `beta(theta) / z^2 dz` of the beam, and a
    /// white (Lambertian) target returns `1 / (pi L^2)`. Seen from z, collector and projector are
    /// `atan(baseline / z)` apart, so the scattering angle theta is smaller than 180 degrees by
    /// this angle: 172 to 178 degrees in the relevant stretches. Close to the camera the detector
    /// does not see the beam: the squares that the two fields cover, as wide as the field at z, are
    /// `baseline (1 - z / L)` apart. `scattered` is `None` in dry air.
    ///
    /// In air too dense for single scattering, single photons are simulated instead (module
    /// `follow`).
    ///
    /// # Errors
    /// [`RainError::Setting`] for lengths that are not positive.
    pub fn new(
        medium: &Medium,
        scattered: Option<(&BackwardLobe, &ScatteringAngles)>,
        projector: &Projector,
        distance_mm: f64,
        baseline_mm: f64,
    ) -> Result<Self, RainError> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        ensure(positive(distance_mm), "distance", distance_mm, "a positive number of mm")?;
        ensure(positive(baseline_mm), "baseline", baseline_mm, "a positive number of mm")?;
        let path_m = distance_mm * 1e-3;
        let airlight = medium.albedo() * (1.0 - medium.transmission(path_m));
        if let Some((lobe, angles)) = scattered.filter(|_| blur::is_dense(medium, distance_mm)) {
            let slab = Slab { medium, angles, distance_mm };
            let field_mm = projector.field_mm(distance_mm);
            return Ok(Self {
                backscatter: slab.backscatter(lobe, baseline_mm, field_mm, SEED),
                airlight,
            });
        }
        let step = distance_mm / STEPS as f64;
        let ratio: f64 = (0..STEPS)
            .map(|i| {
                let z = (i as f64 + 0.5) * step;
                let apart = baseline_mm * (1.0 - z / distance_mm);
                let overlap = (1.0 - apart / projector.field_mm(z)).max(0.0);
                let kept = medium.transmission(2e-3 * z);
                let angle_rad = PI - (baseline_mm / z).atan();
                let phase = scattered.map_or(0.0, |(lobe, _)| lobe.phase(angle_rad));
                phase * overlap * (distance_mm / z).powi(2) * kept
            })
            .sum();
        Ok(Self {
            // beta = b p / (4 pi)
            backscatter: medium.scattering_per_m / 4.0 * ratio * step * 1e-3,
            airlight,
        })
    }
}
