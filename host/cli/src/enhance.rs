//! `nirspi enhance`: fusion and deblurring, from the camera's 32 x 32 to the 64 x 64 output.

use super::networks::{ImageArgs, checked, say};
use super::progress::Progress;
use super::provenance::made;
use super::report::{stages, words};
use super::sharpening::{Sharpening, in_steps};
use super::upscale::DepthArgs;
use anyhow::Result;
use nirspi::imaging::Deblurring;
use nirspi_nets::deblur::Model;
use nirspi_nets::interval::Readings;
use nirspi_nets::{Images, fusion};
use nirspi_recon::reconstruct::Method;
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::process::ExitCode;

/// Enlarge and deblur images, from 32 x 32 to 64 x 64
///
/// One network enlarges, with depth maps if there are any; a diffusion network deblurs.
/// The command reads .npy ((N, 32, 32) or (32, 32), in [0, 1] or 8-bit grey levels), a PNG or JPEG picture, or a folder of
/// pictures. Blur and noise are estimated from each image. Each result is kept in agreement with its image, and the report
/// says how well they agree.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi enhance measured.npy --out sharp.npy\n\
    \x20 nirspi enhance measured.npy --interval interval.npy --method tikhonov --sampling 0.5 --readings-noise 0.03 --out sharp.npy\n\
    \x20 nirspi enhance measured/ --depth tof.npy --spread spread.npy --out sharp/")]
pub struct Args {
    #[command(flatten)]
    depth: DepthArgs,
    #[command(flatten)]
    sharpening: Sharpening,
    /// Steps of the deblurring network: 1 has the least error and takes the least time
    #[arg(long, value_name = "S", default_value = "1")]
    steps: NonZeroU32,
    /// Also write the half-width of the calibrated 95 % interval of each pixel (.npy). An interval needs to know how the
    /// images were made: --method, --sampling and --readings-noise
    #[arg(
        long,
        value_name = "FILE",
        requires = "method",
        requires = "sampling",
        requires = "readings_noise"
    )]
    interval: Option<PathBuf>,
    /// With --interval: the method that made the images of the readings, with its default settings
    #[arg(long, value_name = "METHOD", requires = "interval",
          value_parser = words(Method::ALL, |method| (method.argument(), method.about())))]
    method: Option<Method>,
    /// With --interval: the share of the patterns that were measured, 0.1 to 1
    #[arg(long, value_name = "S", requires = "interval")]
    sampling: Option<f32>,
    /// With --interval: noise of the readings: the standard deviation of a pixel of the plain transform of all patterns; white
    /// is 1
    #[arg(long, value_name = "N", requires = "interval")]
    readings_noise: Option<f32>,
    #[command(flatten)]
    images: ImageArgs,
}

impl Args {
    /// How the images were made, if that was told.
    fn readings(&self) -> Option<Readings<'static>> {
        let method = self.method?.argument();
        Some(Readings { method, share: self.sampling?, noise: self.readings_noise? })
    }
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let options = args.sharpening.options()?;
    let method = in_steps(Model::DIFFUSION, Some(args.steps))?;
    let mut times = stages();
    let input = times.time("read", || args.images.read(fusion::SIDE))?;
    let images: Images<'_, { fusion::SIDE }> = checked(&input)?;
    let target = args.images.target(&input, &args.images.out)?;
    let spread = args.sharpening.spread_target(&args.images, &input)?;
    let interval =
        args.interval.as_ref().map(|file| args.images.target(&input, file)).transpose()?;
    let provenance = input.taken()?.made(made());
    let depth = args.depth.read(input.count())?;
    let mut networks = args.images.networks.open(&["fsrcnn", "estimator", "diffusion"])?;
    let enhancer = times.time("load", || networks.enhancer(method))?;

    let intervals = interval.as_ref().map(|_| networks.intervals(method, &options)).transpose()?;
    let readings = args.readings();
    // The refusal comes before the work.
    if let (Some(intervals), Some(readings)) = (&intervals, &readings) {
        intervals.table(readings)?;
    }

    let bar = Progress::of("enhancing", input.count(), "images");
    let result = times.time("enhance", || {
        enhancer.enhance(images, depth.as_ref(), &options, &mut |done| bar.set(done))
    })?;
    drop(bar);
    if let (Some(target), Some(spread)) = (spread, &result.spread) {
        target.write(2 * fusion::SIDE, spread, &provenance)?;
    }
    if let (Some(target), Some(intervals), Some(readings)) = (interval, intervals, readings) {
        let shown = intervals.of(&result, &readings)?;
        target.write(2 * fusion::SIDE, &shown, &provenance)?;
    }
    let shown = target.write_and_show(2 * fusion::SIDE, &result.images, "enhanced", &provenance)?;

    let steps = args.steps.get();
    let deblurring = Deblurring::of("diffusion", steps, options.consistency, options.seed, &result);
    let report = args.images.report(&input, &networks, Some(deblurring), shown, times);
    args.images.report.print(&report, &provenance, say)
}
