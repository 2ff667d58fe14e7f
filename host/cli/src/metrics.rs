//! `nirspi metrics`: how alike two stacks of images are, one by one and as sets.

use super::print;
use anyhow::{Context, Result, bail};
use indicatif::{ProgressBar, ProgressStyle};
use nirspi::files::npy::Stack;
use nirspi_eval::Fid;
use nirspi_eval::sets::{self, Options};
use std::path::PathBuf;
use std::process::ExitCode;

/// Compare two .npy stacks of images: PSNR, SSIM, data range 1, and how far apart they are as sets
///
/// Both hold (N, H, W) or (H, W) numbers in [0, 1]; nothing is scaled or fitted. The Fréchet character distance, on the
/// features of this program's classifier, needs 64 x 64 and two images; FID needs your Inception weights.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi metrics demo/truth.npy demo/reconstruction.npy\n\
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
    /// Print JSON, as it does anyway
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let reference = sets::read_images(&args.reference)?;
    let test = sets::read_images(&args.test)?;
    let named = || args.test.display().to_string();
    let shape = |s: &Stack| (s.count, s.height, s.width);
    if shape(&reference) != shape(&test) {
        let (found, expected) = (shape(&test), shape(&reference));
        bail!(
            "{}: shape {found:?}, expected {expected:?} as in {}",
            named(),
            args.reference.display()
        );
    }
    let read_labels = |path: &PathBuf| sets::read_labels(path, test.count);
    let labels = args.labels.as_ref().map(read_labels).transpose()?;
    let fid = args.inception.as_deref().map(Fid::read).transpose()?;
    let options =
        Options { labels: labels.as_deref(), fid: fid.as_ref(), legibility: args.legibility };
    let style = ProgressStyle::with_template("inception {bar:30} {pos}/{len}, {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(2 * test.count as u64).with_style(style);
    let report = sets::compare(&reference, &test, &options, &|| bar.inc(1)).with_context(named)?;
    bar.finish_and_clear();
    print::json(&report)?;
    Ok(ExitCode::SUCCESS)
}
