//! The learned stages as one: estimate blur and noise, fuse with depth, deblur, hold against the readings.
//!
//! # Invariant
//! Every image comes with its inconsistency, the figure that says whether the readings support the image
//! (`a_blurred_cross_gets_sharper_at_each_stage_and_the_readings_bear_it_out`).

#[cfg(feature = "gpu")]
mod device;
mod known;

use std::num::NonZeroU32;

use thiserror::Error;

use crate::consistency::{MeasuredRows, MeasuredRowsError};
use crate::deblur::{self, AREA, DataConstraint, Deblurrer, Job, Sharpen, SharpenError};
use crate::estimate::{BlurEstimator, Estimate};
use crate::fusion::{DepthMaps, Fusion};
use crate::gate;
use crate::images::Images;
use crate::spread::{Moments, doubled, measured_again};

#[cfg(feature = "gpu")]
pub use device::{DeviceEnhancer, DeviceEnhancerError};
pub use known::{Known, KnownEstimate};

/// How a stack is deblurred or enhanced.
#[derive(Debug, Clone)]
pub struct Options {
    /// Whether each step is moved into agreement with the readings.
    pub consistency: bool,
    /// Whether sharp and clean images stay as they are.
    pub gate: bool,
    /// Hadamard rows that readings of 32 x 32 were made from.
    pub measured: MeasuredRows,
    /// What the caller knows of blur and noise.
    pub estimate: KnownEstimate,
    /// Seed of everything random.
    pub seed: u64,
    /// Copies to take the spread of; none for no spread.
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

/// Why images are not enhanced.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum EnhanceError {
    /// The measured rows do not belong to these readings.
    #[error(transparent)]
    Rows(#[from] MeasuredRowsError),
    /// A sharpening network gave no images.
    #[error(transparent)]
    Sharpen(#[from] SharpenError),
}

/// Enhanced images and what is known about them.
#[derive(Debug, Clone, Default)]
pub struct Enhanced {
    /// (N, 64, 64) in [0, 1].
    pub images: Vec<f32>,
    /// (N, 64, 64): the images before deblurring, where they had to be enlarged.
    pub upscaled: Option<Vec<f32>>,
    /// Blur and noise of each image's readings, as they were used.
    pub estimates: Vec<Estimate>,
    /// The same as the estimator found them, before [`Options::estimate`] was joined in; none where images stayed on a GPU.
    pub estimated: Option<Vec<Estimate>>,
    /// Distance of the readings from those of each image, over their noise: near 1 or below, they agree.
    pub inconsistency: Vec<f32>,
    /// (N, 64, 64): standard deviation over the copies asked for.
    pub spread: Option<Vec<f32>>,
}

impl Enhanced {
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

/// The deblurring stage on its own: 64 x 64 in and out.
pub struct Sharpener {
    estimator: BlurEstimator,
    deblurrer: Deblurrer,
}

impl Sharpener {
    /// Of its two networks.
    pub fn new(estimator: BlurEstimator, deblurrer: Deblurrer) -> Self {
        Self { estimator, deblurrer }
    }

    /// Deblurs a stack; `progress` is called with the number of images that are done. Images of 64 x 64 are taken as they
    /// are: [`Options::measured`] does not apply to them.
    ///
    /// # Errors
    /// [`EnhanceError::Sharpen`] if a network of your own gives no images.
    pub fn deblur(
        &self,
        images: Images<'_, { deblur::SIDE }>,
        options: &Options,
        progress: &mut dyn FnMut(usize),
    ) -> Result<Enhanced, EnhanceError> {
        in_batches(images, self.deblurrer.batch(), progress, |first, batch| {
            let estimated = self.estimator.estimate(batch);
            let stage = Stage { deblurrer: &self.deblurrer, options, first };
            // What is 64 x 64 was not measured by patterns of 32 x 32.
            let (side, all, binding) = (deblur::SIDE, &MeasuredRows::All, options.consistency);
            let sharp = |constraint: &DataConstraint<'_>, estimates: &[Estimate], seed| {
                let readings = constraint.readings();
                let job = stage.job(readings, readings, estimates, seed);
                stage.sharpen(&job, constraint, |index| &readings[index * AREA..][..AREA])
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

/// Both stages: 32 x 32 in, 64 x 64 out.
pub struct Enhancer {
    fusion: Fusion,
    sharpener: Sharpener,
}

impl Enhancer {
    /// Of its three networks.
    pub fn new(fusion: Fusion, sharpener: Sharpener) -> Self {
        Self { fusion, sharpener }
    }

    /// The same enhancer with a sharpening network of your own, in so many steps along the bridge.
    #[must_use]
    pub fn with_network(mut self, network: Box<dyn Sharpen>, steps: NonZeroU32) -> Self {
        self.sharpener.deblurrer = Deblurrer::own(network, steps);
        self
    }

    /// Enhances a stack, with the depth maps that go with it; `progress` is called with the number of images that are
    /// done.
    ///
    /// # Errors
    /// [`EnhanceError`] if the measured rows are not of 32 x 32 readings, or a network of your own gives no images.
    pub fn enhance(
        &self,
        images: Images<'_, { crate::fusion::SIDE }>,
        depth: Option<&DepthMaps>,
        options: &Options,
        progress: &mut dyn FnMut(usize),
    ) -> Result<Enhanced, EnhanceError> {
        const SIDE: usize = crate::fusion::SIDE;
        let Sharpener { estimator, deblurrer } = &self.sharpener;
        in_batches(images, deblurrer.batch(), progress, |first, batch| {
            let depth = depth.map(|depth| depth.of(first, batch.count()));
            let estimated = estimator.estimate(batch);
            let stage = Stage { deblurrer, options, first };
            let sharp = |constraint: &DataConstraint<'_>, estimates: &[Estimate], seed| {
                let readings = constraint.readings();
                let start = self.fusion.upscale(Images::known(readings), depth.as_ref());
                let seen = repeated(readings, SIDE);
                let job = stage.job(&start, &seen, estimates, seed);
                let plain = |index| agreeing(&start, index, constraint);
                let images = stage.sharpen(&job, constraint, plain)?;
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

/// Readings of 32 x 32 as a constraint on the images made of them.
fn constraint_on<'a>(
    readings: &'a [f32],
    estimates: &[Estimate],
    options: &Options,
) -> Result<DataConstraint<'a>, MeasuredRowsError> {
    let side = crate::fusion::SIDE;
    DataConstraint::new(readings, side, estimates, &options.measured, options.consistency)
}

/// Image `index` of FSRCNN's output, moved into agreement with the readings: the gate puts this image in the place of
/// the sharpened one where the readings were sharp and clean.
fn agreeing(start: &[f32], index: usize, constraint: &DataConstraint<'_>) -> Vec<f32> {
    let mut plain = start[index * AREA..][..AREA].to_vec();
    constraint.correct_one(index, &mut plain);
    plain
}

/// The deblurring of one batch.
struct Stage<'a> {
    deblurrer: &'a Deblurrer,
    options: &'a Options,
    first: usize,
}

impl Stage<'_> {
    /// The deblurring of `start`, given the readings as the network sees them.
    fn job<'b>(
        &self,
        start: &'b [f32],
        seen: &'b [f32],
        estimates: &'b [Estimate],
        seed: u64,
    ) -> Job<'b> {
        Job { start, seen, estimates, seed, first: self.first }
    }

    /// Deblurs; images that were sharp and clean become what `plain` makes of their index.
    fn sharpen<I: AsRef<[f32]>>(
        &self,
        job: &Job<'_>,
        constraint: &DataConstraint<'_>,
        plain: impl Fn(usize) -> I + Sync,
    ) -> Result<Vec<f32>, EnhanceError> {
        let mut images = self.deblurrer.run(job, constraint)?;
        if self.options.gate {
            gate::close(job.estimates, AREA, &mut images, plain);
        }
        Ok(images)
    }

    /// Standard deviation over copies of the readings, each enhanced as they were.
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

/// Runs `work` on the stack piece by piece; it is given the index of the piece's first image.
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

/// Each pixel of (N, side, side) twice in both directions.
fn repeated(images: &[f32], side: usize) -> Vec<f32> {
    let rows = images.chunks_exact(side).map(|row| row.iter().flat_map(|&v| [v, v]));
    rows.flat_map(|row| row.clone().chain(row)).collect()
}

#[cfg(test)]
mod tests;
