//! The learned stages for one image: scale to white, fuse with depth, deblur, and make the result
//! agree with the readings.

use super::readings::KnownReadings;
use super::white::brightest;
use nirspi_nets::interval::Readings;
use nirspi_nets::{
    DepthMaps, Device, Enhancer, Images, ImagesError, Intervals, Known, KnownEstimate,
    MeasuredRows, MeasuredRowsError, Method, Networks, NoIntervals, Options, Sharpener,
    WeightsError, deblur, fusion,
};
use nirspi_recon::{Image, Rows, Shape, Side};
use thiserror::Error;

/// Number of simulated repetitions for the spread of an image.
pub const SPREAD_COPIES: u32 = 8;

/// The level of one pixel that sees a white target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum White {
    /// The level is known, in the units of the image (ADC counts for images of the instrument).
    Known(f32),
    /// The level is unknown. The largest mean of 2 x 2 neighbouring pixels is used.
    Brightest,
}

impl White {
    /// The white level of this image, in its units; 0 for an image without light.
    #[must_use]
    pub fn level(self, image: &Image<impl Shape>) -> f32 {
        match self {
            Self::Known(level) => level,
            Self::Brightest => brightest(image.pixels(), image.size().width()),
        }
    }

    /// The median white level of several images, so that a video does not flicker; 0 without
    /// images.
    #[must_use]
    pub fn median_level<'i>(self, images: impl IntoIterator<Item = &'i Image>) -> f32 {
        Self::median(images.into_iter().map(|image| self.level(image)))
    }

    /// The median of white levels of several images; 0 without images.
    #[must_use]
    pub fn median(levels: impl IntoIterator<Item = f32>) -> f32 {
        let mut levels: Vec<f32> = levels.into_iter().collect();
        levels.sort_by(f32::total_cmp);
        levels.get(levels.len() / 2).copied().unwrap_or(0.0)
    }
}

/// Information about an image besides its pixels.
#[derive(Debug, Clone, Copy, Default)]
pub struct ImageContext<'c> {
    /// Natural-order Hadamard rows that were measured; `None` means all rows.
    pub rows: Option<&'c Rows>,
    /// How the readings were taken and the image was made; `None` if that is not known. Without it
    /// there is no interval.
    pub readings: Option<KnownReadings>,
    /// Distances of a time-of-flight sensor at the same time: one map.
    pub depth: Option<&'c DepthMaps>,
    /// Least blur, in pixels of the 64 x 64 grid: the blur of the lens at the target's distance.
    /// Noise hides blur from the estimator, so the larger of lens and estimate is removed.
    pub least_blur_px: Option<f32>,
    /// Seed of the networks' random numbers.
    pub seed: u64,
    /// Number of simulated repetitions for [`EnhancedImage::spread`]; 0 for no spread.
    pub copies: u32,
}

/// Why an image cannot be enhanced.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EnhanceError {
    /// The image has another size than the two sizes that the networks accept.
    #[error("an image of {found} x {found} pixels, expected 32 x 32 or 64 x 64")]
    Side {
        /// The image's side.
        found: usize,
    },
    /// No pixel is bright.
    #[error("no light in the image: white is {white}, expected more than 0")]
    Dark {
        /// The level that was used as white.
        white: f32,
    },
    /// A pixel is NaN or infinite.
    #[error(transparent)]
    Pixels(#[from] ImagesError),
    /// The measured rows are not rows of such an image.
    #[error(transparent)]
    Rows(#[from] MeasuredRowsError),
    /// The networks failed.
    #[error(transparent)]
    Networks(#[from] nirspi_nets::EnhanceError),
}

/// The results of the learned stages for one image.
#[derive(Debug, Clone)]
pub struct EnhancedImage {
    /// The input divided by white, in [0, 1], at its own side.
    pub scaled: Vec<f32>,
    /// The level used as white, in the input's units.
    pub white: f32,
    /// 64 x 64 after fusion with depth, before deblurring; `None` for an input of 64 x 64.
    pub fused: Option<Vec<f32>>,
    /// The result: 64 x 64 in [0, 1].
    pub pixels: Vec<f32>,
    /// Blur that was removed: standard deviation in pixels of the 64 x 64 grid.
    pub blur_px: f32,
    /// Blur that the estimator found in the image.
    pub estimated_blur_px: f32,
    /// Estimated noise of one pixel of the input; white is 1.
    pub noise: f32,
    /// Distance of the readings from the readings of the result, divided by their noise. A value
    /// near 1 or below means that they agree.
    pub inconsistency: f32,
    /// 64 x 64: the standard deviation of each pixel of the result if the same scene were measured
    /// again, from readings with simulated noise (`nirspi_nets::Options::copies`). An error that the
    /// network makes each time is not in this number.
    pub spread: Option<Vec<f32>>,
    /// 64 x 64: half-width of the calibrated 95 % interval of each pixel of the result
    /// ([`nirspi_nets::interval`]); `None` where the calibration does not reach.
    pub half_width: Option<Vec<f32>>,
    /// Why there is no interval, in one line.
    pub no_interval: Option<String>,
}

/// The learned stages, ready for images of 32 x 32 and 64 x 64.
pub struct Enhance {
    both: Enhancer,
    second: Sharpener,
    device: Device,
    intervals: Result<Intervals, String>,
}

impl Enhance {
    /// The learned stages with the built-in networks.
    ///
    /// # Errors
    /// [`WeightsError`] if the built-in weights are damaged.
    pub fn built_in(device: &Device) -> Result<Self, WeightsError> {
        Self::by(Method::default(), device)
    }

    /// The learned stages with a built-in network for deblurring.
    ///
    /// # Errors
    /// [`WeightsError`] if this build does not have the weights.
    pub fn by(method: Method, device: &Device) -> Result<Self, WeightsError> {
        let mut networks = Networks::built_in(device.clone());
        let (both, second) = (networks.enhancer(method)?, networks.sharpener(method)?);
        let intervals = networks.intervals(method, &Options::default());
        let intervals = intervals.map_err(|error| error.to_string());
        Ok(Self { intervals, ..Self::of(both, second, device.clone()) })
    }

    /// The learned stages with other networks: both stages for 32 x 32, the second stage alone for
    /// 64 x 64. There are no calibrated intervals.
    #[must_use]
    pub fn of(both: Enhancer, second: Sharpener, device: Device) -> Self {
        let other = "no intervals: the networks are not the calibrated ones".to_owned();
        Self { both, second, device, intervals: Err(other) }
    }

    /// The device on which the networks run.
    #[must_use]
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Whether the networks take images of this side.
    #[must_use]
    pub fn takes(side: Side) -> bool {
        [fusion::SIDE, deblur::SIDE].contains(&side.pixels())
    }

    /// Enhances an image of 32 x 32 or 64 x 64 pixels.
    ///
    /// # Errors
    /// [`EnhanceError`] for another size, a dark image, or pixels that are NaN or infinite.
    pub fn enhance(
        &self,
        image: &Image,
        white: White,
        context: &ImageContext<'_>,
    ) -> Result<EnhancedImage, EnhanceError> {
        Ok(self.enhance_all(&[image], white.level(image), context)?.remove(0))
    }

    /// Enhances images of one size, of one white level, made of readings of the same rows; a map of
    /// distances for each, if there are any. The networks work on many at once.
    ///
    /// # Errors
    /// As [`enhance`](Self::enhance), of the first image that is refused.
    ///
    /// # Panics
    /// If the images differ in size.
    pub fn enhance_all(
        &self,
        images: &[&Image],
        white: f32,
        context: &ImageContext<'_>,
    ) -> Result<Vec<EnhancedImage>, EnhanceError> {
        let Some(first) = images.first() else { return Ok(Vec::new()) };
        let side = first.side().pixels();
        assert!(images.iter().all(|image| image.side() == first.side()), "images of one size");
        if !Self::takes(first.side()) {
            return Err(EnhanceError::Side { found: side });
        }
        if !(white > 0.0 && white.is_finite()) {
            return Err(EnhanceError::Dark { white });
        }
        let pixels = images.iter().flat_map(|image| image.pixels());
        let scaled: Vec<f32> = pixels.map(|&value| (value / white).clamp(0.0, 1.0)).collect();
        // An image of 64 x 64 was not measured by patterns of 32 x 32.
        let measured = match context.rows {
            Some(rows) if side == fusion::SIDE => MeasuredRows::new(side, rows)?,
            _ => MeasuredRows::All,
        };
        // The larger of lens and estimate is used, because noise hides blur from the estimator.
        let sigma_px = context.least_blur_px.map_or(Known::Nothing, Known::AtLeast);
        let options = Options {
            measured,
            seed: context.seed,
            copies: context.copies,
            estimate: KnownEstimate { sigma_px, ..KnownEstimate::default() },
            ..Options::default()
        };
        let results = if side == fusion::SIDE {
            self.both.enhance(Images::new(&scaled)?, context.depth, &options, &mut |_| {})?
        } else {
            self.second.deblur(Images::new(&scaled)?, &options, &mut |_| {})?
        };
        let each = results.each().zip(scaled.chunks_exact(side * side));
        Ok(each.map(|(result, scaled)| self.made(result, scaled, white, context)).collect())
    }

    fn made(
        &self,
        result: nirspi_nets::Enhanced,
        scaled: &[f32],
        white: f32,
        context: &ImageContext<'_>,
    ) -> EnhancedImage {
        let used = result.estimates[0];
        let half_width = self.half_width(&result, white, context);
        let estimated = result.estimated.as_ref().map_or(used, |estimated| estimated[0]);
        EnhancedImage {
            scaled: scaled.to_vec(),
            white,
            fused: result.upscaled,
            pixels: result.images,
            blur_px: used.sigma_px,
            estimated_blur_px: estimated.sigma_px,
            noise: used.noise,
            inconsistency: result.inconsistency[0],
            spread: result.spread,
            no_interval: half_width.as_ref().err().cloned(),
            half_width: half_width.ok(),
        }
    }

    /// The half-widths of the intervals, or why there are none.
    fn half_width(
        &self,
        made: &nirspi_nets::Enhanced,
        white: f32,
        context: &ImageContext<'_>,
    ) -> Result<Vec<f32>, String> {
        let intervals = self.intervals.as_ref().map_err(String::clone)?;
        let found = match context.readings {
            Some(KnownReadings { method, noise }) => {
                let area = fusion::SIDE * fusion::SIDE;
                let share = context.rows.map_or(1.0, |rows| rows.len() as f32 / area as f32);
                let noise = noise / white;
                intervals.of(made, &Readings { method: method.argument(), share, noise })
            }
            None => Err(NoIntervals::UnknownReadings),
        };
        found.map_err(|error| error.to_string())
    }
}
