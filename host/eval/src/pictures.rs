//! The images that the paper's tables compare: both cameras' pictures, and NIR-SPI pictures enhanced by two networks.
//!
//! # Invariant
//! Networks get what a user would give them, readings over those of a white sheet, and nothing of the truth
//! (`networks_see_readings_over_those_of_a_white_sheet`).

use crate::error::Result;
use crate::quality::{Contender, Method};
use crate::shot::Shots;
use nirspi_nets::{Device, Networks};
use serde::Serialize;

/// Steps of the ancestral sampler, unless asked for otherwise: the paper's 500 take fifty times as long, and quality falls with more
/// than a few (`docs/quality.md`).
pub const ANCESTRAL_STEPS: u32 = 10;

/// Steps of the bridge in the tables.
const STEPS: u32 = 1;

/// An image of the tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Picture {
    /// An ordinary camera's.
    #[serde(rename = "VIS")]
    Vis,
    /// The single-pixel camera's.
    #[serde(rename = "NIR-SPI")]
    NirSpi,
    /// The same, enhanced by the GAN's generator.
    #[serde(rename = "NIR-SPI + GAN")]
    Gan,
    /// The same, enhanced by the diffusion bridge in one step.
    #[serde(rename = "NIR-SPI + diffusion")]
    Diffusion,
    /// The same, enhanced by the ancestral sampler, the paper's own (Eqs. 5 to 8).
    #[serde(rename = "NIR-SPI + ancestral")]
    Ancestral,
}

impl Picture {
    /// As the paper calls the row.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Vis => "VIS",
            Self::NirSpi => "NIR-SPI",
            Self::Gan => "NIR-SPI + GAN",
            Self::Diffusion => "NIR-SPI + diffusion",
            Self::Ancestral => "NIR-SPI + ancestral",
        }
    }
}

/// The networks of the tables.
pub struct Enhancers {
    gan: Contender,
    diffusion: Contender,
    ancestral: Option<Contender>,
}

impl Enhancers {
    /// The embedded networks on the CPU; the ancestral sampler takes so many steps, and with 0 there is none.
    ///
    /// # Errors
    /// Damaged weights.
    pub fn new(ancestral_steps: u32) -> Result<Self> {
        let mut networks = Networks::built_in(Device::cpu());
        let ancestral = (ancestral_steps > 0)
            .then(|| Contender::new(Method::Ancestral(ancestral_steps), &mut networks))
            .transpose()?;
        Ok(Self {
            ancestral,
            gan: Contender::new(Method::Gan, &mut networks)?,
            diffusion: Contender::new(Method::Diffusion(STEPS), &mut networks)?,
        })
    }

    /// The pictures of a row with a network, 64 x 64 in [0, 1]; `None` for a row without a network and for a sampler without steps. `whites` are the levels
    /// of a white sheet, one a shot.
    ///
    /// # Errors
    /// Readings that are not numbers.
    pub fn pictures(
        &self,
        of: Picture,
        shots: &[&Shots],
        whites: &[f32],
    ) -> Result<Option<Vec<Vec<f32>>>> {
        let network = match of {
            Picture::Vis | Picture::NirSpi => return Ok(None),
            Picture::Gan => &self.gan,
            Picture::Diffusion => &self.diffusion,
            Picture::Ancestral => match &self.ancestral {
                Some(ancestral) => ancestral,
                None => return Ok(None),
            },
        };
        let readings: Vec<f32> =
            shots.iter().zip(whites).flat_map(|(shot, white)| scaled(shot, *white)).collect();
        let images = network.enhance_blind(&readings, &|_| {})?;
        Ok(Some(images.chunks_exact(64 * 64).map(<[f32]>::to_vec).collect()))
    }
}

/// A NIR-SPI picture over what a white sheet gives.
fn scaled(shot: &Shots, white: f32) -> impl Iterator<Item = f32> + '_ {
    shot.nir_spi.pixels().iter().map(move |counts| (counts / white).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_recon::{Image, Side};

    #[test]
    fn networks_see_readings_over_those_of_a_white_sheet() {
        let dim = |counts: f32| {
            let pixels = (0..1024).map(|at| if at % 32 < 16 { counts } else { counts / 4.0 });
            let image = Image::new(Side::INSTRUMENT, pixels.collect());
            Shots { truth: Vec::new(), truth_fine: Vec::new(), nir_spi: image.clone(), vis: image }
        };
        let (near, far) = (dim(800.0), dim(80.0));
        assert!(scaled(&near, 1000.0).zip(scaled(&far, 100.0)).all(|(a, b)| (a - b).abs() < 1e-6));
        assert_eq!(scaled(&near, 100.0).next(), Some(1.0), "brighter than white is white");
        let enhancers = Enhancers::new(0).unwrap();
        let of = |picture, shots: &[&Shots], whites: &[f32]| {
            enhancers.pictures(picture, shots, whites).unwrap()
        };
        assert!(of(Picture::Vis, &[&near], &[1000.0]).is_none());
        let both = of(Picture::Diffusion, &[&near, &far], &[1000.0, 100.0]).unwrap();
        assert_eq!(both.len(), 2);
        assert!(both[0].iter().zip(&both[1]).all(|(a, b)| (a - b).abs() < 1e-3));
    }
}
