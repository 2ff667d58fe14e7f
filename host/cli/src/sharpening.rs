//! Arguments for deblurring, the same for `deblur` and `enhance`.

use super::Usage;
use super::networks::ImageArgs;
use anyhow::Result;
use nirspi::imaging::SPREAD_COPIES;
use nirspi::imaging::stack::{ImageStack, StackTarget};
use nirspi_nets::deblur::Model;
use nirspi_nets::{KnownEstimate, Method, Options};
use std::num::NonZeroU32;
use std::path::PathBuf;

/// How to deblur.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Deblurring")]
pub struct Sharpening {
    /// Blur of the images in pixels of the 64 x 64 grid (standard deviation), if you know it better than the estimator
    #[arg(long, value_name = "P")]
    blur_px: Option<f32>,
    /// Noise of the images (standard deviation, of a full scale of 1), if you know it better than the estimator
    #[arg(long, value_name = "N")]
    noise: Option<f32>,
    /// Do not correct the network's result where the readings contradict it
    #[arg(long)]
    no_consistency: bool,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Also write the repeatability of each pixel (.npy): its standard deviation if the same scene were measured again. An
    /// error that the network makes every time does not show in this number
    #[arg(long, value_name = "FILE")]
    pub spread: Option<PathBuf>,
}

/// A network with the steps that --steps asks for.
pub fn in_steps(model: Model, steps: Option<NonZeroU32>) -> Result<Method> {
    Method::new(model, steps).map_err(|error| Usage(format!("--steps: {error}")).into())
}

impl Sharpening {
    pub fn options(&self) -> Result<Options> {
        let within = |name: &str, value: Option<f32>, most: f32| match value {
            Some(value) if !(0.0..=most).contains(&value) => {
                Err(Usage(format!("{name} is {value}, expected 0 to {most}")))
            }
            _ => Ok(()),
        };
        within("--blur-px", self.blur_px, 16.0)?;
        within("--noise", self.noise, 1.0)?;
        Ok(Options {
            consistency: !self.no_consistency,
            estimate: KnownEstimate { sigma_px: self.blur_px.into(), noise: self.noise.into() },
            seed: self.seed,
            copies: if self.spread.is_some() { SPREAD_COPIES } else { 0 },
            ..Options::default()
        })
    }

    /// Where the spread goes, if requested.
    pub fn spread_target(
        &self,
        images: &ImageArgs,
        input: &ImageStack,
    ) -> Result<Option<StackTarget>> {
        self.spread.as_ref().map(|file| images.target(input, file)).transpose()
    }
}
