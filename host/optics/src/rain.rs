//! Rain and fog: the particles in the air, and their effects on light.
//!
//! | module | from | to |
//! |---|---|---|
//! | [`drops`] | a rain rate, a law of sizes | drops per cubic metre, by diameter |
//! | [`law`] | text | a law of sizes |
//! | [`paper`], [`rainfall`] | the paper's Table 2 | light rain, heavy rain, dry air |
//! | [`fall`] | diameter, air density | fall speed, time constant, share of an exposure |
//! | [`medium`] | drops, wavelength | extinction, scattering, absorption, scattering angles |
//! | [`backward`] | drops, wavelength | light sent back, near 180 degrees |
//! | `follow` | medium, distance | where light lands, and what comes back, in dense air |
//! | [`blur`] | scattering angles, distance | where forward-scattered light lands on the target |
//! | [`veil`] | medium, geometry | light that comes back without having seen the target |
//! | [`falling`] | drops, distance, seed | single drops that cross the LEDs' beams, from frame to frame |
//! | [`window`] | drops on the window | light that they spread |
//! | [`air`] | text | what is in the air, and what it is made of |
//! | [`weather`] | drops, substance, wavelength | all of these, at any distance |
//! | [`spots`] | weather, scene, seed | what each LED's spot shows as drops fall |
//! | [`fso`] | rain rate | loss by laws fitted to optical links, an outside check |
//! | [`radar`] | drops | differential reflectivity, an input of the paper's Algorithm 2 |
//!
//! Every effect is a sum over the same list of drops ([`Drops`]), so two results differ by physics
//! and not by their assumptions about the rain. `docs/log/physics.md` in the repository derives and
//! cites each formula.

pub mod air;
pub mod backward;
pub mod blur;
pub mod drops;
pub mod fall;
pub mod falling;
mod follow;
pub mod fso;
pub mod law;
pub mod medium;
pub mod paper;
pub mod radar;
pub mod rainfall;
pub mod spots;
pub mod veil;
pub mod weather;
pub mod window;

pub use air::{Air, AirError};
pub use backward::BackwardLobe;
pub use blur::{BlurKernel, ForwardBlur};
pub use drops::{DropClass, Drops};
pub use falling::{BeamShadows, FallingDrops};
pub use fso::FsoLaw;
pub use law::{DropLaw, ParseDropLawError};
pub use medium::{Medium, ScatteringAngles};
pub use paper::PaperRain;
pub use rainfall::Rainfall;
pub use spots::RainySpots;
pub use veil::Veil;
pub use weather::Weather;
pub use window::Window;

use crate::mie::MieError;
use crate::water::WavelengthError;
use thiserror::Error;

/// Why the weather is not possible.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum RainError {
    /// A number is outside its physical or checked range.
    #[error("rain: {name} is {value}, expected {expected}")]
    Setting {
        /// The name of the number.
        name: &'static str,
        /// The value found.
        value: f64,
        /// The allowed values.
        expected: &'static str,
    },
    /// A measured distribution without drops.
    #[error("rain: no drop sizes given, expected at least one")]
    NoDrops,
    /// The Mie solver was not checked for this drop.
    #[error(transparent)]
    Mie(#[from] MieError),
    /// The index of water is not known at this wavelength.
    #[error(transparent)]
    Wavelength(#[from] WavelengthError),
}

pub(crate) fn ensure(
    holds: bool,
    name: &'static str,
    value: f64,
    expected: &'static str,
) -> Result<(), RainError> {
    if holds { Ok(()) } else { Err(RainError::Setting { name, value, expected }) }
}
