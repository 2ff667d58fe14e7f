//! The learned stages as one: estimate blur and noise, fuse with depth, deblur, hold against the readings.
//!
//! Law: nothing leaves without its inconsistency, the figure that says whether the readings bear it out.

#[cfg(feature = "gpu")]
mod device;

use rayon::prelude::*;

use crate::consistency::{Consistency, MeasuredRows};
use crate::deblur::{self, AREA, Deblurrer, Job, Truth};
use crate::estimate::{BlurEstimator, Estimate};
use crate::fusion::{DepthMaps, Fusion};
use crate::gate;
use crate::images::Images;
use crate::spread::{Moments, doubled, measured_again};

#[cfg(feature = "gpu")]
pub use device::{DeviceEnhancer, DeviceEnhancerError};

/// How a stack is deblurred or enhanced.
#[derive(Debug, Clone)]
pub struct Options {
    /// Shall each step agree with the readings?
    pub consistency: bool,
    /// Shall sharp and clean images stay as they are?
    pub gate: bool,
    /// Hadamard rows that 32 x 32 readings are made of, if not all.
    pub measured: Option<MeasuredRows>,
    /// Blur and noise, where they are known better than by the estimator.
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
            measured: None,
            estimate: KnownEstimate::default(),
            seed: 0,
            copies: 0,
        }
    }
}

/// What the caller knows of blur and noise.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct KnownEstimate {
    /// Blur in pixels of the 64 x 64 grid.
    pub sigma_px: Option<f32>,
    /// Noise of a reading.
    pub noise: Option<f32>,
}

impl KnownEstimate {
    /// The estimate with what is known in its place.
    pub fn over(self, estimated: Estimate) -> Estimate {
        Estimate {
            sigma_px: self.sigma_px.unwrap_or(estimated.sigma_px),
            noise: self.noise.unwrap_or(estimated.noise),
        }
    }
}

/// Enhanced images and what is known about them.
#[derive(Debug, Clone, Default)]
pub struct Enhanced {
    /// (N, 64, 64) in [0, 1].
    pub images: Vec<f32>,
    /// (N, 64, 64): the images before deblurring, where they had to be enlarged.
    pub upscaled: Option<Vec<f32>>,
    /// Blur and noise of each image's readings.
    pub estimates: Vec<Estimate>,
    /// Distance of the readings from those of each image, over their noise: near 1 or below, they agree.
    pub inconsistency: Vec<f32>,
    /// (N, 64, 64): standard deviation over the copies asked for.
    pub spread: Option<Vec<f32>>,
}

impl Enhanced {
    fn append(&mut self, mut other: Self) {
        fn join(all: &mut Option<Vec<f32>>, more: Option<Vec<f32>>) {
            if let Some(more) = more {
                all.get_or_insert_default().extend(more);
            }
        }
        self.images.append(&mut other.images);
        self.estimates.append(&mut other.estimates);
        self.inconsistency.append(&mut other.inconsistency);
        join(&mut self.upscaled, other.upscaled);
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

    /// Deblurs a stack; `progress` is told how many images are done.
    pub fn deblur(
        &self,
        images: Images<'_, { deblur::SIDE }>,
        options: &Options,
        progress: &mut dyn FnMut(usize),
    ) -> Enhanced {
        // What is 64 x 64 was not measured by patterns of 32 x 32.
        let options = &Options { measured: None, ..options.clone() };
        in_batches(images, self.deblurrer.batch(), progress, |first, batch| {
            let estimates = known(options, self.estimator.estimate(batch));
            let stage = Stage { deblurrer: &self.deblurrer, options, first };
            let sharp = |readings: &[f32], estimates: &[Estimate], seed| {
                let job = stage.job([readings; 3], deblur::SIDE, estimates, seed);
                stage.sharpen(&job, readings)
            };
            let images = sharp(batch.values(), &estimates, options.seed);
            let spread = stage.spread(batch.values(), &estimates, sharp);
            let inconsistency = inconsistency(options, batch, &estimates, &images);
            Enhanced { images, upscaled: None, estimates, inconsistency, spread }
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

    /// Enhances a stack, with the depth maps that go with it; `progress` is told how many images are done.
    pub fn enhance(
        &self,
        images: Images<'_, { crate::fusion::SIDE }>,
        depth: Option<&DepthMaps>,
        options: &Options,
        progress: &mut dyn FnMut(usize),
    ) -> Enhanced {
        const SIDE: usize = crate::fusion::SIDE;
        let Sharpener { estimator, deblurrer } = &self.sharpener;
        in_batches(images, deblurrer.batch(), progress, |first, batch| {
            let depth = depth.map(|depth| depth.of(first, batch.count()));
            let estimates = known(options, estimator.estimate(batch));
            let stage = Stage { deblurrer, options, first };
            let sharp = |readings: &[f32], estimates: &[Estimate], seed| {
                let start = self.fusion.upscale(Images::known(readings), depth.as_ref());
                let seen = repeated(readings, SIDE);
                let job = stage.job([&start, &seen, readings], SIDE, estimates, seed);
                // What FSRCNN made of a sharp image is no measurement yet: it has to agree with it.
                let mut plain = start.clone();
                Truth::new(&job).correct(&mut plain);
                let images = stage.sharpen(&job, &plain);
                (start, images)
            };
            let (upscaled, images) = sharp(batch.values(), &estimates, options.seed);
            let again =
                |readings: &[f32], estimates: &[Estimate], seed| sharp(readings, estimates, seed).1;
            let spread = stage.spread(batch.values(), &estimates, again);
            let inconsistency = inconsistency(options, batch, &estimates, &images);
            Enhanced { images, upscaled: Some(upscaled), estimates, inconsistency, spread }
        })
    }
}

/// The deblurring of one batch.
struct Stage<'a> {
    deblurrer: &'a Deblurrer,
    options: &'a Options,
    first: usize,
}

impl Stage<'_> {
    /// The deblurring of `start`, given the readings as the network sees them and as they are.
    fn job<'b>(
        &'b self,
        [start, seen, readings]: [&'b [f32]; 3],
        readings_side: usize,
        estimates: &'b [Estimate],
        seed: u64,
    ) -> Job<'b> {
        Job {
            start,
            seen,
            readings,
            readings_side,
            estimates,
            measured: self.options.measured.as_ref(),
            consistency: self.options.consistency,
            seed,
            first: self.first,
        }
    }

    /// Deblurs, but for what is sharp and clean: there `plain` stands.
    fn sharpen(&self, job: &Job<'_>, plain: &[f32]) -> Vec<f32> {
        let mut images = self.deblurrer.run(job);
        if self.options.gate {
            gate::close(job.estimates, plain, &mut images);
        }
        images
    }

    /// Standard deviation over copies of the readings, each enhanced as they were.
    fn spread(
        &self,
        readings: &[f32],
        estimates: &[Estimate],
        enhance: impl Fn(&[f32], &[Estimate], u64) -> Vec<f32>,
    ) -> Option<Vec<f32>> {
        (self.options.copies > 0).then(|| {
            let noisier = doubled(estimates);
            let mut moments = Moments::new(estimates.len() * AREA);
            for copy in 1..=u64::from(self.options.copies) {
                let seed = self.options.seed ^ copy << 32;
                let readings = measured_again(readings, estimates, seed, self.first);
                moments.add(&enhance(&readings, &noisier, seed));
            }
            moments.deviation()
        })
    }
}

fn known(options: &Options, estimated: Vec<Estimate>) -> Vec<Estimate> {
    estimated.into_iter().map(|e| options.estimate.over(e)).collect()
}

fn inconsistency<const SIDE: usize>(
    options: &Options,
    readings: Images<'_, SIDE>,
    estimates: &[Estimate],
    images: &[f32],
) -> Vec<f32> {
    let each = readings.values().par_chunks_exact(SIDE * SIDE).zip(images.par_chunks_exact(AREA));
    each.zip(estimates)
        .map(|((readings, image), estimate)| {
            let measured = options.measured.clone();
            Consistency::new(SIDE, estimate.sigma_px, estimate.noise, measured)
                .residual_ratio(readings, image)
        })
        .collect()
}

/// Runs `work` on the stack piece by piece; it is given the index of the piece's first image.
fn in_batches<const SIDE: usize>(
    images: Images<'_, SIDE>,
    batch: usize,
    progress: &mut dyn FnMut(usize),
    work: impl Fn(usize, Images<'_, SIDE>) -> Enhanced,
) -> Enhanced {
    let mut all = Enhanced::default();
    for (index, chunk) in images.values().chunks(batch * SIDE * SIDE).enumerate() {
        all.append(work(index * batch, Images::known(chunk)));
        progress(all.estimates.len());
    }
    all
}

/// Each pixel of (N, side, side) twice in both directions.
fn repeated(images: &[f32], side: usize) -> Vec<f32> {
    let rows = images.chunks_exact(side).map(|row| row.iter().flat_map(|&v| [v, v]));
    rows.flat_map(|row| row.clone().chain(row)).collect()
}

#[cfg(test)]
mod tests;
