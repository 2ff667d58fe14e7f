//! `nirspi eval quality`: how good enhanced images are on characters that no training has seen, and what becomes of
//! scenes that are no characters.
//!
//! The law: every row gets the same readings, and its figures come with the number of images they rest on.

mod bootstrap;
mod characters;
mod figures;
mod measure;
mod others;
mod rows;

use super::shot::progress;
use crate::print;
use crate::report::to_json;
use anyhow::Result;
use characters::Characters;
use indicatif::ProgressBar;
pub(super) use measure::halved;
use measure::{Condition, Figures, Judges};
use nirspi::files::output::OutputDir;
use nirspi_nets::{Device, Networks};
pub(super) use rows::{Kind, Row};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Quality against blur, noise and number of steps, on characters never seen in training; and what is no character
///
/// Sharp 64 x 64 images are blurred (Gaussian, sigma in pixels of 64), sampled to 32 x 32 by means of 2 x 2, given
/// noise, and enhanced by every row: Lanczos, three classical methods that are told blur and noise, and the networks,
/// which are told nothing. Writes quality.json, charts and a picture of scenes that are no letters.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi eval quality --data chars74k/ --scenes scenes/ --spi spi/ --out quality/")]
pub struct Args {
    /// Characters: .npz stacks (x, label, family or writer) or Chars74K's folder
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Groups of each stack that training has not seen, as JSON; those of the embedded weights if not given. A stack
    /// that is not named there is taken whole
    #[arg(long, value_name = "FILE")]
    held_out: Option<PathBuf>,
    /// Folder of PNG pictures, parts of which are enhanced as scenes that are no letters
    #[arg(long, value_name = "DIR")]
    scenes: Option<PathBuf>,
    /// Folder of real measurements (.npz), reconstructed and enhanced
    #[arg(long, value_name = "DIR")]
    spi: Option<PathBuf>,
    /// Folder of other weights, <network>.safetensors; the embedded ones where there is none
    #[arg(long, value_name = "DIR")]
    weights: Option<PathBuf>,
    /// Images of each stack
    #[arg(long, value_name = "N", default_value_t = 20,
          value_parser = clap::value_parser!(u32).range(2..=100_000))]
    count: u32,
    /// Images of each stack for the curve over steps: its samplers take up to 500 network calls an image
    #[arg(long, value_name = "N", default_value_t = 4,
          value_parser = clap::value_parser!(u32).range(2..=100_000))]
    sampler_count: u32,
    /// Most steps of the curve over steps
    #[arg(long, value_name = "N", default_value_t = 500,
          value_parser = clap::value_parser!(u32).range(1..=500))]
    most_steps: u32,
    /// Seed of choice and noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "quality")]
    out: PathBuf,
    /// Print the numbers as JSON
    #[arg(long)]
    json: bool,
}

/// Blur of the curves over noise and steps, and noise of those over blur and steps: the middle of issue 6's targets.
const MIDDLE: Condition = Condition { sigma_px: 2.0, noise: 0.03 };

/// Blurs, in pixels of 64.
const SIGMAS_PX: [f32; 6] = [0.3, 0.7, 1.0, 2.0, 3.0, 4.0];

/// Standard deviations of noise.
const NOISES: [f32; 5] = [0.0, 0.01, 0.03, 0.05, 0.08];

/// Nothing to undo but the sampling.
const UNTOUCHED: Condition = Condition { sigma_px: 0.0, noise: 0.0 };

/// Steps of the curves over steps.
const STEPS: [u32; 6] = [1, 2, 4, 10, 50, 500];

#[derive(Debug, Serialize)]
struct Report {
    simulated: bool,
    seed: u64,
    /// Stacks and how many images of each.
    images: Vec<characters::Origin>,
    weights: Vec<rows::Version>,
    /// Each row at each condition.
    conditions: Vec<Figures>,
    /// Each row with so many steps at the middle condition.
    steps: Vec<Figures>,
    others: Vec<others::Case>,
    notes: Vec<String>,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let mut networks = Networks::built_in(Device::cpu());
    if let Some(folder) = &args.weights {
        networks = networks.with_folder(folder);
    }
    let judges = Judges::new(&mut networks)?;
    let held_out = args.held_out.as_deref();
    let characters = Characters::read(&args.data, held_out, args.count as usize, args.seed)?;
    let few = characters.first(args.sampler_count as usize);
    let scenes = others::cases(args.scenes.as_deref(), args.spi.as_deref(), args.seed)?;

    let conditions = conditions();
    let rows: Vec<Row> =
        Kind::ALL.into_iter().map(|kind| Row::new(kind, &mut networks)).collect::<Result<_>>()?;
    let stepped: Vec<Kind> = stepped(args.most_steps);
    let work = rows.len() * conditions.len() * characters.len() + stepped.len() * few.len();
    let bar = progress(work, "quality");
    let measured = over(&rows, &conditions, &characters, &judges, args.seed, &bar)?;
    let mut steps = Vec::new();
    for kind in stepped {
        let row = Row::new(kind, &mut networks)?;
        steps.extend(over(&[row], &[MIDDLE], &few, &judges, args.seed, &bar)?);
    }
    bar.finish_and_clear();
    let shown = others::enhance(&scenes, &Row::new(Kind::Diffusion(1), &mut networks)?)?;

    let mut out = OutputDir::create(&args.out)?;
    for (name, picture) in figures::all(&measured, &steps, &characters, &few) {
        out.write(name, &nirspi::files::image::encode_rgb(&picture))?;
    }
    out.write("others.png", &nirspi::files::image::encode_rgb(&shown.picture.render()))?;
    let report = Report {
        simulated: true,
        seed: args.seed,
        images: characters.origins().to_vec(),
        weights: rows::versions(&mut networks)?,
        conditions: measured,
        steps,
        others: shown.cases,
        notes: characters.notes().to_vec(),
    };
    let json = to_json(&report)?;
    out.write("quality.json", json.as_bytes())?;
    out.commit()?;
    if args.json {
        print::json(&report)?;
    } else {
        say(args, &report)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// All conditions, each once.
fn conditions() -> Vec<Condition> {
    let mut all = vec![UNTOUCHED];
    all.extend(SIGMAS_PX.map(|sigma_px| Condition { sigma_px, ..MIDDLE }));
    all.extend(
        NOISES.map(|noise| Condition { noise, ..MIDDLE }).into_iter().filter(|c| *c != MIDDLE),
    );
    all
}

/// The rows whose steps are counted, and those that they are compared with.
fn stepped(most: u32) -> Vec<Kind> {
    let mut all = vec![Kind::Lanczos, Kind::Classical(figures::BEST_CLASSICAL), Kind::Gan];
    for steps in STEPS.into_iter().filter(|&steps| steps <= most) {
        if steps <= figures::MOST_BRIDGE_STEPS {
            all.push(Kind::Diffusion(steps));
        }
        all.push(Kind::Ancestral(steps));
    }
    all
}

fn over(
    rows: &[Row],
    conditions: &[Condition],
    characters: &Characters,
    judges: &Judges,
    seed: u64,
    bar: &ProgressBar,
) -> Result<Vec<Figures>> {
    let sharp = judges.judge(&characters.values())?;
    let mut all = Vec::new();
    for &condition in conditions {
        let readings = condition.readings(characters, seed);
        for row in rows {
            let images = row.enhance(&readings, condition, bar)?;
            all.extend(judges.figures(
                row.kind(),
                condition,
                characters,
                &sharp,
                &readings,
                &images,
            )?);
        }
    }
    Ok(all)
}

fn say(args: &Args, report: &Report) -> Result<()> {
    for origin in &report.images {
        print::line(format_args!("{}: {} images, {}", origin.stack, origin.images, origin.choice))?;
    }
    let version = |v: &rows::Version| format!("{} {}", v.model, v.version);
    let versions: Vec<String> = report.weights.iter().map(version).collect();
    print::line(format_args!("weights: {}", versions.join(", ")))?;
    print::line("PSNR dB / SSIM / Fréchet character distance / characters seen right")?;
    let at = |c: &Condition| format!("sigma {} px, noise {}", c.sigma_px, c.noise);
    let mut shown: Option<Condition> = None;
    for figures in report.conditions.iter().chain(&report.steps).filter(|f| f.stack.is_none()) {
        if shown.replace(figures.condition) != Some(figures.condition) {
            print::line(at(&figures.condition))?;
        }
        let accuracy = figures.character_accuracy.map_or_else(String::new, |a| format!("  {a:.2}"));
        print::line(format_args!(
            "  {:<22} {:5.2} [{:5.2}, {:5.2}]  {:.3}  {:7.2}{accuracy}  ({} images)",
            figures.row,
            figures.psnr_db.value,
            figures.psnr_db.low,
            figures.psnr_db.high,
            figures.ssim.value,
            figures.frechet_character_distance.value,
            figures.images
        ))?;
    }
    for note in &report.notes {
        print::line(format_args!("note: {note}"))?;
    }
    print::line(format_args!("wrote charts, others.png and quality.json to {}", args.out.display()))
}
