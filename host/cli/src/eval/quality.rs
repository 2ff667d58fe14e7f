//! `nirspi eval quality`: the quality of enhanced images, on characters outside the training data
//! and on other scenes.

use crate::print;
use crate::progress::Progress;
use crate::provenance;
use crate::report::{FigureArgs, ReportArgs};
use anyhow::Result;
use nirspi::files::output::OutputDir;
use nirspi_eval::quality::{Condition, Measured, Report, Settings, Study, Version};
use std::path::PathBuf;
use std::process::ExitCode;

/// Quality against blur, noise and number of steps, on characters never seen in training; and what is no character
///
/// Sharp 64 x 64 images are blurred (Gaussian, sigma in pixels of 64), sampled to 32 x 32 by means of 2 x 2, given
/// noise, and enhanced by every row: Lanczos, three classical methods that get blur and noise, and the networks, which
/// get neither. Writes quality.json, charts, and pictures of scenes that are no letters.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi eval quality --data chars74k/ --scenes scenes/ --spi spi/ --out quality/")]
pub struct Args {
    /// Characters: .npz stacks (x, label, family or writer) or Chars74K's folder
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Groups of each stack that training has not seen, as JSON [default: those of the built-in weights]. A stack that the
    /// file does not name is used whole
    #[arg(long, value_name = "FILE")]
    held_out: Option<PathBuf>,
    /// Folder of PNG pictures; parts of them are enhanced as scenes that are no letters
    #[arg(long, value_name = "DIR")]
    scenes: Option<PathBuf>,
    /// Folder of real measurements (.npz), reconstructed and enhanced
    #[arg(long, value_name = "DIR")]
    spi: Option<PathBuf>,
    /// Folder with weights of your own, one NETWORK.safetensors each; a network without a file there runs with the built-in weights
    #[arg(long, value_name = "DIR")]
    weights: Option<PathBuf>,
    /// Images of each stack
    #[arg(long, value_name = "N", default_value_t = 20,
          value_parser = clap::value_parser!(u32).range(2..=100_000))]
    count: u32,
    /// Images of each stack for the curve over steps, which takes up to 500 network calls for each image
    #[arg(long, value_name = "N", default_value_t = 4,
          value_parser = clap::value_parser!(u32).range(2..=100_000))]
    sampler_count: u32,
    /// Most steps of the curve over steps
    #[arg(long, value_name = "N", default_value_t = 500,
          value_parser = clap::value_parser!(u32).range(1..=500))]
    most_steps: u32,
    /// Seed of the choice of images and of the noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "quality")]
    out: PathBuf,
    #[command(flatten)]
    figure: FigureArgs,
    #[command(flatten)]
    report: ReportArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    OutputDir::create(&args.out)?.check(["quality.json"])?;
    let study = Study::new(Settings {
        data: args.data.clone(),
        held_out: args.held_out.clone(),
        scenes: args.scenes.clone(),
        spi: args.spi.clone(),
        weights: args.weights.clone(),
        count: args.count as usize,
        sampler_count: args.sampler_count as usize,
        most_steps: args.most_steps,
        seed: args.seed,
    })?;
    let bar = Progress::of("quality", study.images(), "pictures");
    let Measured { report, pictures } = study.run(&|images| bar.add(images as u64))?;
    drop(bar);
    let provenance = provenance::simulated();
    let mut out = OutputDir::create(&args.out)?;
    for (name, figure) in &pictures {
        figure.write(&mut out, name, args.figure.figure, &provenance)?;
    }
    out.write("quality.json", provenance.sign(&report)?.as_bytes())?;
    out.commit()?;
    args.report.print(&report, &provenance, |report| say(args, report))
}

fn say(args: &Args, report: &Report) -> Result<()> {
    for origin in &report.images {
        print::line(format_args!(
            "{}: {} images of {} families, writers or photographs, {}",
            origin.stack, origin.images, origin.groups, origin.choice
        ))?;
    }
    let version = |v: &Version| format!("{} {}", v.model, v.version);
    let versions: Vec<String> = report.weights.iter().map(version).collect();
    print::line(format_args!("weights: {}", versions.join(", ")))?;
    print::line("PSNR dB / SSIM / Fréchet character distance / characters seen right")?;
    let mut shown: Option<Condition> = None;
    for figures in report.conditions.iter().chain(&report.steps).filter(|f| f.stack.is_none()) {
        if shown.replace(figures.condition) != Some(figures.condition) {
            print::line(figures.condition)?;
        }
        print::line(figures)?;
    }
    print::notes(&report.notes)?;
    print::line(format_args!("wrote charts, others.png and quality.json to {}", args.out.display()))
}
