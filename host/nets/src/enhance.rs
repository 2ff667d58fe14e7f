//! All learned stages together: estimate blur and noise, fuse with depth, deblur, compare with the
//! readings.
//!
//! # Invariant
//! Every image comes with its inconsistency, a number that says whether the readings agree with the
//! image (`tests::a_blurred_cross_gets_sharper_at_each_stage_and_the_readings_bear_it_out`).

#[cfg(feature = "gpu")]
mod device;

use std::num::NonZeroU32;

use thiserror::Error;

use crate::consistency::{Binding, MeasuredRows, MeasuredRowsError};
use crate::deblur::{self, DataConstraint, Deblurrer, Job, Sharpen, SharpenError};
use crate::estimate::{Estimate, Known, KnownEstimate};
use crate::estimator::BlurEstimator;
use crate::fusion::{DepthMaps, Fusion};
use crate::gate;
use crate::grid::AREA;
use crate::images::Images;
use crate::spread::{Moments, doubled, measured_again};

#[cfg(feature = "gpu")]
pub use device::{DeviceEnhancer, DeviceEnhancerError};

/// Options for deblurring or enhancing a stack.
#[derive(Debug, Clone)]
pub struct Options {
    /// Whether each step of the network is moved into agreement with the readings.
    pub consistency: bool,
    /// Whether sharp and clean images of 64 x 64 stay unchanged. Images of 32 x 32 are always
    /// enlarged by the networks: there is no sharp image of 64 x 64 to keep.
    pub gate: bool,
    /// Hadamard rows from which the readings of 32 x 32 were made.
    pub measured: MeasuredRows,
    /// What the caller knows about blur and noise.
    pub estimate: KnownEstimate,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Number of copies for the spread; 0 for no spread.
    pub copies: u32,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            consistency: true,
            gate: true,
            measured: MeasuredRows::All,
            estimate: KnownEstimate::default(),
            seed: 0,
            copies: 0,
        }
    }
}

impl Options {
    fn binding(&self) -> Binding {
        match (self.consistency, self.estimate.sigma_px) {
            (false, _) => Binding::Off,
            (true, Known::Exactly(_)) => Binding::OfKnownBlur,
            (true, _) => Binding::OfEstimate,
        }
    }
}

/// Why images cannot be enhanced.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum EnhanceError {
    /// The measured rows do not belong to these readings.
    #[error(transparent)]
    Rows(#[from] MeasuredRowsError),
    /// The output of a sharpening network was refused.
    #[error(transparent)]
    Sharpen(#[from] SharpenError),
    /// A GPU, or its driver, failed.
    #[error("{0}")]
    Device(String),
}

/// Enhanced images, and numbers about them.
#[derive(Debug, Clone, Default)]
pub struct Enhanced {
    /// (N, 64, 64) in [0, 1].
    pub images: Vec<f32>,
    /// (N, 64, 64): the images before deblurring; `None` if the input had this size.
    pub upscaled: Option<Vec<f32>>,
    /// Blur and noise of each image's readings, as used.
    pub estimates: Vec<Estimate>,
    /// Blur and noise as the estimator found them, before [`Options::estimate`] was applied; `None`
    /// for images on a GPU.
    pub estimated: Option<Vec<Estimate>>,
    /// Inconsistency of each image: distance between its readings and the measured ones, over their
    /// noise. Near 1 or below, they agree.
    pub inconsistency: Vec<f32>,
    /// (N, 64, 64): standard deviation over the requested copies.
    pub spread: Option<Vec<f32>>,
}

impl Enhanced {
    /// The images one by one.
    pub fn each(self) -> impl Iterator<Item = Self> {
        fn part(all: Option<&Vec<f32>>, at: usize) -> Option<Vec<f32>> {
            all.map(|all| all[at * AREA..(at + 1) * AREA].to_vec())
        }
        (0..self.estimates.len()).map(move |at| Self {
            images: self.images[at * AREA..(at + 1) * AREA].to_vec(),
            upscaled: part(self.upscaled.as_ref(), at),
            estimates: vec![self.estimates[at]],
            estimated: self.estimated.as_ref().map(|all| vec![all[at]]),
            inconsistency: vec![self.inconsistency[at]],
            spread: part(self.spread.as_ref(), at),
        })
    }

    fn append(&mut self, mut other: Self) {
        fn join<T>(all: &mut Option<Vec<T>>, more: Option<Vec<T>>) {
            if let Some(more) = more {
                all.get_or_insert_default().extend(more);
            }
        }
        self.images.append(&mut other.images);
        self.estimates.append(&mut other.estimates);
        self.inconsistency.append(&mut other.inconsistency);
        join(&mut self.upscaled, other.upscaled);
        join(&mut self.estimated, other.estimated);
        join(&mut self.spread, other.spread);
    }
}

/// The deblurring stage alone: input and output 64 x 64.
pub struct Sharpener {
    estimator: BlurEstimator,
    deblurrer: Deblurrer,
}

impl Sharpener {
    /// A sharpener made of its two networks.
    pub fn new(estimator: BlurEstimator, deblurrer: Deblurrer) -> Self {
        Self { estimator, deblurrer }
    }

    /// Deblurs a stack; `progress` gets the number of finished images. [`Options::measured`] does
    /// not apply to images of 64 x 64.
    ///
    /// # Errors
    /// [`EnhanceError::Sharpen`] if the output of your own network is refused.
    pub fn deblur(
        &self,
        images: Images<'_, { deblur::SIDE }>,
        options: &Options,
        progress: &mut dyn FnMut(usize),
    ) -> Result<Enhanced, EnhanceError> {
        in_batches(images, self.deblurrer.batch(), progress, |first, batch| {
            let estimated = self.estimator.estimate(batch);
            let stage = Stage { deblurrer: &self.deblurrer, options, first };
            // An image of 64 x 64 was not measured by patterns of 32 x 32.
            let (side, all, binding) = (deblur::SIDE, &MeasuredRows::All, options.binding());
            let sharp = |constraint: &DataConstraint<'_>, estimates: &[Estimate], seed| {
                let readings = constraint.readings();
                let job = stage.job(readings, readings, estimates, seed);
                let mut images = stage.deblurrer.run(&job, constraint)?;
                if options.gate {
                    gate::close(estimates, AREA, &mut images, |k| &readings[k * AREA..][..AREA]);
                }
                Ok::<_, EnhanceError>(images)
            };
            let estimates = known(options, &estimated);
            let constraint = DataConstraint::new(batch.values(), side, &estimates, all, binding)?;
            let images = sharp(&constraint, &estimates, options.seed)?;
            let inconsistency = constraint.residual_ratios(&images);
            let again = |readings: &[f32], estimates: &[Estimate], seed| {
                let constraint = DataConstraint::new(readings, side, estimates, all, binding)?;
                sharp(&constraint, estimates, seed)
            };
            let spread = stage.spread(batch.values(), &estimates, again)?;
            let estimated = Some(estimated);
            Ok(Enhanced { images, upscaled: None, estimates, estimated, inconsistency, spread })
        })
    }
}

/// Both stages: input 32 x 32, output 64 x 64.
///
/// On a GPU, with one step of the bridge and no copies for the spread, images stay on the GPU from
/// the readings to the results ([`DeviceEnhancer`]); otherwise each network's output comes to the
/// host.
pub struct Enhancer {
    fusion: Fusion,
    sharpener: Sharpener,
    #[cfg(feature = "gpu")]
    on_device: Option<DeviceEnhancer>,
}

impl Enhancer {
    /// An enhancer made of its three networks.
    pub fn new(fusion: Fusion, sharpener: Sharpener) -> Self {
        Self {
            fusion,
            sharpener,
            #[cfg(feature = "gpu")]
            on_device: None,
        }
    }

    /// The same enhancer, with images that stay on a GPU where that is possible.
    #[cfg(feature = "gpu")]
    pub(crate) fn with_device(self, on_device: DeviceEnhancer) -> Self {
        Self { on_device: Some(on_device), ..self }
    }

    /// The same enhancer with your own sharpening network, with this number of steps on the bridge.
    #[must_use]
    pub fn with_network(mut self, network: Box<dyn Sharpen>, steps: NonZeroU32) -> Self {
        self.sharpener.deblurrer = Deblurrer::own(network, steps);
        #[cfg(feature = "gpu")]
        {
            self.on_device = None;
        }
        self
    }

    /// Enhances a stack with its depth maps; `progress` gets the number of finished images.
    ///
    /// # Errors
    /// [`EnhanceError`] if the measured rows are not of 32 x 32 readings, the output of your own
    /// network is refused, or a GPU fails.
    pub fn enhance(
        &self,
        images: Images<'_, { crate::fusion::SIDE }>,
        depth: Option<&DepthMaps>,
        options: &Options,
        progress: &mut dyn FnMut(usize),
    ) -> Result<Enhanced, EnhanceError> {
        const SIDE: usize = crate::fusion::SIDE;
        options.measured.expect_side(SIDE)?;
        #[cfg(feature = "gpu")]
        if let Some(on_device) = self.on_device.as_ref().filter(|_| options.copies == 0) {
            return on_device
                .enhance_values(images.values(), depth, options, progress)
                .map_err(|error| EnhanceError::Device(error.to_string()));
        }
        let Sharpener { estimator, deblurrer } = &self.sharpener;
        in_batches(images, deblurrer.batch(), progress, |first, batch| {
            let depth = depth.map(|depth| depth.of(first, batch.count()));
            let estimated = estimator.estimate(batch);
            let stage = Stage { deblurrer, options, first };
            let sharp = |constraint: &DataConstraint<'_>, estimates: &[Estimate], seed| {
                let readings = constraint.readings();
                let start = self.fusion.upscale(Images::known(readings), depth.as_ref());
                let seen = repeated(readings, SIDE);
                let images =
                    deblurrer.run(&stage.job(&start, &seen, estimates, seed), constraint)?;
                Ok::<_, EnhanceError>((start, images))
            };
            let estimates = known(options, &estimated);
            let constraint = constraint_on(batch.values(), &estimates, options)?;
            let (upscaled, images) = sharp(&constraint, &estimates, options.seed)?;
            let inconsistency = constraint.residual_ratios(&images);
            let again = |readings: &[f32], estimates: &[Estimate], seed| {
                let constraint = constraint_on(readings, estimates, options)?;
                Ok(sharp(&constraint, estimates, seed)?.1)
            };
            let spread = stage.spread(batch.values(), &estimates, again)?;
            let (upscaled, estimated) = (Some(upscaled), Some(estimated));
            Ok(Enhanced { images, upscaled, estimates, estimated, inconsistency, spread })
        })
    }
}

/// Readings of 32 x 32 as a constraint on the images made from them.
fn constraint_on<'a>(
    readings: &'a [f32],
    estimates: &[Estimate],
    options: &Options,
) -> Result<DataConstraint<'a>, MeasuredRowsError> {
    let side = crate::fusion::SIDE;
    DataConstraint::new(readings, side, estimates, &options.measured, options.binding())
}

/// One batch of the deblurring stage.
struct Stage<'a> {
    deblurrer: &'a Deblurrer,
    options: &'a Options,
    first: usize,
}

impl Stage<'_> {
    /// The deblurring job for `start`; the network also gets the readings.
    fn job<'b>(
        &self,
        start: &'b [f32],
        seen: &'b [f32],
        estimates: &'b [Estimate],
        seed: u64,
    ) -> Job<'b> {
        Job { start, seen, estimates, seed, first: self.first }
    }

    /// Standard deviation over copies of the readings, each enhanced like the original.
    fn spread(
        &self,
        readings: &[f32],
        estimates: &[Estimate],
        enhance: impl Fn(&[f32], &[Estimate], u64) -> Result<Vec<f32>, EnhanceError>,
    ) -> Result<Option<Vec<f32>>, EnhanceError> {
        if self.options.copies == 0 {
            return Ok(None);
        }
        let noisier = doubled(estimates);
        let mut moments = Moments::new(estimates.len() * AREA);
        for copy in 1..=u64::from(self.options.copies) {
            let seed = self.options.seed ^ copy << 32;
            let readings = measured_again(readings, estimates, seed, self.first);
            moments.add(&enhance(&readings, &noisier, seed)?);
        }
        Ok(Some(moments.deviation()))
    }
}

fn known(options: &Options, estimated: &[Estimate]) -> Vec<Estimate> {
    estimated.iter().map(|e| options.estimate.over(*e)).collect()
}

/// Calls `work` with each piece of the stack and the index of the piece's first image.
fn in_batches<const SIDE: usize>(
    images: Images<'_, SIDE>,
    batch: usize,
    progress: &mut dyn FnMut(usize),
    work: impl Fn(usize, Images<'_, SIDE>) -> Result<Enhanced, EnhanceError>,
) -> Result<Enhanced, EnhanceError> {
    let mut all = Enhanced::default();
    for (index, chunk) in images.values().chunks(batch * SIDE * SIDE).enumerate() {
        all.append(work(index * batch, Images::known(chunk))?);
        progress(all.estimates.len());
    }
    Ok(all)
}

/// Each pixel of (N, side, side) repeated twice in both directions.
fn repeated(images: &[f32], side: usize) -> Vec<f32> {
    let mut out = Vec::with_capacity(4 * images.len());
    for row in images.chunks_exact(side) {
        let start = out.len();
        out.extend(row.iter().flat_map(|&v| [v, v]));
        out.extend_from_within(start..);
    }
    out
}

#[cfg(test)]
mod tests;
