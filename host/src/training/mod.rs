//! What training needs of the instrument: characters from files and fonts, and pictures taken by the virtual camera.
//!
//! The one law: a picture to train on goes the way of a measured one. Light, receiver, calibration and reconstruction
//! are those of the virtual camera; what is left out for speed (packets, the firmware's states) changes no number.

mod camera;
pub mod fonts;
pub mod pairs;

pub use camera::{CameraPicture, Conditions, LinearCamera, TrainingCameraError};
pub use nirspi_optics::rain::Rainfall;

use nirspi_nets::degrade::{AnalyticCamera, Degrade, DegradeError, Reading};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

/// Pictures by the virtual camera and by formulas, mixed.
pub struct Mixed {
    /// The formulas.
    pub analytic: AnalyticCamera,
    /// The camera, and the share of the pictures that it takes.
    pub camera: Option<(LinearCamera, f32)>,
}

impl Degrade for Mixed {
    fn degrade(&self, scene: &[f32], rng: &mut Pcg64Mcg) -> Result<Reading, DegradeError> {
        match &self.camera {
            Some((camera, share)) if rng.random::<f32>() < *share => camera.degrade(scene, rng),
            _ => self.analytic.degrade(scene, rng),
        }
    }
}
