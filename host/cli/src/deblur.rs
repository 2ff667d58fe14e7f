//! `nirspi deblur`: the deblurring stage alone, by the network of choice.

use super::Usage;
use super::enhance::print_report;
use super::networks::{Deblurring, ImageArgs, bar, checked};
use super::report::StageTimes;
use anyhow::Result;
use indicatif::ProgressBar;
use nirspi::files::stack::ImageStack;
use nirspi_nets::classical;
use nirspi_nets::consistency::Consistency;
use nirspi_nets::{Enhanced, Images, KnownEstimate, Method, Networks, Options, deblur};
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::process::ExitCode;

/// Deblur images of 64 x 64, by a network or a classical method
///
/// Reads .npy ((N, 64, 64) or (64, 64), in [0, 1] or 8-bit grey levels), a PNG or a folder of PNGs. Blur and noise are
/// estimated from each image unless given; the report says how well each result agrees with its image.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi deblur blurred.npy --model diffusion --out sharp.npy\n\
    \x20 nirspi deblur blurred.npy --model diffusion --steps 4 --blur-px 2 --noise 0.01 --out sharp.npy")]
pub struct Args {
    /// What deblurs
    #[arg(long, value_enum, default_value_t = Model::Diffusion)]
    model: Model,
    /// Steps: 1 to 500, default 1; of ancestral, default 500
    #[arg(long, value_name = "S", value_parser = clap::value_parser!(u32).range(1..=500))]
    steps: Option<u32>,
    #[command(flatten)]
    sharpening: Sharpening,
    #[command(flatten)]
    images: ImageArgs,
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
    /// Wiener's filter
    Wiener,
    /// Richardson-Lucy deconvolution
    Rl,
    /// Deconvolution with least total variation
    Tv,
}

/// How the model deblurs.
enum Way {
    Network(Method),
    Classical(classical::Method),
}

impl Way {
    fn name(&self) -> &'static str {
        match self {
            Self::Network(method) => method.model(),
            Self::Classical(method) => method.name(),
        }
    }
}

type Blurred<'a> = Images<'a, { deblur::SIDE }>;

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
    /// Also write how well each pixel repeats (.npy): its standard deviation had the same scene been measured again. What the
    /// network gets wrong every time is not in it
    #[arg(long, value_name = "FILE")]
    spread: Option<PathBuf>,
}

/// Number of simulated measurements for the spread.
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
            estimate: KnownEstimate { sigma_px: self.blur_px.into(), noise: self.noise.into() },
            seed: self.seed,
            copies: if self.spread.is_some() { SPREAD_COPIES } else { 0 },
            ..Options::default()
        })
    }

    /// Writes the spread, if requested.
    pub fn write_spread(&self, input: &ImageStack, spread: Option<&[f32]>) -> Result<()> {
        if let (Some(file), Some(spread)) = (&self.spread, spread) {
            input.target(file)?.write(deblur::SIDE, spread)?;
        }
        Ok(())
    }
}

impl Args {
    fn way(&self) -> Result<Way> {
        let only =
            |flag: &str, whose: &str| Err(Usage(format!("{flag} belongs to {whose}")).into());
        let steps =
            |default| NonZeroU32::new(self.steps.unwrap_or(default)).unwrap_or(NonZeroU32::MIN);
        Ok(match self.model {
            Model::Diffusion => Way::Network(Method::Diffusion { steps: steps(1) }),
            Model::Ancestral => Way::Network(Method::Ancestral { steps: steps(500) }),
            _ if self.steps.is_some_and(|steps| steps > 1) => {
                return only("--steps", "diffusion and ancestral");
            }
            Model::Gan => Way::Network(Method::Gan),
            _ if self.sharpening.spread.is_some() => return only("--spread", "networks"),
            Model::Wiener => Way::Classical(classical::Method::Wiener),
            Model::Rl => Way::Classical(classical::Method::RichardsonLucy),
            Model::Tv => Way::Classical(classical::Method::TotalVariation),
        })
    }
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let way = args.way()?;
    let options = args.sharpening.options()?;
    let mut times = StageTimes::default();
    let input = times.time("read", || args.images.read(deblur::SIDE))?;
    let images: Blurred<'_> = checked(&input)?;
    let target = input.target(&args.images.out)?;
    let bar = bar("deblurring", input.count());
    let (networks, result) = match way {
        Way::Network(method) => {
            let mut networks = args.images.networks.open(&["estimator", method.model()])?;
            let sharpener = times.time("load", || networks.sharpener(method))?;
            let result = times.time("deblur", || {
                sharpener.deblur(images, &options, &mut |done| bar.set_position(done as u64))
            })?;
            (networks, result)
        }
        Way::Classical(method) => {
            let mut networks = args.images.networks.open(&["estimator"])?;
            let work = || classically(method, images, &mut networks, options.estimate, &bar);
            let result = times.time("deblur", work)?;
            (networks, result)
        }
    };
    bar.finish_and_clear();
    args.sharpening.write_spread(&input, result.spread.as_deref())?;
    let shown = target.write_and_show(deblur::SIDE, &result.images, "deblurred")?;

    let (steps, consistency) = match way {
        Way::Network(method) => (method.steps(), options.consistency),
        Way::Classical(_) => (1, false),
    };
    let deblurring = Deblurring::of(way.name(), steps, consistency, options.seed, &result);
    let report = args.images.report(&input, &networks, Some(deblurring), shown, times);
    print_report(&report, args.images.json)?;
    Ok(ExitCode::SUCCESS)
}

/// Deblurs by a classical method with each image's blur and noise.
fn classically(
    method: classical::Method,
    images: Blurred<'_>,
    networks: &mut Networks,
    known: KnownEstimate,
    bar: &ProgressBar,
) -> Result<Enhanced> {
    const SIDE: usize = deblur::SIDE;
    let mut result = Enhanced::default();
    for (image, estimate) in images.iter().zip(networks.estimator()?.estimate(images)) {
        let estimate = known.over(estimate);
        let (sigma_px, noise) = (estimate.sigma_px, estimate.noise.min(1.0));
        let sharp = classical::deblur(method, image, (SIDE, SIDE), sigma_px, noise)?;
        let model = Consistency::new(SIDE, sigma_px, noise);
        result.inconsistency.push(model.residual_ratio(image, &sharp));
        result.images.extend(sharp);
        result.estimates.push(estimate);
        bar.inc(1);
    }
    Ok(result)
}
