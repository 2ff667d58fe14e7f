//! `nirspi deblur`: the deblurring stage alone, by the network of choice.

use super::Usage;
use super::networks::{ImageArgs, checked, say};
use super::progress::Progress;
use super::provenance::made;
use super::report::stages;
use super::sharpening::{Sharpening, in_steps};
use anyhow::Result;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use nirspi::imaging::Deblurring;
use nirspi_nets::classical;
use nirspi_nets::deblur::Model;
use nirspi_nets::{Images, Method, deblur};
use std::num::NonZeroU32;
use std::process::ExitCode;

/// Deblur images of 64 x 64, by a network or a classical method
///
/// The command reads .npy ((N, 64, 64) or (64, 64), in [0, 1] or 8-bit grey levels), a PNG or JPEG picture, or a folder of
/// pictures. Blur and noise are estimated from each image, unless you give them. The report says how well each result agrees
/// with its image.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi deblur blurred.npy --model diffusion --out sharp.npy\n\
    \x20 nirspi deblur blurred.npy --model diffusion --steps 4 --blur-px 2 --noise 0.01 --out sharp.npy")]
pub struct Args {
    #[command(flatten)]
    sharpening: Sharpening,
    /// The network or method that deblurs
    #[arg(long, value_parser = Way::parser(), default_value = Model::ALL[0].name())]
    model: Way,
    /// Steps of the network, 1 to 500 [default: 1 for diffusion, 500 for ancestral]
    #[arg(long, value_name = "S")]
    steps: Option<NonZeroU32>,
    #[command(flatten)]
    images: ImageArgs,
}

/// How to deblur: by a network of the library's list, or by a classical method.
#[derive(Debug, Clone, Copy)]
enum Way {
    Network(Method),
    Classical(classical::Method),
}

impl Way {
    fn all() -> impl Iterator<Item = Self> {
        let networks = Model::ALL.into_iter().map(|model| Self::Network(model.into()));
        networks.chain(classical::Method::ALL.into_iter().map(Self::Classical))
    }

    fn name(self) -> &'static str {
        match self {
            Self::Network(method) => method.model().name(),
            Self::Classical(method) => method.name(),
        }
    }

    fn about(self) -> &'static str {
        match self {
            Self::Network(method) => method.model().about(),
            Self::Classical(method) => method.about(),
        }
    }

    fn parser() -> impl TypedValueParser<Value = Self> {
        let values = Self::all().map(|way| PossibleValue::new(way.name()).help(way.about()));
        let named = |found: String| Self::all().find(|way| way.name() == found);
        PossibleValuesParser::new(values).try_map(move |found| named(found).ok_or("unknown"))
    }
}

type Blurred<'a> = Images<'a, { deblur::SIDE }>;

impl Args {
    /// What the arguments ask for, together.
    fn way(&self) -> Result<Way> {
        let only = |flag: &str| Err(Usage(format!("{flag} belongs to networks")).into());
        match self.model {
            Way::Network(method) => Ok(Way::Network(in_steps(method.model(), self.steps)?)),
            Way::Classical(_) if self.steps.is_some_and(|steps| steps.get() > 1) => only("--steps"),
            Way::Classical(_) if self.sharpening.spread.is_some() => only("--spread"),
            way => Ok(way),
        }
    }
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let way = args.way()?;
    let options = args.sharpening.options()?;
    let mut times = stages();
    let input = times.time("read", || args.images.read(deblur::SIDE))?;
    let images: Blurred<'_> = checked(&input)?;
    let target = args.images.target(&input, &args.images.out)?;
    let spread = args.sharpening.spread_target(&args.images, &input)?;
    let provenance = input.taken()?.made(made());
    let bar = Progress::of("deblurring", input.count(), "images");
    let (networks, result) = match way {
        Way::Network(method) => {
            let model = method.model().name();
            let mut networks = args.images.networks.open(&["estimator", model])?;
            let sharpener = times.time("load", || networks.sharpener(method))?;
            let result = times
                .time("deblur", || sharpener.deblur(images, &options, &mut |done| bar.set(done)))?;
            (networks, result)
        }
        Way::Classical(method) => {
            let mut networks = args.images.networks.open(&["estimator"])?;
            let estimator = networks.estimator()?;
            let result = times.time("deblur", || {
                classical::deblur_all(method, images, &estimator, options.estimate, &mut || {
                    bar.add(1);
                })
            })?;
            (networks, result)
        }
    };
    drop(bar);
    if let (Some(target), Some(spread)) = (spread, &result.spread) {
        target.write(deblur::SIDE, spread, &provenance)?;
    }
    let shown = target.write_and_show(deblur::SIDE, &result.images, "deblurred", &provenance)?;

    let (steps, consistency) = match way {
        Way::Network(method) => (method.steps().get(), options.consistency),
        Way::Classical(_) => (1, false),
    };
    let deblurring = Deblurring::of(way.name(), steps, consistency, options.seed, &result);
    let report = args.images.report(&input, &networks, Some(deblurring), shown, times);
    args.images.report.print(&report, &provenance, say)
}
