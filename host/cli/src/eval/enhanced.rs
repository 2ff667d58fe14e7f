//! The paper's rows with networks: NIR-SPI pictures, enhanced by the GAN and by diffusion.
//!
//! The law: networks are given what a user would give them, readings over those of a white sheet, and nothing of the
//! truth.

use super::quality::{Kind, Row};
use super::shot::Shots;
use anyhow::Result;
use indicatif::ProgressBar;
use nirspi_nets::{Device, Networks};
use serde::Serialize;

/// Steps of the bridge in the tables.
const STEPS: u32 = 1;

/// An image of the tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Picture {
    #[serde(rename = "VIS")]
    Vis,
    #[serde(rename = "NIR-SPI")]
    NirSpi,
    #[serde(rename = "NIR-SPI + GAN")]
    Gan,
    #[serde(rename = "NIR-SPI + diffusion")]
    Diffusion,
}

impl Picture {
    pub fn name(self) -> &'static str {
        match self {
            Self::Vis => "VIS",
            Self::NirSpi => "NIR-SPI",
            Self::Gan => "NIR-SPI + GAN",
            Self::Diffusion => "NIR-SPI + diffusion",
        }
    }
}

/// The networks of the tables.
pub struct Enhancers {
    gan: Row,
    diffusion: Row,
}

impl Enhancers {
    pub fn new() -> Result<Self> {
        let mut networks = Networks::built_in(Device::cpu());
        let mut row = |kind| Row::new(kind, &mut networks);
        Ok(Self { gan: row(Kind::Gan)?, diffusion: row(Kind::Diffusion(STEPS))? })
    }

    /// The pictures of a network's row, 64 x 64 in [0, 1]; none of a row without one. `whites` are the levels of a
    /// white sheet, one a shot.
    pub fn pictures(
        &self,
        of: Picture,
        shots: &[&Shots],
        whites: &[f32],
    ) -> Result<Option<Vec<Vec<f32>>>> {
        let row = match of {
            Picture::Vis | Picture::NirSpi => return Ok(None),
            Picture::Gan => &self.gan,
            Picture::Diffusion => &self.diffusion,
        };
        let readings: Vec<f32> =
            shots.iter().zip(whites).flat_map(|(shot, white)| scaled(shot, *white)).collect();
        let images = row.enhance_blind(&readings, &ProgressBar::hidden())?;
        Ok(Some(images.chunks_exact(64 * 64).map(<[f32]>::to_vec).collect()))
    }
}

/// A NIR-SPI picture over what a white sheet gives.
fn scaled(shot: &Shots, white: f32) -> impl Iterator<Item = f32> + '_ {
    shot.nir_spi.pixels().iter().map(move |counts| (counts / white).clamp(0.0, 1.0))
}
