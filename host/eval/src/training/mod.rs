//! Training data from the instrument: characters from files and fonts, and pictures of the virtual
//! camera.
//!
//! # Invariant
//! A training picture is made as a measured picture is. Light, receiver, calibration and
//! reconstruction are those of the virtual camera. The parts that are left out for speed (packets,
//! the firmware's states) change no number
//! (`camera::tests::a_picture_by_the_short_way_differs_from_a_capture_by_noise_alone`).

mod camera;
pub mod characters;
pub mod fonts;
pub mod pairs;

pub use camera::{CameraMeasurement, CameraPicture, Conditions, LinearCamera, TrainingCameraError};
pub use nirspi_optics::rain::Rainfall;
