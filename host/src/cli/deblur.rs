//! `nirspi deblur`: the deblurring stage alone, by the network of choice.

use super::Usage;
use super::enhance::print_report;
use super::networks::{Deblurring, NetworkArgs, Report, bar};
use super::report::StageTimes;
use super::stack::Input;
use anyhow::Result;
use nirspi_nets::{Images, KnownEstimate, Method, Options, deblur};
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::process::ExitCode;

/// Deblur images of 64 x 64
///
/// Reads .npy ((N, 64, 64) or (64, 64), in [0, 1] or 8-bit grey levels), a PNG or a folder of PNGs. Blur and noise are
/// estimated from each image unless given; the report says how well each result agrees with its image.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi deblur blurred.npy --model diffusion --out sharp.npy\n\
    \x20 nirspi deblur blurred.npy --model diffusion --steps 4 --blur-px 2 --noise 0.01 --out sharp.npy")]
pub struct Args {
    /// The images: .npy, .png or a folder of .png files
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// What deblurs
    #[arg(long, value_enum, default_value_t = Model::Diffusion)]
    model: Model,
    /// Steps: 1 to 500, default 1; of ancestral, default 500
    #[arg(long, value_name = "S", value_parser = clap::value_parser!(u32).range(1..=500))]
    steps: Option<u32>,
    /// Results: .npy, .png for a single image, else a folder of .png files
    #[arg(long, value_name = "OUT")]
    out: PathBuf,
    #[command(flatten)]
    sharpening: Sharpening,
    #[command(flatten)]
    networks: NetworkArgs,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

/// What deblurs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Model {
    /// The bridge from the degraded image to the sharp one
    Diffusion,
    /// The 500-step diffusion, sampled backwards
    Ancestral,
    /// A GAN's generator
    Gan,
}

/// How to deblur, the same for `deblur` and `enhance`.
#[derive(Debug, clap::Args)]
pub struct Sharpening {
    /// Blur of the images in pixels of the 64 x 64 grid (standard deviation), if you know it better than the estimator
    #[arg(long, value_name = "P", allow_negative_numbers = true)]
    blur_px: Option<f32>,
    /// Noise of the images (standard deviation, of a full scale of 1), if you know it better than the estimator
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    noise: Option<f32>,
    /// Let the network say what the readings contradict
    #[arg(long)]
    no_consistency: bool,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Also write how sure each pixel is (.npy): its standard deviation had the same scene been measured again
    #[arg(long, value_name = "FILE")]
    spread: Option<PathBuf>,
}

/// Measurements simulated for the spread.
const SPREAD_COPIES: u32 = 8;

impl Sharpening {
    pub fn options(&self) -> Result<Options> {
        let within = |name: &str, value: Option<f32>, most: f32| match value {
            Some(value) if !(0.0..=most).contains(&value) => {
                Err(Usage(format!("{name} is {value}, expected 0 to {most}")))
            }
            _ => Ok(()),
        };
        within("--blur-px", self.blur_px, 16.0)?;
        within("--noise", self.noise, 1.0)?;
        Ok(Options {
            consistency: !self.no_consistency,
            estimate: KnownEstimate { sigma_px: self.blur_px, noise: self.noise },
            seed: self.seed,
            copies: if self.spread.is_some() { SPREAD_COPIES } else { 0 },
            ..Options::default()
        })
    }

    /// Writes the spread, if it was asked for.
    pub fn write_spread(&self, input: &Input, spread: Option<&[f32]>) -> Result<()> {
        if let (Some(file), Some(spread)) = (&self.spread, spread) {
            input.target(file)?.write(deblur::SIDE, spread)?;
        }
        Ok(())
    }
}

impl Args {
    fn method(&self) -> Result<Method> {
        let steps =
            |default| NonZeroU32::new(self.steps.unwrap_or(default)).unwrap_or(NonZeroU32::MIN);
        Ok(match (self.model, self.steps) {
            (Model::Gan, Some(2..)) => {
                return Err(Usage("--steps belongs to diffusion and ancestral".to_owned()).into());
            }
            (Model::Gan, _) => Method::Gan,
            (Model::Diffusion, _) => Method::Diffusion { steps: steps(1) },
            (Model::Ancestral, _) => Method::Ancestral { steps: steps(500) },
        })
    }
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let method = args.method()?;
    let options = args.sharpening.options()?;
    let mut times = StageTimes::default();
    let input = times.time("read", || Input::read(&args.input))?;
    let images: Images<'_, { deblur::SIDE }> = input.images()?;
    let target = input.target(&args.out)?;
    let mut networks = args.networks.open(&["estimator", method.model()])?;
    let sharpener = times.time("load", || networks.sharpener(method))?;

    let bar = bar("deblurring", input.count());
    let result = times.time("deblur", || {
        sharpener.deblur(images, &options, &mut |done| bar.set_position(done as u64))
    });
    bar.finish_and_clear();
    args.sharpening.write_spread(&input, result.spread.as_deref())?;
    target.write(deblur::SIDE, &result.images)?;

    let deblurring =
        Deblurring::of(method.model(), method.steps(), options.consistency, options.seed, &result);
    let report = Report {
        input: args.input.clone(),
        output: args.out.clone(),
        images: input.count(),
        device: networks.device().to_owned(),
        weights: networks.used(),
        deblurring: Some(deblurring),
        stage_ms: times,
    };
    print_report(&report, args.json)?;
    Ok(ExitCode::SUCCESS)
}
