//! `nirspi metrics`: the similarity of two stacks of images, one by one and as sets.

use super::report::ReportArgs;
use super::{print, provenance, refused};
use anyhow::{Context, Result};
use clap::ValueEnum;
use nirspi_eval::sets::{self, Align, Comparison, Options, Scaled};
use nirspi_recon::words::count_of;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Compare two stacks of images, one by one and as sets
///
/// The command prints PSNR and SSIM of the images, and the distance of the sets. A stack is a .npy file of (N, H, W) or (H, W) numbers, a .npz file with `recon`, `image` or `images`, a PNG or JPEG
/// picture, a folder of pictures, or a folder that `reconstruct` or `demo` has written. Numbers are in [0, 1]; nothing is
/// scaled or fitted without --data-range or --align. The Fréchet character distance uses the features of this program's
/// classifier and needs at least two images of 64 x 64 pixels. --json also gives the figures of each image.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi metrics demo/truth.npy demo/reconstruction.npy --align gain-offset\n\
    \x20 nirspi metrics full/ third/ --align gain-offset\n\
    \x20 nirspi metrics sharp.npy deblurred.npy --labels labels.npy --legibility")]
pub struct Args {
    /// The images as they should be
    reference: PathBuf,
    /// The images to judge
    test: PathBuf,
    /// Which character each image shows, (N,), 0 to 61 for 0-9, A-Z, a-z: for the character accuracy
    #[arg(long, value_name = "FILE.npy")]
    labels: Option<PathBuf>,
    /// Let Tesseract read the characters, if it is installed on this machine
    #[arg(long, requires = "labels")]
    legibility: bool,
    /// Bring each test image to its reference by the gain (0 or more) and offset of least squares
    #[arg(long, value_enum)]
    align: Option<AlignArg>,
    /// Range of the data for PSNR and SSIM [default: 1; with --align, the reference's own range if it is not in [0, 1]]
    #[arg(long, value_name = "R")]
    data_range: Option<f64>,
    #[command(flatten)]
    report: ReportArgs,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum AlignArg {
    /// Gain and offset.
    GainOffset,
}

/// What was compared, and how.
#[derive(Serialize)]
struct Report {
    align: &'static str,
    data_range: f64,
    #[serde(flatten)]
    comparison: Comparison,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let stacks = (sets::read_images(&args.reference)?, sets::read_images(&args.test)?);
    let paths = [args.reference.as_path(), args.test.as_path()];
    let align = args.align.map_or(Align::None, |AlignArg::GainOffset| Align::GainOffset);
    let Scaled { reference, test, data_range } =
        sets::scaled(paths, stacks.0, stacks.1, align, args.data_range).map_err(refused)?;
    let named = || args.test.display().to_string();
    let read_labels = |path: &PathBuf| sets::read_labels(path, test.count);
    let labels = args.labels.as_ref().map(read_labels).transpose()?;
    let options = Options { labels: labels.as_deref(), legibility: args.legibility };
    let comparison = sets::compare(&reference, &test, &options).with_context(named)?;
    let align = if args.align.is_some() { "gain-offset" } else { "none" };
    let report = Report { align, data_range, comparison };
    args.report.print(&report, &provenance::computed(), say)
}

fn say(report: &Report) -> Result<()> {
    let Comparison { images, height, width, mean_psnr_db, mean_ssim, sets, .. } =
        &report.comparison;
    let fitted = if report.align == "none" { "" } else { ", gain and offset fitted" };
    print::line(format_args!("{} of {height} x {width}{fitted}", count_of(*images, "image")))?;
    let psnr = mean_psnr_db.map_or_else(|| "identical".to_owned(), |db| format!("{db:.2} dB"));
    print::line(format_args!(
        "PSNR {psnr}, SSIM {mean_ssim:.3} (means; a range of {})",
        report.data_range
    ))?;
    if let Some(distance) = sets.frechet_character_distance {
        print::line(format_args!("Fréchet character distance {distance:.2} (0: the same set)"))?;
    }
    let shares = [
        ("characters recognised", sets.character_accuracy),
        ("read by Tesseract", sets.legibility),
    ];
    for (what, shares) in shares.into_iter().filter_map(|(what, shares)| Some((what, shares?))) {
        let (reference, test) = (100.0 * shares.reference, 100.0 * shares.test);
        print::line(format_args!("{what}: {test:.1} %, of the reference {reference:.1} %"))?;
    }
    sets.notes.iter().try_for_each(print::line)
}
