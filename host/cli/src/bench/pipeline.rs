//! `nirspi dev bench pipeline`: times the path from measurements to enhanced images.

use super::RunArgs;
use crate::networks::say_notes;
use crate::{print, provenance, refused};
use anyhow::Result;
use nirspi_eval::bench::pipeline::{Settings, Timed, Work, on_cpu};
use nirspi_nets::{Method, Networks, UsedWeights};
use serde::Serialize;
use std::process::ExitCode;

/// Time all that the host does to many frames: orthogonal matching pursuit, estimate, fusion, deblurring
///
/// Random rows of a Hadamard matrix, with the row that sees all light, measure soft random blobs with noise; Algorithm 1
/// finds their cosines, and the learned stages enhance the images. On a GPU, images stay there from OMP to the networks, and
/// the same work with images brought to the host in between is timed beside it. Times are for all frames, from measurements in memory to enhanced images in memory.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi dev bench pipeline --frames 256\n\
    \x20 nirspi dev bench pipeline --frames 4096 --backend cuda --precision f16")]
pub struct Args {
    /// Measurements of a frame, of 1024
    #[arg(long, value_name = "M", default_value_t = 512, value_parser = clap::value_parser!(u32).range(1..=1024))]
    measurements: u32,
    /// Atoms to choose, no more than measurements
    #[arg(long, value_name = "K", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1024))]
    sparsity: u32,
    #[command(flatten)]
    run: RunArgs,
}

#[derive(Debug, Serialize)]
struct Report {
    device: String,
    /// Whether the processor plays the GPU: its times say nothing of one.
    software: bool,
    weights: Vec<UsedWeights>,
    threads: usize,
    frames: u32,
    measurements: u32,
    sparsity: u32,
    consistency: bool,
    precision: String,
    repeats: u32,
    #[serde(flatten)]
    timed: Timed,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let run = &args.run;
    let settings = Settings {
        frames: run.frames,
        measurements: args.measurements,
        sparsity: args.sparsity,
        consistency: !run.no_consistency,
        repeats: run.repeats,
        seed: run.seed,
    };
    let work = Work::new(settings).map_err(refused)?;
    let mut networks = run.networks.open(&["fsrcnn", "estimator", "diffusion"])?;
    let (timed, software) = time(&work, &mut networks)?;
    say_notes(&networks);
    let report = Report {
        device: networks.device().name().to_owned(),
        software,
        weights: networks.used().to_vec(),
        threads: nirspi_eval::bench::threads(),
        frames: run.frames,
        measurements: args.measurements,
        sparsity: args.sparsity,
        consistency: settings.consistency,
        precision: networks.device().arithmetic().to_string(),
        repeats: run.repeats,
        timed,
    };
    print::json(&report, &provenance::computed())?;
    Ok(ExitCode::SUCCESS)
}

/// The times on the networks' device, and whether the processor plays it.
fn time(work: &Work, networks: &mut Networks) -> Result<(Timed, bool)> {
    let enhancer = networks.enhancer(Method::default())?;
    if networks.device().backend() != nirspi_nets::Backend::Cpu {
        use anyhow::Context;
        let backend = networks.device().backend();
        let device = nirspi_recon::omp::gpu::Device::open(backend)?
            .context("the networks' device has no kernels for OMP")?;
        let on_device = networks.device_enhancer()?;
        let timed = nirspi_eval::bench::pipeline::on_gpu(work, &device, &on_device, &enhancer)?;
        return Ok((timed, device.is_software()));
    }
    Ok((on_cpu(work, &enhancer)?, false))
}
