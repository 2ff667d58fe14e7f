//! `nirspi enhance`: fusion and deblurring, from the camera's 32 x 32 to the 64 x 64 output.

use super::deblur::Sharpening;
use super::networks::{Deblurring, ImageArgs, Report, bar, checked};
use super::print;
use super::report::StageTimes;
use super::upscale::DepthArgs;
use anyhow::Result;
use nirspi_nets::{Images, Method, fusion};
use std::num::NonZeroU32;
use std::process::ExitCode;

/// Enlarge and deblur images, 32 x 32 to 64 x 64: fusion with depth, then the diffusion bridge
///
/// Reads .npy ((N, 32, 32) or (32, 32), in [0, 1] or 8-bit grey levels), a PNG or a folder of PNGs. Blur and noise are
/// estimated from each image; each result is kept in agreement with the readings, and the report says how well it agrees.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi enhance measured.npy --out sharp.npy\n\
    \x20 nirspi enhance measured/ --depth tof.npy --spread spread.npy --out sharp/")]
pub struct Args {
    #[command(flatten)]
    depth: DepthArgs,
    /// Steps along the bridge: 1 has the least error and takes the least time
    #[arg(long, value_name = "S", default_value = "1")]
    steps: NonZeroU32,
    #[command(flatten)]
    sharpening: Sharpening,
    #[command(flatten)]
    images: ImageArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let options = args.sharpening.options()?;
    let method = Method::Diffusion { steps: args.steps };
    let mut times = StageTimes::default();
    let input = times.time("read", || args.images.read(fusion::SIDE))?;
    let images: Images<'_, { fusion::SIDE }> = checked(&input)?;
    let target = input.target(&args.images.out)?;
    let depth = args.depth.read(input.count())?;
    let mut networks = args.images.networks.open(&["fsrcnn", "estimator", "diffusion"])?;
    let enhancer = times.time("load", || networks.enhancer(method))?;

    let bar = bar("enhancing", input.count());
    let result = times.time("enhance", || {
        enhancer
            .enhance(images, depth.as_ref(), &options, &mut |done| bar.set_position(done as u64))
    })?;
    bar.finish_and_clear();
    args.sharpening.write_spread(&input, result.spread.as_deref())?;
    let shown = target.write_and_show(2 * fusion::SIDE, &result.images, "enhanced")?;

    let steps = args.steps.get();
    let deblurring = Deblurring::of("diffusion", steps, options.consistency, options.seed, &result);
    let report = args.images.report(&input, &networks, Some(deblurring), shown, times);
    print_report(&report, args.images.json)?;
    Ok(ExitCode::SUCCESS)
}

/// As JSON, or in two lines.
pub fn print_report(report: &Report, json: bool) -> Result<()> {
    if json {
        return print::json(report);
    }
    if let Some(deblurring) = &report.deblurring {
        print::line(deblurring.line())?;
    }
    print::line(format_args!(
        "{} images on {}, in {}; to look at: {}",
        report.images,
        report.device,
        report.output.display(),
        report.pictures
    ))
}
