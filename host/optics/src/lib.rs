#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! The light takes one path through this crate, and each module is one stage of it:
//!
//! | module | from | to |
//! |---|---|---|
//! | [`scene`] | a picture | reflectance on a target plane, in millimetres |
//! | [`projector`] | scene and distance | [`Footprint`]: the reflectance that each LED's spot sees |
//! | [`motion`] | scene and time | what each LED's spot sees of a target that moves |
//! | [`budget`] | watts, apertures, distance | electrons per ADC sample for one LED, and for daylight |
//! | [`mod@array`] | 32 row and 32 column lines | electrons per ADC sample for the LEDs they light |
//! | [`edges`] | lines that change | the light on its way: LEDs that rise and LEDs that fall |
//! | [`chain`] | electrons, one clock at a time | 14-bit ADC samples with noise, settling and latency |
//! | [`daylight`], [`lamp`] | kilolux, wavelength, filter | W/m^2 of daylight or lamp light on the target |
//! | [`depth`] | distance | an 8 x 8 time-of-flight reading, and its place in the image |
//!
//! [`camera`] holds every constant of a camera, read from TOML. [`instrument`] holds the numbers
//! that the gateware and the protocol fix.
//!
//! What is between camera and target, and what follows from it:
//!
//! | module | from | to |
//! |---|---|---|
//! | [`water`], [`substance`], [`mie`] | wavelength, size | refractive index; what one sphere does to light |
//! | [`rain`] | weather as a user writes it, distance | extinction, blur, veil, single drops in the beams |
//! | [`pixel`] | budget, weather, exposure | signal and noise of one pixel, term by term |
//! | [`range`] | all of these | how far the camera sees (the paper's Algorithm 2) |
//! | [`rig`] | collected volumes, nozzles | uniformity of a rain simulator |
//! | [`visible`] | scene, daylight, drops | what an ordinary camera sees |
//! | [`safety`] | camera description | what an eye before the camera receives |
//!
//! Light is counted in **electrons per ADC sample** from [`budget`] on, without rescaling. A weak
//! signal stays weak; the gain is a setting.

pub mod array;
pub mod budget;
pub mod camera;
pub mod chain;
pub mod daylight;
pub mod depth;
pub mod edges;
pub mod instrument;
pub mod lamp;
pub mod mie;
pub mod motion;
pub mod pixel;
mod poles;
mod pose;
pub mod projector;
pub mod rain;
pub mod range;
pub mod rig;
pub mod safety;
pub mod scene;
pub mod substance;
pub mod visible;
pub mod water;

pub use array::LedArray;
pub use budget::{Budget, BudgetError, BudgetSettings, BudgetTerms};
pub use camera::{CameraModel, CameraModelError};
pub use chain::{AdcSample, Chain, ChainError, ChainSettings};
pub use depth::{DEPTH_SIDE, DepthError, DepthGeometry, DepthView, SimulatedDepth};
pub use edges::{LedEdges, Light};
pub use instrument::{LEDS, SIDE, WAVELENGTH_NM};
pub use motion::{Motion, MotionError, MovingTarget};
pub use pose::Pose;
pub use projector::{Footprint, Projector, ProjectorError};
pub use scene::{Scene, SceneError, Specular};
