//! `nirspi metrics`: the similarity of two stacks of images, one by one and as sets.

use super::{print, refused};
use anyhow::{Context, Result};
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use nirspi_eval::Fid;
use nirspi_eval::sets::{self, Align, Comparison, Options, Scaled};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Compare two stacks of images: PSNR, SSIM, and how far apart they are as sets
///
/// Each is a .npy file of (N, H, W) or (H, W) numbers, a .npz file with `recon`, `image` or `images`, a PNG or JPEG picture, a folder of
/// pictures, or a folder that `reconstruct` or `demo` has written. Numbers are in [0, 1], and nothing is scaled or fitted unless
/// --data-range or --align say so. The Fréchet character distance, on the
/// features of this program's classifier, needs 64 x 64 and two images; FID needs your Inception weights.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi metrics demo/truth.npy demo/reconstruction.npy\n\
    \x20 nirspi metrics full/ third/ --align gain-offset\n\
    \x20 nirspi metrics sharp.npy deblurred.npy --labels labels.npy --legibility\n\
    \x20 nirspi metrics sharp.npy deblurred.npy --inception inception.safetensors")]
pub struct Args {
    /// The images as they should be
    reference: PathBuf,
    /// The images to judge
    test: PathBuf,
    /// Which character each image shows, (N,), 0 to 61 for 0-9, A-Z, a-z: for the character accuracy
    #[arg(long, value_name = "FILE.npy")]
    labels: Option<PathBuf>,
    /// Inception-v3's weights in safetensors with torchvision's names, for FID (pytorch-fid's file:
    /// host/nets/scripts/inception_to_safetensors.py)
    #[arg(long, value_name = "FILE")]
    inception: Option<PathBuf>,
    /// Ask Tesseract to read the characters, where this machine has it
    #[arg(long, requires = "labels")]
    legibility: bool,
    /// Bring each test image to its reference by the gain (0 or more) and offset of least squares
    #[arg(long, value_enum)]
    align: Option<AlignArg>,
    /// Range of the data for PSNR and SSIM; default: 1, or with --align the reference's own if that is not in [0, 1]
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    data_range: Option<f64>,
    /// Print JSON, as it does anyway
    #[arg(long)]
    json: bool,
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
    let fid = args.inception.as_deref().map(Fid::read).transpose()?;
    let options =
        Options { labels: labels.as_deref(), fid: fid.as_ref(), legibility: args.legibility };
    let style = ProgressStyle::with_template("inception {bar:30} {pos}/{len}, {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(2 * test.count as u64).with_style(style);
    let comparison =
        sets::compare(&reference, &test, &options, &|| bar.inc(1)).with_context(named)?;
    bar.finish_and_clear();
    let align = if args.align.is_some() { "gain-offset" } else { "none" };
    print::json(&Report { align, data_range, comparison })?;
    Ok(ExitCode::SUCCESS)
}
