//! Times the learned stages on many frames: estimate, fusion, deblurring, agreement with the
//! readings.

use super::{FASTEST_SWEEPS_HZ, Times, scenes};
use crate::error::Result;
use nirspi_nets::{BlurEstimator, Enhancer, Fusion, Images, Options, fusion};
use serde::Serialize;

/// The timed networks: the whole chain, and two of its stages alone.
pub struct Stages {
    /// All stages.
    pub enhancer: Enhancer,
    /// The estimator of blur and noise.
    pub estimator: BlurEstimator,
    /// FSRCNN.
    pub fusion: Fusion,
}

/// Times for soft blobs with noise, from the readings in memory to the images in memory, including
/// transfers to and from a GPU.
#[derive(Debug, Serialize)]
pub struct Timed {
    /// The first run, in which a GPU compiles its kernels.
    pub first_ms: f64,
    /// All stages.
    #[serde(flatten)]
    pub whole: Times,
    /// Frames a second, from the median.
    pub frames_per_s: f64,
    /// Frames a second, divided by the sweeps a second that the patterns' clock allows.
    pub of_fastest_sweeps: f64,
    /// The estimator alone.
    pub estimate: Times,
    /// FSRCNN alone.
    pub fusion: Times,
}

/// Times `stages` on `frames` frames.
///
/// # Errors
/// `EvalError` if the device fails.
pub fn time(
    stages: &Stages,
    frames: u32,
    options: &Options,
    repeats: u32,
    seed: u64,
) -> Result<Timed> {
    let Stages { enhancer, estimator, fusion: alone } = stages;
    let values = scenes::blobs(frames as usize, seed);
    let images: Images<'_, { fusion::SIDE }> = Images::new(&values)?;
    let enhance = || enhancer.enhance(images, None, options, &mut |_| {});
    let first_ms = Times::of(1, enhance).median_ms;
    enhance()?;
    estimator.estimate(images);
    let whole = Times::of(repeats, enhance);
    let frames_per_s = f64::from(frames) / whole.median_ms * 1e3;
    Ok(Timed {
        first_ms,
        whole,
        frames_per_s,
        of_fastest_sweeps: frames_per_s / FASTEST_SWEEPS_HZ,
        estimate: Times::of(repeats, || estimator.estimate(images)),
        fusion: Times::of(repeats, || alone.upscale(images, None)),
    })
}
