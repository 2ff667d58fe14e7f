//! `nirspi metrics`: how alike two stacks of images are, one by one and as sets.

mod sets;

use super::print;
use anyhow::{Context, Result, bail};
use nirspi::files::npy::{Stack, read_stack};
use nirspi_recon::metrics;
use serde::Serialize;
use sets::Sets;
use std::path::{Path, PathBuf};
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

#[derive(Debug, Serialize)]
struct ImageMetrics {
    psnr_db: Option<f64>,
    ssim: f64,
}

#[derive(Debug, Serialize)]
struct Report {
    images: usize,
    height: usize,
    width: usize,
    /// `null`: all images are identical.
    mean_psnr_db: Option<f64>,
    mean_ssim: f64,
    #[serde(flatten)]
    sets: Sets,
    each: Vec<ImageMetrics>,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let reference = load(&args.reference)?;
    let test = load(&args.test)?;
    let shape = |s: &Stack| (s.count, s.height, s.width);
    if shape(&reference) != shape(&test) {
        bail!(
            "{}: shape {:?}, expected {:?} as in {}",
            args.test.display(),
            shape(&test),
            shape(&reference),
            args.reference.display()
        );
    }
    let (height, width) = (reference.height, reference.width);
    let mut each = Vec::with_capacity(reference.count);
    let pairs = reference.values.chunks_exact(height * width);
    for (a, b) in pairs.zip(test.values.chunks_exact(height * width)) {
        let named = || args.test.display().to_string();
        let psnr = metrics::psnr(a, b, width, height, 1.0).with_context(named)?;
        each.push(ImageMetrics {
            // Identical images have no finite one, and JSON no infinity.
            psnr_db: psnr.is_finite().then_some(psnr),
            ssim: metrics::ssim(a, b, width, height, 1.0).with_context(named)?,
        });
    }
    let n = each.len() as f64;
    let finite: Vec<f64> = each.iter().filter_map(|image| image.psnr_db).collect();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let report = Report {
        images: reference.count,
        height,
        width,
        mean_psnr_db: (!finite.is_empty()).then(|| mean(&finite)),
        mean_ssim: each.iter().map(|image| image.ssim).sum::<f64>() / n,
        sets: Sets::compare(args, &reference, &test)?,
        each,
    };
    print::json(&report)?;
    Ok(ExitCode::SUCCESS)
}

/// A stack of images in `[0, 1]`.
fn load(path: &Path) -> Result<Stack> {
    let stack = read_stack(path)?;
    let outside = stack.values.iter().position(|v| !(0.0..=1.0).contains(v));
    if let Some(at) = outside {
        let (image, pixel) = (at / (stack.height * stack.width), at % (stack.height * stack.width));
        let (row, column) = (pixel / stack.width, pixel % stack.width);
        let found = stack.values[at];
        bail!("{}: {found} at [{image}, {row}, {column}], expected 0 to 1", path.display());
    }
    if stack.count == 0 {
        return Err(anyhow::anyhow!("no images")).with_context(|| path.display().to_string());
    }
    Ok(stack)
}
