//! `nirspi bench pipeline`: from measurements to enhanced images, timed.

#[cfg(feature = "gpu")]
mod gpu;

use super::{FASTEST_SWEEPS_HZ, RunArgs, Times, scenes};
use crate::{Usage, print};
use anyhow::Result;
use nalgebra::DMatrix;
#[cfg(feature = "gpu")]
use nirspi_nets::Backend;
use nirspi_nets::{Enhancer, Images, MeasuredRows, Method, Networks, Options, UsedWeights, fusion};
use nirspi_recon::basis::Transform;
use nirspi_recon::metrics::psnr;
use nirspi_recon::omp::{Limits, MixedDictionary};
use nirspi_recon::{Basis, Order, Side};
use rayon::prelude::*;
use serde::Serialize;
use std::num::NonZeroU32;
use std::process::ExitCode;

/// Time all that the host does to many frames: orthogonal matching pursuit, estimate, fusion, deblurring
///
/// Random rows of a Hadamard matrix, with the one that sees all light, see soft random blobs with noise; Algorithm 1 finds their cosines, and the learned stages enhance
/// the images. On a GPU, images stay there from OMP to the networks, and the same work with images brought to the host in between is
/// timed beside it. Times are for all frames, from measurements in memory to enhanced images in memory.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi bench pipeline --frames 256\n\
    \x20 nirspi bench pipeline --frames 4096 --backend cuda --no-consistency")]
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
    repeats: u32,
    #[serde(flatten)]
    timed: Timed,
    frames_per_s: f64,
    /// Frames a second, of the sweeps a second that the patterns' clock allows.
    of_fastest_sweeps: f64,
    /// PSNR of the reconstructed images, median over the frames.
    reconstructed_psnr_db: f64,
}

/// What was measured.
#[derive(Debug, Serialize)]
struct Timed {
    /// The first run, in which a GPU compiles its kernels.
    first_ms: f64,
    #[serde(flatten)]
    whole: Times,
    /// From measurements to images on the host.
    reconstruct: Times,
    /// From images on the host to enhanced images.
    enhance: Times,
    /// Through images on the host, where the whole leaves them on a GPU.
    #[serde(skip_serializing_if = "Option::is_none")]
    through_host: Option<Times>,
    /// The largest difference of a pixel that this makes.
    #[serde(skip_serializing_if = "Option::is_none")]
    largest_difference: Option<f32>,
    #[serde(skip)]
    reconstructed: Vec<f32>,
}

/// Frames to reconstruct and enhance.
struct Work {
    matrix: DMatrix<f64>,
    limits: Limits,
    /// `frames x measurements`.
    y: Vec<f64>,
    options: Options,
    repeats: u32,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    if args.sparsity > args.measurements {
        let (found, most) = (args.sparsity, args.measurements);
        return Err(Usage(format!("--sparsity is {found}, expected 1 to {most}")).into());
    }
    let side = Side::INSTRUMENT;
    let mut rows = Order::Random(args.run.seed).rows(side)?.to_vec();
    // The pattern that sees all light first, as every order of a camera has it.
    rows.sort_by_key(|&row| row != 0);
    rows.truncate(args.measurements as usize);
    let blobs = scenes::blobs(args.run.frames as usize, args.run.seed);
    let mut y = Vec::new();
    for image in blobs.chunks_exact(side.area()) {
        y.append(&mut scenes::seen_by(&rows, image)?);
    }
    let work = Work {
        matrix: DMatrix::from_row_slice(rows.len(), side.area(), &scenes::cosines_by(&rows)?),
        limits: Limits::atoms(args.sparsity as usize),
        y,
        options: Options {
            consistency: !args.run.no_consistency,
            measured: MeasuredRows::new(side.pixels(), &rows)?,
            ..Options::default()
        },
        repeats: args.run.repeats,
    };
    let mut networks = args.run.networks.open(&["fsrcnn", "estimator", "diffusion"])?;
    #[cfg(feature = "gpu")]
    let (timed, software) = match networks.device().backend() {
        Backend::Cpu => (on_cpu(&work, &mut networks)?, false),
        backend => gpu::time(&work, backend, &mut networks)?,
    };
    #[cfg(not(feature = "gpu"))]
    let (timed, software) = (on_cpu(&work, &mut networks)?, false);
    let images = blobs.chunks_exact(side.area()).zip(timed.reconstructed.chunks_exact(side.area()));
    let mut quality = images
        .map(|(truth, image)| psnr(truth, image, side.pixels(), side.pixels(), 1.0))
        .collect::<Result<Vec<_>, _>>()?;
    quality.sort_by(f64::total_cmp);
    let frames_per_s = f64::from(args.run.frames) / timed.whole.median_ms * 1e3;
    print::json(&Report {
        device: networks.device().name().to_owned(),
        software,
        weights: networks.used().to_vec(),
        threads: rayon::current_num_threads(),
        frames: args.run.frames,
        measurements: args.measurements,
        sparsity: args.sparsity,
        consistency: work.options.consistency,
        repeats: args.run.repeats,
        timed,
        frames_per_s,
        of_fastest_sweeps: frames_per_s / FASTEST_SWEEPS_HZ,
        reconstructed_psnr_db: quality[quality.len() / 2],
    })?;
    Ok(ExitCode::SUCCESS)
}

fn enhancer(networks: &mut Networks) -> Result<Enhancer> {
    let method = Method::Diffusion { steps: NonZeroU32::MIN };
    Ok(networks.enhancer(method)?)
}

/// Enhanced images of reconstructed ones, as they are on the host.
fn enhanced(enhancer: &Enhancer, images: &[f32], options: &Options) -> Result<Vec<f32>> {
    let lit: Vec<f32> = images.par_iter().map(|v| v.clamp(0.0, 1.0)).collect();
    let lit: Images<'_, { fusion::SIDE }> = Images::new(&lit)?;
    Ok(enhancer.enhance(lit, None, options, &mut |_| {})?.images)
}

fn on_cpu(work: &Work, networks: &mut Networks) -> Result<Timed> {
    let enhancer = enhancer(networks)?;
    let dictionary = MixedDictionary::new(work.matrix.clone(), true);
    let transform = Transform::new(Basis::Dct, Side::INSTRUMENT);
    let reconstruct = || -> Result<Vec<f32>> {
        let (solutions, _) = dictionary.solve_batch(&work.limits, &work.y)?;
        let mut images = vec![0.0; solutions.len() * Side::INSTRUMENT.area()];
        let frames = images.par_chunks_exact_mut(Side::INSTRUMENT.area()).zip(&solutions);
        frames.for_each(|(image, solution)| {
            for (&atom, &value) in solution.support.iter().zip(&solution.coefficients) {
                image[atom] = value as f32;
            }
            transform.synthesise(image);
        });
        Ok(images)
    };
    let whole = || enhanced(&enhancer, &reconstruct()?, &work.options);
    let first_ms = Times::of(1, whole).median_ms;
    let reconstructed = reconstruct()?;
    whole()?;
    Ok(Timed {
        first_ms,
        whole: Times::of(work.repeats, whole),
        reconstruct: Times::of(work.repeats, reconstruct),
        enhance: Times::of(work.repeats, || enhanced(&enhancer, &reconstructed, &work.options)),
        through_host: None,
        largest_difference: None,
        reconstructed,
    })
}
