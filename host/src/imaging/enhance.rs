//! The learned stages for one image: scale to white, fuse with depth, deblur, agree with the readings.

use super::white::brightest;
use nirspi_nets::{
    DepthMaps, Device, Enhancer, Images, ImagesError, Known, KnownEstimate, MeasuredRows,
    MeasuredRowsError, Method, Networks, Options, Sharpener, WeightsError, deblur, fusion,
};
use nirspi_recon::{Image, Rows};
use std::num::NonZeroU32;
use thiserror::Error;

/// What a white target would give one pixel of the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum White {
    /// Known, in the image's units (ADC counts for the instrument's own images).
    Known(f32),
    /// Not known: the brightest 2 x 2 pixels are taken for white.
    Brightest,
}

impl White {
    /// The level for this image, in its units; 0 where there is no light.
    #[must_use]
    pub fn level(self, image: &Image) -> f32 {
        match self {
            Self::Known(level) => level,
            Self::Brightest => brightest(image.pixels(), image.side().pixels()),
        }
    }

    /// The median level of several images, so that a video does not flicker; 0 for none.
    #[must_use]
    pub fn median_level<'i>(self, images: impl IntoIterator<Item = &'i Image>) -> f32 {
        let mut levels: Vec<f32> = images.into_iter().map(|image| self.level(image)).collect();
        levels.sort_by(f32::total_cmp);
        levels.get(levels.len() / 2).copied().unwrap_or(0.0)
    }
}

/// What is known of an image besides its pixels.
#[derive(Debug, Clone, Copy, Default)]
pub struct ImageContext<'c> {
    /// Natural-order Hadamard rows that it was made from; `None` for all.
    pub rows: Option<&'c Rows>,
    /// Distances that a time-of-flight sensor saw at the same time: one map.
    pub depth: Option<&'c DepthMaps>,
    /// Least blur, in pixels of the 64 x 64 grid: that of the lens at the target's distance. Noise hides blur from the
    /// estimator, so the larger of the two is taken out.
    pub least_blur_px: Option<f32>,
    /// Seed of what is random in the networks.
    pub seed: u64,
}

/// Why an image cannot be enhanced.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EnhanceError {
    /// The networks take two sizes.
    #[error("an image of {found} x {found} pixels, expected 32 x 32 or 64 x 64")]
    Side {
        /// Its side.
        found: usize,
    },
    /// Nothing is bright.
    #[error("no light in the image: white is {white}, expected more than 0")]
    Dark {
        /// The level taken for white.
        white: f32,
    },
    /// A pixel is NaN or infinite.
    #[error(transparent)]
    Pixels(#[from] ImagesError),
    /// The measured rows are not rows of such an image.
    #[error(transparent)]
    Rows(#[from] MeasuredRowsError),
    /// The networks gave no image.
    #[error(transparent)]
    Networks(#[from] nirspi_nets::EnhanceError),
}

/// One image through the learned stages.
#[derive(Debug, Clone)]
pub struct EnhancedImage {
    /// The input over white, in [0, 1], at its own side.
    pub scaled: Vec<f32>,
    /// The level taken for white, in the input's units.
    pub white: f32,
    /// 64 x 64 after fusion with depth, before deblurring; `None` for an input of 64 x 64.
    pub fused: Option<Vec<f32>>,
    /// The result: 64 x 64 in [0, 1].
    pub pixels: Vec<f32>,
    /// Blur that was taken out: standard deviation in pixels of the 64 x 64 grid.
    pub blur_px: f32,
    /// Blur as the estimator sees it in the image.
    pub estimated_blur_px: f32,
    /// Noise of one pixel of the input, white being 1, as estimated.
    pub noise: f32,
    /// Distance of the readings from those of the result, over their noise: near 1 or below, they agree.
    pub inconsistency: f32,
}

/// The learned stages, ready for images of 32 x 32 and 64 x 64.
pub struct Enhance {
    both: Enhancer,
    second: Sharpener,
    device: Device,
}

impl Enhance {
    /// With the networks that come with the program.
    ///
    /// # Errors
    /// [`WeightsError`] if the built-in weights are damaged.
    pub fn built_in(device: &Device) -> Result<Self, WeightsError> {
        let method = Method::Diffusion { steps: NonZeroU32::MIN };
        let second = Networks::built_in(device.clone()).sharpener(method)?;
        Ok(Self::of(Enhancer::built_in(device)?, second, device.clone()))
    }

    /// With networks of your own: both stages for 32 x 32, the second alone for 64 x 64.
    #[must_use]
    pub fn of(both: Enhancer, second: Sharpener, device: Device) -> Self {
        Self { both, second, device }
    }

    /// Where the networks run.
    #[must_use]
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Enhances an image of 32 x 32 or 64 x 64 pixels.
    ///
    /// # Errors
    /// [`EnhanceError`] for another size, a dark image or pixels that are no numbers.
    pub fn enhance(
        &self,
        image: &Image,
        white: White,
        context: &ImageContext<'_>,
    ) -> Result<EnhancedImage, EnhanceError> {
        let side = image.side().pixels();
        if side != fusion::SIDE && side != deblur::SIDE {
            return Err(EnhanceError::Side { found: side });
        }
        let white = white.level(image);
        if !(white > 0.0 && white.is_finite()) {
            return Err(EnhanceError::Dark { white });
        }
        let scaled: Vec<f32> =
            image.pixels().iter().map(|&value| (value / white).clamp(0.0, 1.0)).collect();
        // What is 64 x 64 was not measured by patterns of 32 x 32.
        let measured = match context.rows {
            Some(rows) if side == fusion::SIDE => MeasuredRows::new(side, rows)?,
            _ => MeasuredRows::All,
        };
        // The larger of lens and estimator: noise hides blur from the estimator.
        let sigma_px = context.least_blur_px.map_or(Known::Nothing, Known::AtLeast);
        let options = Options {
            measured,
            seed: context.seed,
            estimate: KnownEstimate { sigma_px, ..KnownEstimate::default() },
            ..Options::default()
        };
        let result = if side == fusion::SIDE {
            self.both.enhance(Images::new(&scaled)?, context.depth, &options, &mut |_| {})?
        } else {
            self.second.deblur(Images::new(&scaled)?, &options, &mut |_| {})?
        };
        let used = result.estimates[0];
        let estimated = result.estimated.as_ref().map_or(used, |estimated| estimated[0]);
        Ok(EnhancedImage {
            scaled,
            white,
            fused: result.upscaled,
            pixels: result.images,
            blur_px: used.sigma_px,
            estimated_blur_px: estimated.sigma_px,
            noise: used.noise,
            inconsistency: result.inconsistency[0],
        })
    }
}
