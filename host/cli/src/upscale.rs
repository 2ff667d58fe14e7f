//! `nirspi upscale`: the fusion stage alone.

use super::networks::{ImageArgs, bar, checked};
use super::print;
use super::report::StageTimes;
use anyhow::{Context, Result};
use nirspi::files::npy::{self, Stack};
use nirspi_nets::{DepthMaps, Images, fusion};
use std::path::PathBuf;
use std::process::ExitCode;

/// Enlarge images from 32 x 32 to 64 x 64, with their depth maps if there are any (FSRCNN)
///
/// Reads .npy ((N, 32, 32) or (32, 32), in [0, 1] or 8-bit grey levels), a PNG or a folder of PNGs. Noise goes, blur
/// stays: `nirspi enhance` takes both away.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi upscale measured.npy --out large.npy\n\
    \x20 nirspi upscale measured.npy --depth tof.npy --out large/")]
pub struct Args {
    #[command(flatten)]
    depth: DepthArgs,
    #[command(flatten)]
    images: ImageArgs,
}

/// Depth beside the images, the same for `upscale` and `enhance`.
#[derive(Debug, clap::Args)]
pub struct DepthArgs {
    /// Depth maps in metres (.npy): one for all images or one for each, 8 x 8 to 32 x 32 zones, 0 or NaN where nothing
    /// was seen
    #[arg(long, value_name = "FILE")]
    depth: Option<PathBuf>,
}

impl DepthArgs {
    /// Depth maps for so many images, if there are any.
    pub fn read(&self, images: usize) -> Result<Option<DepthMaps>> {
        let Some(file) = &self.depth else { return Ok(None) };
        let Stack { count, height, width, values } = npy::read_with_gaps(file)?;
        DepthMaps::new(values, [count, height, width], images)
            .map(Some)
            .with_context(|| file.display().to_string())
    }
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let mut times = StageTimes::default();
    let input = times.time("read", || args.images.read(fusion::SIDE))?;
    let images: Images<'_, { fusion::SIDE }> = checked(&input)?;
    let target = input.target(&args.images.out)?;
    let depth = args.depth.read(input.count())?;
    let mut networks = args.images.networks.open(&["fsrcnn"])?;
    let fusion = times.time("load", || networks.fusion())?;

    let bar = bar("upscaling", input.count());
    let large = times.time("upscale", || fusion.upscale(images, depth.as_ref()));
    bar.finish_and_clear();
    let shown = target.write_and_show(2 * fusion::SIDE, &large, "upscaled")?;

    let report = args.images.report(&input, &networks, None, shown, times);
    if args.images.json {
        print::json(&report)?;
    } else {
        print::line(format_args!(
            "{} images upscaled to 64 x 64 on {}, in {}; to look at: {}",
            report.images,
            report.device,
            report.output.display(),
            report.pictures
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}
