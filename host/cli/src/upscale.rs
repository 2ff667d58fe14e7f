//! `nirspi dev upscale`: the fusion stage alone.

use super::networks::{ImageArgs, checked};
use super::print;
use super::progress::Progress;
use super::provenance::made;
use super::report::stages;
use anyhow::{Context, Result};
use nirspi::files::npy::{self, Stack};
use nirspi_nets::{DepthMaps, Images, fusion};
use nirspi_recon::words::count_of;
use std::path::PathBuf;
use std::process::ExitCode;

/// Enlarge images from 32 x 32 to 64 x 64, with their depth maps if there are any (FSRCNN)
///
/// The command reads .npy ((N, 32, 32) or (32, 32), in [0, 1] or 8-bit grey levels), a PNG or JPEG picture, or a folder of
/// pictures. It removes noise but not blur; `nirspi enhance` removes both.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi dev upscale measured.npy --out large.npy\n\
    \x20 nirspi dev upscale measured.npy --depth tof.npy --out large/")]
pub struct Args {
    #[command(flatten)]
    depth: DepthArgs,
    #[command(flatten)]
    images: ImageArgs,
}

/// Depth beside the images, the same for `upscale` and `enhance`.
#[derive(Debug, clap::Args)]
pub struct DepthArgs {
    /// Depth maps in metres (.npy), one for all images or one for each: 8 x 8 to 32 x 32 zones, 0 or NaN in zones without a
    /// distance
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
    let mut times = stages();
    let input = times.time("read", || args.images.read(fusion::SIDE))?;
    let images: Images<'_, { fusion::SIDE }> = checked(&input)?;
    let target = args.images.target(&input, &args.images.out)?;
    let provenance = input.taken()?.made(made());
    let depth = args.depth.read(input.count())?;
    let mut networks = args.images.networks.open(&["fsrcnn"])?;
    let fusion = times.time("load", || networks.fusion())?;

    let bar = Progress::of("upscaling", input.count(), "images");
    let large = times.time("upscale", || fusion.upscale(images, depth.as_ref()));
    drop(bar);
    let shown = target.write_and_show(2 * fusion::SIDE, &large, "upscaled", &provenance)?;

    let report = args.images.report(&input, &networks, None, shown, times);
    args.images.report.print(&report, &provenance, |report| {
        print::line(format_args!(
            "{} upscaled to 64 x 64 on {}, in {}; to look at: {}",
            count_of(report.images, "image"),
            report.device,
            report.output.display(),
            report.pictures
        ))
    })
}
