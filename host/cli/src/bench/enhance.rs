//! `nirspi bench enhance`: the learned stages, timed.

use super::{FASTEST_SWEEPS_HZ, RunArgs, Times, scenes};
use crate::print;
use anyhow::Result;
use nirspi_nets::{Images, Method, Options, UsedWeights, fusion};
use serde::Serialize;
use std::num::NonZeroU32;
use std::process::ExitCode;

/// Time what `enhance` does to many frames: estimate, fusion, deblurring, agreement with the readings
///
/// Frames are soft random blobs with noise, in memory; times are for all of them, from the readings to the images, with whatever
/// a GPU takes for their transfer. The first run, in which a GPU compiles its kernels, is `first_ms`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi bench enhance --frames 256\n\
    \x20 nirspi bench enhance --frames 4096 --backend cuda --no-consistency")]
pub struct Args {
    /// Steps along the bridge
    #[arg(long, value_name = "S", default_value = "1")]
    steps: NonZeroU32,
    #[command(flatten)]
    run: RunArgs,
}

#[derive(Debug, Serialize)]
struct Report {
    device: String,
    weights: Vec<UsedWeights>,
    threads: usize,
    frames: u32,
    steps: u32,
    consistency: bool,
    repeats: u32,
    first_ms: f64,
    /// Everything.
    #[serde(flatten)]
    whole: Times,
    frames_per_s: f64,
    /// Frames a second, of the sweeps a second that the patterns' clock allows.
    of_fastest_sweeps: f64,
    /// Parts of it, each on its own.
    estimate: Times,
    fusion: Times,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let mut networks = args.run.networks.open(&["fsrcnn", "estimator", "diffusion"])?;
    let (estimator, alone) = (networks.estimator()?, networks.fusion()?);
    let method = Method::Diffusion { steps: args.steps };
    let enhancer = networks.enhancer(method)?;
    let options =
        Options { consistency: !args.run.no_consistency, gate: false, ..Options::default() };
    let values = scenes::blobs(args.run.frames as usize, args.run.seed);
    let images: Images<'_, { fusion::SIDE }> = Images::new(&values)?;
    let enhance = || enhancer.enhance(images, None, &options, &mut |_| {});
    let first_ms = Times::of(1, enhance).median_ms;
    enhance()?;
    estimator.estimate(images);
    let whole = Times::of(args.run.repeats, enhance);
    let frames_per_s = f64::from(args.run.frames) / whole.median_ms * 1e3;
    print::json(&Report {
        device: networks.device().name().to_owned(),
        weights: networks.used().to_vec(),
        threads: rayon::current_num_threads(),
        frames: args.run.frames,
        steps: args.steps.get(),
        consistency: options.consistency,
        repeats: args.run.repeats,
        first_ms,
        whole,
        frames_per_s,
        of_fastest_sweeps: frames_per_s / FASTEST_SWEEPS_HZ,
        estimate: Times::of(args.run.repeats, || estimator.estimate(images)),
        fusion: Times::of(args.run.repeats, || alone.upscale(images, None)),
    })?;
    Ok(ExitCode::SUCCESS)
}
