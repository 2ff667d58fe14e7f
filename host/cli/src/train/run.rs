//! `nirspi train NETWORK`: one network, kept in a folder as it learns.

use super::data::Found;
use super::folder::Folder;
use super::network::Args;
use crate::{Usage, print};
use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use nirspi::training::{LinearCamera, Mixed};
use nirspi_nets::Weights;
use nirspi_nets::degrade::{AnalyticCamera, Limits};
use nirspi_nets::device::Device;
use nirspi_nets::train::checkpoint::Checkpoint;
use nirspi_nets::train::{
    Ended, Enlarge, Entry, Examples, Fused, Keeper, Lanczos, Model, Outcome, Score, Settings,
    check, train,
};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

#[derive(Debug, Serialize)]
struct Report {
    model: Model,
    settings: Settings,
    data: Found,
    camera_share: f32,
    #[serde(flatten)]
    outcome: Outcome,
    weights: PathBuf,
}

/// Examples whose degraded image is of 64 x 64 from the start.
const FINE_SHARE: f32 = 0.25;
/// A character that is classified has been restored: what is left of blur and noise is small.
const NEARLY_SHARP: (f32, f32) = (1.0, 0.03);

pub fn run(args: &Args, model: Model) -> Result<ExitCode> {
    if !(0.0..=1.0).contains(&args.camera_share) {
        let found = args.camera_share;
        return Err(Usage(format!("--camera-share is {found}, expected 0 to 1")).into());
    }
    let settings = args.settings(model);
    let mut data_args = args.data.clone();
    if model == Model::Classifier {
        data_args.shapes = 0.0;
    }
    let (scenes, data) = data_args.scenes(args.seed)?;
    let device = Device::open(args.backend)?;
    let classifier = model == Model::Classifier;
    let limits = match classifier {
        true => {
            let (sigma_px, noise_std) = NEARLY_SHARP;
            Limits { sigma_px: 0.0..=sigma_px, noise_std: 0.0..=noise_std, ..Limits::default() }
        }
        false => Limits::default(),
    };
    let camera = args.camera_share > 0.0 && !classifier;
    let camera =
        if camera { Some((LinearCamera::new(args.seed)?, args.camera_share)) } else { None };
    let degrade = Mixed { analytic: AnalyticCamera::new(limits)?, camera };
    let enlarge = args.enlarge(model)?;
    let fine = match model {
        Model::Fsrcnn => 0.0,
        Model::Classifier => 1.0,
        Model::Estimator => 0.5,
        Model::Diffusion | Model::Ancestral | Model::Gan => FINE_SHARE,
    };
    let examples = Examples {
        scenes: &scenes,
        degrade: &degrade,
        enlarge: enlarge.as_ref(),
        fine,
        seed: args.seed,
    };

    check(&settings, &examples)?;
    let (mut folder, resumed) = match args.resume {
        true => Folder::resume(&args.out).map(|(folder, checkpoint)| (folder, Some(checkpoint)))?,
        false => (Folder::start(&args.out)?, None),
    };
    let stop = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&stop);
    ctrlc::set_handler(move || asked.store(true, Ordering::Relaxed))
        .context("cannot listen for interrupts")?;
    folder.write_data(&data)?;
    let bar = progress(&settings, &resumed);
    let mut keeper = Kept { folder: &mut folder, bar: &bar, stop: &stop, held_out: None };
    let told = args.told(&data);
    let outcome = train(&settings, &examples, &told, resumed, &device, &mut keeper)
        .with_context(|| args.out.display().to_string())?;
    bar.finish_and_clear();

    let report = Report {
        model,
        settings,
        data,
        camera_share: args.camera_share,
        outcome,
        weights: args.out.join(Folder::WEIGHTS),
    };
    if args.json {
        print::json(&report)?;
    } else {
        say(&report)?;
    }
    Ok(ExitCode::SUCCESS)
}

impl Args {
    fn settings(&self, model: Model) -> Settings {
        let standard = Settings::new(model);
        Settings {
            width: self.width.clone(),
            steps: self.steps.unwrap_or(standard.steps),
            batch: self.batch,
            rate: self.rate.unwrap_or(standard.rate),
            seed: self.seed,
            judge_every: self.judge_every,
            log_every: standard.log_every.min(self.judge_every),
            patience: (self.patience > 0).then_some(self.patience),
            ..standard
        }
    }

    /// What comes before the deblurrer in use; other networks are given readings, or images of 64 x 64.
    fn enlarge(&self, model: Model) -> Result<Box<dyn Enlarge>> {
        if !deblurs(model) {
            return Ok(Box::new(Lanczos));
        }
        let weights = match &self.fsrcnn {
            Some(file) => Weights::read(file)?,
            None => Weights::embedded("fsrcnn")?,
        };
        Ok(Box::new(Fused::new(&weights)?))
    }

    /// What the run is trained on, in a line: another line is another run.
    fn told(&self, data: &Found) -> String {
        let stacks: Vec<String> = data
            .stacks
            .iter()
            .map(|stack| {
                let (held_out, groups) = (stack.held_out.len(), stack.groups);
                format!(
                    "{} ({} images, {held_out} of {groups} groups held out)",
                    stack.stack, stack.images
                )
            })
            .collect();
        let stacks =
            if stacks.is_empty() { "procedural scenes".to_owned() } else { stacks.join(", ") };
        let fsrcnn = if self.fsrcnn.is_some() { ", an FSRCNN of the user's" } else { "" };
        let (shapes, share) = (self.data.shapes, self.camera_share);
        format!("{stacks}; {shapes} shapes, {share} by the virtual camera{fsrcnn}")
    }
}

fn deblurs(model: Model) -> bool {
    matches!(model, Model::Diffusion | Model::Ancestral | Model::Gan)
}

/// A run's folder, its bar, and whether its user wants no more.
struct Kept<'k> {
    folder: &'k mut Folder,
    bar: &'k ProgressBar,
    stop: &'k AtomicBool,
    held_out: Option<f64>,
}

impl Keeper for Kept<'_> {
    fn entry(&mut self, entry: &Entry) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
        self.held_out = entry.held_out.or(self.held_out);
        let held_out = self.held_out.map_or_else(String::new, |score| {
            format!(", held out {score:.2} {}", unit(entry.score))
        });
        self.bar.set_message(format!("loss {:.5}{held_out}", entry.loss));
        Ok(self.folder.entry(entry)?)
    }

    fn checkpoint(
        &mut self,
        checkpoint: &Checkpoint,
    ) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
        let bytes = checkpoint.to_bytes()?;
        Ok(self.folder.checkpoint(&bytes, &checkpoint.progress.log)?)
    }

    fn best(&mut self, weights: &Weights) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
        let bytes = weights.to_bytes(nirspi_nets::weights::Precision::Single)?;
        Ok(self.folder.best(&bytes)?)
    }

    fn stepped(&mut self, step: u64, _loss: f64) -> bool {
        self.bar.set_position(step);
        !self.stop.load(Ordering::Relaxed)
    }
}

fn progress(settings: &Settings, resumed: &Option<Checkpoint>) -> ProgressBar {
    let template = "{prefix} {bar:24} {pos}/{len} steps, {eta} left, {msg}";
    let style =
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(settings.steps).with_style(style);
    bar.set_prefix(settings.model.to_string());
    if let Some(checkpoint) = resumed {
        bar.set_position(checkpoint.progress.step);
        bar.reset_eta();
    }
    bar
}

pub(super) fn unit(score: Score) -> &'static str {
    match score {
        Score::PsnrDb | Score::EstimateDb => "dB",
        Score::AccuracyPercent => "%",
    }
}

fn say(report: &Report) -> Result<()> {
    let outcome = &report.outcome;
    let ended = match outcome.ended {
        Ended::Complete => "all steps done",
        Ended::NoLongerBetter => "held-out examples got no better",
        Ended::Stopped => "stopped; go on with --resume",
    };
    print::line(format_args!(
        "{}: {} steps in {:.0} s, {:.2} steps/s on {}: {ended}",
        report.model, outcome.step, outcome.seconds, outcome.steps_per_second, outcome.device
    ))?;
    match outcome.best {
        Some((score, step)) => print::line(format_args!(
            "best on held-out examples: {score:.2} {} at step {step}, kept in {}",
            unit(outcome.score),
            report.weights.display()
        )),
        None => print::line("held-out examples were not looked at yet"),
    }
}
