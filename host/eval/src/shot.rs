//! One picture of the virtual camera, from light to image, and one of an ordinary camera.

use crate::DISTANCES_M;
use crate::error::{EvalError, Result};
use nirspi::calibration::FlatField;
use nirspi::capture::{Capture, Progress};
use nirspi::response::Settling;
use nirspi::setup::MeasurementSetup;
use nirspi_optics::rain::Air;
use nirspi_optics::visible::VisibleCamera;
use nirspi_optics::{CameraModel, Scene};
use nirspi_recon::{Image, Order, Side, reconstruct};
use nirspi_virtual::{self, VirtualOptics};
use std::ops::ControlFlow;

/// The conditions of a picture.
#[derive(Debug, Clone, Copy)]
pub struct Conditions<'a> {
    /// Distance of the target.
    pub distance_m: f64,
    /// The weather between camera and target.
    pub air: &'a Air,
    /// Number of differential sweeps to sum.
    pub frames: u32,
}

/// How the pictures of a table are taken.
#[derive(Debug, Clone, PartialEq)]
pub struct Exposure {
    /// The weather between camera and target.
    pub air: Air,
    /// Number of differential sweeps summed into a picture.
    pub frames: u32,
    /// Seed of the first picture.
    pub seed: u64,
}

/// Settings of Tables 3 and 4.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Number of scenes at each distance, at least two; of Table 4 pictures of the edge, at least 10.
    pub scenes: u32,
    /// The camera.
    pub camera: CameraModel,
    /// The exposure of the pictures.
    pub exposure: Exposure,
    /// Steps of the ancestral sampler, the paper's method; 0 leaves out its row. The paper has 500.
    pub ancestral_steps: u32,
}

/// The pictures of both cameras of one scene.
pub struct Shots {
    /// The image of a perfect camera of 32 x 32 pixels.
    pub truth: Vec<f32>,
    /// The image of a perfect camera of 64 x 64 pixels.
    pub truth_fine: Vec<f32>,
    /// The single-pixel camera's picture, in ADC counts.
    pub nir_spi: Image,
    /// The ordinary camera's picture.
    pub vis: Image,
}

/// The virtual camera with its latency, settling and flat field, measured once against a white
/// sheet.
#[derive(Debug, Clone)]
pub struct CalibratedCamera {
    model: CameraModel,
    settling: Settling,
    flat_field: Option<FlatField>,
}

impl CalibratedCamera {
    /// Calibrates the camera.
    ///
    /// # Errors
    /// [`EvalError`] for a burst that cannot be measured.
    pub fn new(model: &CameraModel, seed: u64) -> Result<Self> {
        // The scene does not matter, because a white sheet replaces it.
        let optics = VirtualOptics::of(model, Scene::white(), 1e3 * DISTANCES_M[0])?;
        let settling = nirspi_virtual::calibrate_against_white(&optics, seed)?;
        let flat_field = nirspi_virtual::flat_field_against_white(&optics, &settling, seed)?;
        Ok(Self { model: model.clone(), settling, flat_field })
    }

    /// The camera's description.
    #[must_use]
    pub fn model(&self) -> &CameraModel {
        &self.model
    }

    /// Takes `scene` with this camera and with an ordinary one.
    ///
    /// # Errors
    /// [`EvalError`] for a scene or distance that the optics refuse, or a capture that fails.
    pub fn shoot(&self, scene: Scene, conditions: Conditions<'_>, seed: u64) -> Result<Shots> {
        let distance_mm = conditions.distance_m * 1e3;
        let visible = VisibleCamera::default().picture(
            &scene,
            &self.model.projector(),
            distance_mm,
            conditions.air,
            seed,
        )?;
        let optics = VirtualOptics::of(&self.model, scene, distance_mm)?.in_air(conditions.air)?;
        let setup = optics.setup(&Order::Natural, 1.0)?;
        let captured = self.record(&optics, setup, conditions.frames, seed)?;
        let measurements =
            captured.integrated.measurements(&captured.setup, captured.settling.as_ref(), false)?;
        let image = reconstruct::hadamard(&measurements);
        let nir_spi = match &self.flat_field {
            Some(flat) => flat.correct(&image),
            None => image,
        };
        Ok(Shots {
            truth: optics.focused_footprint()?.weights().to_vec(),
            truth_fine: optics.focused(64),
            nir_spi,
            vis: Image::new(Side::INSTRUMENT, visible),
        })
    }

    /// The counts of a pixel that sees a white sheet under these conditions: the scale of images,
    /// as a user would measure it.
    ///
    /// # Errors
    /// [`EvalError`] for a sheet that reflects no light, or a capture that fails.
    pub fn white_level(&self, conditions: Conditions<'_>, seed: u64) -> Result<f32> {
        let image = self.shoot(Scene::white(), conditions, seed)?.nir_spi;
        let white = image.pixels().iter().sum::<f32>() / image.pixels().len() as f32;
        if white > 0.0 {
            return Ok(white);
        }
        Err(EvalError::Content(format!("a white sheet gives no light: {white} counts")))
    }

    /// One capture by the whole virtual camera: light, gateware model, firmware, packets, host.
    ///
    /// # Errors
    /// [`EvalError`] for a capture that fails.
    pub fn record(
        &self,
        optics: &VirtualOptics,
        setup: MeasurementSetup,
        frames: u32,
        seed: u64,
    ) -> Result<Capture> {
        let mut watch = |_: &Progress| ControlFlow::Continue(());
        let settling = &self.settling;
        Ok(nirspi_virtual::shoot(optics, setup, settling, frames, seed, &mut watch)?.capture)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_white_sheet_is_white_at_every_distance_though_it_gives_less_light() {
        let camera = CalibratedCamera::new(CameraModel::paper(), 1).unwrap();
        let air = &Air::dry();
        let at = |distance_m| Conditions { distance_m, air, frames: 20 };
        let [near, far] = [0.3, 1.0].map(|m| camera.white_level(at(m), 1).unwrap());
        assert!(near > 0.0 && far > 0.0, "{near} {far}");
        let field_mm = CameraModel::paper().projector().field_mm(300.0);
        let grey = Scene::new(vec![0.5], 1, field_mm).unwrap().with_surround(0.5).unwrap();
        let shots = camera.shoot(grey, at(0.3), 2).unwrap();
        let mean = |pixels: &[f32]| pixels.iter().sum::<f32>() / pixels.len() as f32;
        assert!((mean(shots.nir_spi.pixels()) / near - 0.5).abs() < 0.02, "{near}");
        assert!((mean(&shots.truth) - 0.5).abs() < 1e-3);
        assert_eq!((shots.truth.len(), shots.truth_fine.len()), (1024, 4096));
    }

    #[test]
    fn a_shot_follows_from_its_seed() {
        let camera = CalibratedCamera::new(CameraModel::paper(), 1).unwrap();
        let shot = |seed| {
            let scene = Scene::new(vec![0.2, 0.8, 0.8, 0.2], 2, 40.0).unwrap();
            let conditions = Conditions { distance_m: 0.3, air: &Air::dry(), frames: 20 };
            camera.shoot(scene, conditions, seed).unwrap().nir_spi
        };
        assert_eq!(shot(3).pixels(), shot(3).pixels());
        assert_ne!(shot(3).pixels(), shot(4).pixels());
    }
}
