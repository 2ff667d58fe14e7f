//! Training data from the instrument: characters from files and fonts, and pictures of the virtual
//! camera.
//!
//! # Invariant
//! A training picture is made as a measured picture is. Light, receiver, calibration and
//! reconstruction are those of the virtual camera. The parts that are left out for speed (packets,
//! the firmware's states) change no number
//! (`camera::tests::a_picture_by_the_short_way_differs_from_a_capture_by_noise_alone`).

mod camera;
pub mod fonts;
pub mod pairs;

pub use camera::{CameraMeasurement, CameraPicture, Conditions, LinearCamera, TrainingCameraError};
pub use nirspi_optics::rain::Rainfall;

use nirspi_nets::degrade::{AnalyticCamera, Degrade, DegradeError, Reading};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

/// A mixture of pictures by the virtual camera and by formulas.
pub struct Mixed {
    /// The formulas.
    pub analytic: AnalyticCamera,
    /// The camera, and the share of pictures that it takes.
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
