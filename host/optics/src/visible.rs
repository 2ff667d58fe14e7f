//! An ordinary camera in daylight, for comparison: the visible ("VIS") rows of the paper's tables.
//!
//! Field, grid of 32 x 32, distance, daylight and drops are those of the single-pixel camera, so
//! that only the light differs and not the geometry. The paper does not name its camera; this is a
//! small industrial camera, focused on the target.
//!
//! A drop in front of a pixel shows a wide view of the surroundings instead of the target behind
//! the drop, with 0.94 of the average brightness of the surroundings (Garg and Nayar, Int. J.
//! Comput. Vis. 75, 3, 2007). The surroundings are a sky as bright as a white target.

use crate::rain::{Air, BeamShadows, Drops, FallingDrops, RainError};
use crate::{LEDS, Projector, ProjectorError, Scene};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use thiserror::Error;

/// Brightness of a drop divided by that of its surroundings.
const DROP_BRIGHTNESS: f64 = 0.94;

/// Energy of a photon at 555 nm, where a watt is 683 lumen, in J.
const PHOTON_J: f64 = 3.579e-19;

/// Lumen per watt at 555 nm (SI, exact).
const LUMEN_PER_WATT: f64 = 683.0;

/// Wavelength for computing fog, smoke and dust, in nm.
const WAVELENGTH_NM: f64 = 550.0;

/// Number of updates of the drops during one exposure.
const LOOKS: usize = 8;

/// Why the picture cannot be computed.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum VisibleError {
    /// Scene or distance.
    #[error(transparent)]
    Projector(#[from] ProjectorError),
    /// Weather.
    #[error(transparent)]
    Rain(#[from] RainError),
}

/// A camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VisibleCamera {
    /// Diameter of the lens, in mm.
    pub aperture_mm: f64,
    /// f-number.
    pub f_number: f64,
    /// Edge of a sensor pixel, in um.
    pub pixel_um: f64,
    /// Electrons per photon.
    pub quantum_efficiency: f64,
    /// Electrons of a white target, of a full well of about 10 000.
    pub white_electrons: f64,
    /// Read noise, in electrons rms.
    pub read_noise_electrons: f64,
    /// Illuminance, in klx (paper: 15).
    pub daylight_klx: f64,
}

impl Default for VisibleCamera {
    fn default() -> Self {
        Self {
            aperture_mm: 2.9,
            f_number: 2.8,
            pixel_um: 5.0,
            quantum_efficiency: 0.6,
            white_electrons: 7000.0,
            read_noise_electrons: 5.0,
            daylight_klx: 15.0,
        }
    }
}

impl VisibleCamera {
    /// Exposure that a white target needs, in s. The illuminance on the sensor is `E / (4 N^2)`
    /// (glass of 0.9).
    #[must_use]
    pub fn exposure_s(&self) -> f64 {
        let on_sensor_lx = self.daylight_klx * 1e3 * 0.9 / (4.0 * self.f_number.powi(2));
        let photons_per_m2_s = on_sensor_lx / LUMEN_PER_WATT / PHOTON_J;
        let area_m2 = (self.pixel_um * 1e-6).powi(2);
        self.white_electrons / (photons_per_m2_s * area_m2 * self.quantum_efficiency)
    }

    /// A picture of `scene` at `distance_mm` in this weather, 32 x 32 over the field of
    /// `projector`: reflectance as reported by the camera, with white as 1. Seeded.
    ///
    /// # Errors
    /// [`VisibleError`] for a distance or rain that is not possible.
    pub fn picture(
        &self,
        scene: &Scene,
        projector: &Projector,
        distance_mm: f64,
        air: &Air,
        seed: u64,
    ) -> Result<Vec<f32>, VisibleError> {
        // The picture is sharp where the projector is out of focus, because the camera is focused
        // on the target.
        let sharp =
            Projector { aperture_mm: 1e-3, emitter_mm: projector.led_pitch_mm, ..*projector };
        let footprint = sharp.footprint(scene, distance_mm)?;
        let beams = BeamShadows {
            projector: sharp,
            distance_mm,
            baseline_mm: 1e-3,
            collector_mm: self.aperture_mm,
        };
        let field_mm = projector.field_mm(distance_mm);
        let hanging = air.hanging(WAVELENGTH_NM)?;
        let through = hanging.by_daylight(footprint.weights(), distance_mm, field_mm)?;
        // Droplets that stay in the air are not simulated one by one: they are too many, and `through` has their effect.
        let drops = if air.drops().fall() { air.drops().clone() } else { Drops::none() };
        let mut falling = FallingDrops::new(&drops, beams, seed)?;
        let mut seen = vec![0.0; LEDS];
        for _ in 0..LOOKS {
            falling.advance(self.exposure_s() / LOOKS as f64);
            for (sum, look) in seen.iter_mut().zip(falling.seen()) {
                *sum += f64::from(look) / LOOKS as f64;
            }
        }
        let mut rng = Pcg64Mcg::seed_from_u64(seed ^ 0x5EED);
        Ok(through
            .into_iter()
            .zip(seen)
            .map(|(target, seen)| {
                let light = target * seen + DROP_BRIGHTNESS * (1.0 - seen);
                let electrons = light * self.white_electrons;
                let noise = (electrons + self.read_noise_electrons.powi(2)).sqrt();
                let found = electrons + noise * rng.sample::<f64, _>(StandardNormal);
                (found / self.white_electrons) as f32
            })
            .collect())
    }
}
