//! Example measurements by the virtual camera, for trying the program without a camera.
//!
//! An example is marked as simulated, and the same seed gives the same numbers.

use crate::{
    CameraModel, ShotError, VirtualOptics, VirtualOpticsError, calibrate_against_white, shoot,
};
use nirspi::scene::SceneMap;
use nirspi::setup::MeasurementSetup;
use nirspi_recon::{Measurements, Order, RowsError};
use std::ops::ControlFlow;
use std::str::FromStr;
use thiserror::Error;

/// Edge of the drawing.
const SCENE_PX: usize = 256;
/// Distance of the lens's focus.
const DISTANCE_MM: f64 = 300.0;
/// Number of summed frames: 20 ms, as with the paper's camera.
const FRAMES: u32 = 244;

/// An example measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Example {
    /// A drawing of an insect's wing: a membrane with veins that are too fine for few patterns.
    Wing,
}

/// Why an example cannot be measured.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExampleError {
    /// The optics cannot be built.
    #[error(transparent)]
    Optics(#[from] VirtualOpticsError),
    /// The patterns cannot be set up.
    #[error(transparent)]
    Setup(#[from] RowsError),
    /// The virtual camera failed.
    #[error(transparent)]
    Shot(#[from] ShotError),
}

impl Example {
    /// Every value.
    pub const ALL: [Self; 1] = [Self::Wing];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Wing => "wing",
        }
    }

    /// The description in one line, for a list.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::Wing => {
                "a drawn insect's wing, all 1024 patterns of the virtual camera in zig-zag order"
            }
        }
    }

    /// Measures the example through the virtual camera.
    ///
    /// # Errors
    /// [`ExampleError`] if the virtual camera fails.
    pub fn measure(self, seed: u64) -> Result<Measurements, ExampleError> {
        let reflectance = match self {
            Self::Wing => wing(),
        };
        let name = self.name().to_owned();
        let map = SceneMap { name, size_px: SCENE_PX, reflectance, side_mm: None };
        let optics = VirtualOptics::before(CameraModel::paper(), &map, DISTANCE_MM)?;
        let settling = calibrate_against_white(&optics, seed)?;
        let setup = MeasurementSetup::new(&Order::ZigZag, 1.0)?;
        let shot =
            shoot(&optics, setup, &settling, FRAMES, seed, &mut |_| ControlFlow::Continue(()))?;
        Ok(shot.measurements()?)
    }
}

impl FromStr for Example {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|example| example.name() == name)
            .ok_or_else(|| format!("expected {}", Self::ALL.map(Self::name).join(", ")))
    }
}

/// A wing from its root at the lower left to its tip at the upper right, as reflectance.
fn wing() -> Vec<f32> {
    const GROUND: f32 = 0.05;
    const MEMBRANE: f32 = 0.35;
    const VEIN: f32 = 0.9;
    let at = |p: usize| {
        let [x, y] = [p % SCENE_PX, p / SCENE_PX].map(|c| 2.0 * c as f64 / SCENE_PX as f64 - 1.0);
        // Position along the wing from 0 to 1, and across as a share of the half width at that
        // position.
        let (along, across) = ((x - y) / 3.2 + 0.5, (x + y) / 1.3);
        if !(0.0..1.0).contains(&along) {
            return GROUND;
        }
        let half_width = 0.75 * (std::f64::consts::PI * along.powf(0.7)).sin().max(0.0).powf(0.6);
        let share = across / half_width.max(1e-9);
        let near = |distance: f64| distance.abs() < 0.035;
        let is_vein = [-1.0, -0.55, -0.1, 0.4, 1.0].iter().any(|&s| near((share - s) * half_width))
            || [0.25, 0.42, 0.58, 0.75].iter().any(|&t| near((along - t - 0.05 * share) * 1.6));
        match share.abs() <= 1.03 {
            true if is_vein => VEIN,
            true => MEMBRANE,
            false => GROUND,
        }
    };
    (0..SCENE_PX * SCENE_PX).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_recon::metrics::correlation;
    use nirspi_recon::reconstruct::hadamard;

    #[test]
    fn the_wing_is_measured_whole_and_looks_like_its_drawing() {
        let measured = Example::Wing.measure(1).unwrap();
        assert_eq!(measured.rows().len(), 1024);
        let image = hadamard(&measured);
        let (drawn, block) = (wing(), SCENE_PX / 32);
        let seen: Vec<f32> = (0..1024)
            .map(|p| {
                let pixels = (0..block * block).map(|q| {
                    let (r, c) = (p / 32 * block + q / block, p % 32 * block + q % block);
                    drawn[r * SCENE_PX + c]
                });
                pixels.sum::<f32>()
            })
            .collect();
        let likeness = correlation(&seen, image.pixels(), 32, 32).unwrap();
        assert!(likeness > 0.9, "{likeness}");
    }

    #[test]
    fn names_are_read_as_they_are_written() {
        for example in Example::ALL {
            assert_eq!(example.name().parse(), Ok(example));
        }
        assert_eq!("bee".parse::<Example>(), Err("expected wing".to_owned()));
    }
}
