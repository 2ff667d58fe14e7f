//! The images that the paper's tables compare: pictures of both cameras, and NIR-SPI pictures
//! enhanced by networks.
//!
//! # Invariant
//! Networks get the input that a user would give them: readings divided by those of a white sheet,
//! and no part of the truth (`tests::networks_see_readings_over_those_of_a_white_sheet`).

use crate::error::Result;
use crate::quality::{Contender, Method};
use crate::shot::Shots;
use nirspi_nets::{Device, Networks, deblur};
use serde::Serialize;

/// Default steps of the ancestral sampler. The paper's 500 steps take fifty times as long, and
/// quality falls with more than a few steps (`docs/log/quality.md`).
pub const ANCESTRAL_STEPS: u32 = 10;

/// Steps of the bridge in the tables.
const STEPS: u32 = 1;

/// An image of the tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Picture {
    /// An ordinary camera's picture.
    #[serde(rename = "VIS")]
    Vis,
    /// The single-pixel camera's picture.
    #[serde(rename = "NIR-SPI")]
    NirSpi,
    /// The single-pixel camera's picture, enhanced by the GAN's generator.
    #[serde(rename = "NIR-SPI + GAN")]
    Gan,
    /// The single-pixel camera's picture, enhanced by a network that minimises the error, trained
    /// as long as the GAN and the ancestral sampler.
    #[serde(rename = "NIR-SPI + regression")]
    Regression,
    /// The single-pixel camera's picture, enhanced by the diffusion bridge in one step.
    #[serde(rename = "NIR-SPI + diffusion")]
    Diffusion,
    /// The single-pixel camera's picture, enhanced by the ancestral sampler, the paper's method
    /// (Eqs. 5 to 8).
    #[serde(rename = "NIR-SPI + ancestral")]
    Ancestral,
}

impl Picture {
    /// The name of the row in the paper.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Vis => "VIS",
            Self::NirSpi => "NIR-SPI",
            Self::Gan => "NIR-SPI + GAN",
            Self::Regression => "NIR-SPI + regression",
            Self::Diffusion => "NIR-SPI + diffusion",
            Self::Ancestral => "NIR-SPI + ancestral",
        }
    }
}

/// The networks of the tables.
pub struct Enhancers {
    gan: Contender,
    regression: Contender,
    diffusion: Contender,
    ancestral: Option<Contender>,
}

impl Enhancers {
    /// The embedded networks on the CPU. The ancestral sampler takes `ancestral_steps` steps; with
    /// 0 it is left out.
    ///
    /// # Errors
    /// `EvalError` for damaged weights.
    pub fn new(ancestral_steps: u32) -> Result<Self> {
        let mut networks = Networks::built_in(Device::cpu());
        let ancestral = (ancestral_steps > 0)
            .then(|| Contender::new(Method::Ancestral(ancestral_steps), &mut networks))
            .transpose()?;
        Ok(Self {
            ancestral,
            gan: Contender::new(Method::Gan, &mut networks)?,
            regression: Contender::new(Method::Regression, &mut networks)?,
            diffusion: Contender::new(Method::Diffusion(STEPS), &mut networks)?,
        })
    }

    /// The pictures of a row with a network, 64 x 64 in [0, 1]; `None` for a row without a network
    /// and for a sampler without steps. `whites` are the levels of a white sheet, one for each
    /// shot.
    ///
    /// # Errors
    /// `EvalError` for readings that are NaN or infinite.
    pub fn pictures(
        &self,
        of: Picture,
        shots: &[&Shots],
        whites: &[f32],
    ) -> Result<Option<Vec<Vec<f32>>>> {
        let network = match of {
            Picture::Vis | Picture::NirSpi => return Ok(None),
            Picture::Gan => &self.gan,
            Picture::Regression => &self.regression,
            Picture::Diffusion => &self.diffusion,
            Picture::Ancestral => match &self.ancestral {
                Some(ancestral) => ancestral,
                None => return Ok(None),
            },
        };
        let readings: Vec<f32> =
            shots.iter().zip(whites).flat_map(|(shot, white)| scaled(shot, *white)).collect();
        let images = network.enhance_blind(&readings, &|_| {})?;
        Ok(Some(images.chunks_exact(deblur::SIDE * deblur::SIDE).map(<[f32]>::to_vec).collect()))
    }
}

/// A NIR-SPI picture divided by the level of a white sheet.
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
