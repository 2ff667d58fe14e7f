//! `nirspi train NETWORK`: trains one network and stores the run in a folder.

use super::network::Args;
use crate::progress::Progress;
use crate::{print, provenance, refused};
use anyhow::Result;
use nirspi::files::interrupt;
use nirspi_eval::train::{Report, Request, Watch, run as train};
use nirspi_nets::train::{Ended, Entry, Model, Settings};
use nirspi_recon::words::count;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

pub fn run(args: &Args, model: Model) -> Result<ExitCode> {
    let request = Request {
        settings: args.settings(model),
        data: args.data.data(),
        camera: args.model.read()?,
        camera_share: args.camera_share,
        fsrcnn: args.fsrcnn.clone(),
        out: args.out.clone(),
        resume: args.resume,
        backend: args.backend,
        made: provenance::made().clone(),
    };
    let stop = interrupt::stop_flag();
    let mut shown = Shown { bar: None, stop };
    let report = train(&request, &mut shown).map_err(refused)?;
    drop(shown);
    let code = args.report.print(&report, &provenance::simulated(), say)?;
    // A training that the system ended is not one that its user ended.
    let by_system = interrupt::first().is_some_and(|signal| !signal.is_wish());
    Ok(if by_system && report.outcome.ended == Ended::Stopped { ExitCode::FAILURE } else { code })
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
}

/// The progress bar, and whether the user has asked to stop.
struct Shown {
    bar: Option<Progress>,
    stop: Arc<AtomicBool>,
}

impl Watch for Shown {
    fn starts(&mut self, settings: &Settings, step: u64) {
        let bar = Progress::of(&settings.model.to_string(), settings.steps, "steps");
        bar.start_at(step);
        self.bar = Some(bar);
    }

    fn entry(&mut self, entry: &Entry, held_out: Option<f64>) {
        let unit = entry.score.unit();
        let held_out =
            held_out.map_or_else(String::new, |score| format!(", held out {score:.2} {unit}"));
        if let Some(bar) = &self.bar {
            bar.say(format!("loss {:.5}{held_out}", entry.loss));
        }
    }

    fn stepped(&mut self, step: u64) -> bool {
        if let Some(bar) = &self.bar {
            bar.set(step);
        }
        !self.stop.load(Ordering::Relaxed)
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
        "{}: {} in {:.0} s, {:.2} steps/s on {}: {ended}",
        report.model,
        count(outcome.step, "step"),
        outcome.seconds,
        outcome.steps_per_second,
        outcome.device
    ))?;
    match outcome.best {
        Some((score, step)) => print::line(format_args!(
            "best on held-out examples: {score:.2} {} at step {step}, kept in {}",
            outcome.score.unit(),
            report.weights.display()
        )),
        None => print::line("no test on held-out examples so far"),
    }
}
