//! `nirspi dev bench enhance`: times the learned stages.

use super::RunArgs;
use crate::networks::say_notes;
use crate::sharpening::in_steps;
use crate::{print, provenance};
use anyhow::Result;
use nirspi_eval::bench::enhance::{Stages, Timed, time};
use nirspi_nets::deblur::Model;
use nirspi_nets::{Options, UsedWeights};
use serde::Serialize;
use std::num::NonZeroU32;
use std::process::ExitCode;

/// Time what `enhance` does to many frames: estimate, fusion, deblurring, agreement with the readings
///
/// Frames are soft random blobs with noise, in memory; times are for all of them, from the readings to the images, with whatever
/// a GPU takes for their transfer. The first run, in which a GPU compiles its kernels, is `first_ms`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi dev bench enhance --frames 256\n\
    \x20 nirspi dev bench enhance --frames 4096 --backend cuda --precision f16")]
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
    precision: String,
    repeats: u32,
    #[serde(flatten)]
    timed: Timed,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let run = &args.run;
    let mut networks = run.networks.open(&["fsrcnn", "estimator", "diffusion"])?;
    let method = in_steps(Model::DIFFUSION, Some(args.steps))?;
    let stages = Stages {
        estimator: networks.estimator()?,
        fusion: networks.fusion()?,
        enhancer: networks.enhancer(method)?,
    };
    let options = Options { consistency: !run.no_consistency, ..Options::default() };
    let timed = time(&stages, run.frames, &options, run.repeats, run.seed)?;
    say_notes(&networks);
    let report = Report {
        device: networks.device().name().to_owned(),
        weights: networks.used().to_vec(),
        threads: nirspi_eval::bench::threads(),
        frames: run.frames,
        steps: args.steps.get(),
        consistency: options.consistency,
        precision: networks.device().arithmetic().to_string(),
        repeats: run.repeats,
        timed,
    };
    print::json(&report, &provenance::computed())?;
    Ok(ExitCode::SUCCESS)
}
