//! The training loop of every network.

use super::checkpoint::Checkpoint;
use super::examples::{Batch, Examples};
use super::learner;
use super::log::{Entry, Progress};
use super::trained::Learner;
use super::{Model, Score, Settings, TrainError};
use crate::data::{DataError, Part};
use crate::device::Device;
use crate::weights::{MODEL, RECIPE, VERSION, Weights};
use serde::Serialize;
use std::sync::mpsc::sync_channel;
use std::time::Instant;

/// Largest number of steps over which the learning rate rises.
const WARM_UP: u64 = 200;
/// Last learning rate, relative to the highest.
const LAST_RATE: f64 = 0.01;
/// Number of batches prepared in advance.
const AHEAD: usize = 3;
/// Number of examples judged at once.
const JUDGED_AT_ONCE: usize = 32;

/// Stores the results of a run. An error ends the run.
pub trait Keeper {
    /// Stores a line of the log.
    ///
    /// # Errors
    /// If the line cannot be stored.
    fn entry(&mut self, entry: &Entry) -> Result<(), Box<dyn std::error::Error + Send + Sync>>;
    /// Stores the whole run, in place of the checkpoint before.
    ///
    /// # Errors
    /// If the checkpoint cannot be stored.
    fn checkpoint(
        &mut self,
        checkpoint: &Checkpoint,
    ) -> Result<(), Box<dyn std::error::Error + Send + Sync>>;
    /// Stores the averaged weights with the best score so far.
    ///
    /// # Errors
    /// If the weights cannot be stored.
    fn best(&mut self, weights: &Weights) -> Result<(), Box<dyn std::error::Error + Send + Sync>>;
    /// Called after each step. `false` stores a checkpoint and ends the run.
    fn stepped(&mut self, step: u64, loss: f64) -> bool;
}

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// All steps are done.
    Complete,
    /// The score did not improve for as many judgements as the settings allow.
    NoLongerBetter,
    /// The keeper stopped the run.
    Stopped,
}

/// The result of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// Why the run ended.
    pub ended: Ended,
    /// Number of steps done.
    pub step: u64,
    /// Best held-out score, and its step.
    pub best: Option<(f64, u64)>,
    /// The kind of score.
    pub score: Score,
    /// Seconds of training, of all parts of the run.
    pub seconds: f64,
    /// Steps per second in this part of the run.
    pub steps_per_second: f64,
    /// The device.
    pub device: String,
}

/// Trains a network, from the start or from a checkpoint.
///
/// # Errors
/// [`TrainError`] for wrong settings or data, a loss that is not finite, a checkpoint that does not
/// fit, or an error of the keeper.
pub fn train(
    settings: &Settings,
    examples: &Examples<'_>,
    data: &str,
    resumed: Option<Checkpoint>,
    device: &Device,
    keeper: &mut dyn Keeper,
) -> Result<Outcome, TrainError> {
    check(settings, examples)?;
    let mut learner = learner::new(settings, device)?;
    let mut progress = match resumed {
        None => Progress {
            settings: settings.clone(),
            data: data.to_owned(),
            step: 0,
            best: None,
            looks_since_best: 0,
            losses: (0.0, 0),
            seconds: 0.0,
            log: Vec::new(),
        },
        Some(checkpoint) => {
            checkpoint.progress.expect(settings, data)?;
            learner.restore(&checkpoint.states)?;
            Progress { settings: settings.clone(), ..checkpoint.progress }
        }
    };
    let judged = judged_batches(settings, examples)?;
    let (first, begun) = (progress.step, Instant::now());
    let before_s = progress.seconds;

    // One thread prepares batches while the network learns from earlier ones.
    let ended = std::thread::scope(|scope| {
        let (sender, batches) = sync_channel(AHEAD);
        scope.spawn(move || {
            for step in first..settings.steps {
                let at = step * settings.batch as u64;
                let batch = examples.batch(Part::Training, at, settings.batch);
                let failed = batch.is_err();
                if sender.send(batch).is_err() || failed {
                    return;
                }
            }
        });
        let mut training = Loop { settings, learner: learner.as_mut(), keeper, judged: &judged };
        for batch in batches {
            let ended = training.step(&batch?, &mut progress, before_s, begun)?;
            if let Some(ended) = ended {
                return Ok(ended);
            }
        }
        Ok::<_, TrainError>(Ended::Complete)
    })?;
    let took = begun.elapsed().as_secs_f64();
    Ok(Outcome {
        ended,
        step: progress.step,
        best: progress.best,
        score: settings.model.score(),
        seconds: before_s + took,
        steps_per_second: (progress.step - first) as f64 / took.max(1e-9),
        device: device.name().to_owned(),
    })
}

/// Checks that a run can begin, before anything is prepared for it.
///
/// # Errors
/// [`TrainError`] names the setting, or what the data lack.
pub fn check(settings: &Settings, examples: &Examples<'_>) -> Result<(), TrainError> {
    settings.validate()?;
    if settings.model == Model::Classifier {
        for part in [Part::Training, Part::HeldOut] {
            if examples.batch(part, 0, settings.batch)?.label.iter().any(Option::is_none) {
                return Err(DataError::Unlabelled { name: "training data".to_owned() }.into());
            }
        }
    }
    Ok(())
}

fn judged_batches(settings: &Settings, examples: &Examples<'_>) -> Result<Vec<Batch>, TrainError> {
    (0..settings.held_out)
        .step_by(JUDGED_AT_ONCE)
        .map(|first| {
            let count = JUDGED_AT_ONCE.min(settings.held_out - first);
            examples.batch(Part::HeldOut, first as u64, count)
        })
        .collect()
}

/// State of one pass of the loop.
struct Loop<'r> {
    settings: &'r Settings,
    learner: &'r mut dyn Learner,
    keeper: &'r mut dyn Keeper,
    judged: &'r [Batch],
}

impl Loop<'_> {
    /// Does one step and the work due after it; returns why the run ends, if it does.
    fn step(
        &mut self,
        batch: &Batch,
        progress: &mut Progress,
        before_s: f64,
        begun: Instant,
    ) -> Result<Option<Ended>, TrainError> {
        let settings = self.settings;
        let rate = rate(settings, progress.step);
        let loss = self.learner.step(batch, progress.step, rate)?;
        if !loss.is_finite() {
            return Err(TrainError::NotFinite { step: progress.step, loss });
        }
        progress.step += 1;
        progress.seconds = before_s + begun.elapsed().as_secs_f64();
        progress.losses.0 += loss;
        progress.losses.1 += 1;

        let last = progress.step == settings.steps;
        let go_on = self.keeper.stepped(progress.step, loss);
        let judge = last || progress.step.is_multiple_of(settings.judge_every);
        let mut ended = None;
        if judge || progress.step.is_multiple_of(settings.log_every) {
            let held_out = if judge { Some(self.judge(progress)?) } else { None };
            let entry = Entry {
                step: progress.step,
                loss: rounded(progress.losses.0 / progress.losses.1 as f64),
                held_out,
                score: settings.model.score(),
                rate: rounded(rate),
                seconds: (progress.seconds * 100.0).round() / 100.0,
            };
            progress.losses = (0.0, 0);
            progress.log.push(entry);
            self.keeper.entry(&entry)?;
            if settings.patience.is_some_and(|most| progress.looks_since_best >= most) {
                ended = Some(Ended::NoLongerBetter);
            }
        }
        if !go_on && !last {
            ended = Some(Ended::Stopped);
        }
        if judge || ended.is_some() {
            let states = self.learner.states(progress.step)?;
            self.keeper.checkpoint(&Checkpoint { progress: progress.clone(), states })?;
        }
        Ok(ended)
    }

    /// Judges held-out examples; stores the weights if they are the best so far.
    fn judge(&mut self, progress: &mut Progress) -> Result<f64, TrainError> {
        let sum = self.judged.iter().map(|batch| self.learner.judge(batch)).sum::<f64>();
        let score = rounded(sum / self.settings.held_out as f64);
        if !score.is_finite() {
            return Err(TrainError::NotFinite { step: progress.step, loss: score });
        }
        if progress.best.is_none_or(|(best, _)| score > best) {
            progress.best = Some((score, progress.step));
            progress.looks_since_best = 0;
            let mut weights = self.learner.weights();
            weights.set_metadata(MODEL, self.settings.model.to_string());
            weights.set_metadata(VERSION, env!("CARGO_PKG_VERSION"));
            let recipe = format!(
                "nirspi train {}: {} of {} steps of {}, rate {}, seed {}, {:?} {score} on held-out examples; data: {}",
                self.settings.model,
                progress.step,
                self.settings.steps,
                self.settings.batch,
                self.settings.rate,
                self.settings.seed,
                self.settings.model.score(),
                progress.data
            );
            weights.set_metadata(RECIPE, recipe);
            self.keeper.best(&weights)?;
        } else {
            progress.looks_since_best += 1;
        }
        Ok(score)
    }
}

/// Rises over the first steps, then falls along half a cosine.
fn rate(settings: &Settings, step: u64) -> f64 {
    let warm_up = WARM_UP.min(settings.steps / 10 + 1);
    let rising = ((step + 1) as f64 / warm_up as f64).min(1.0);
    let part = step as f64 / settings.steps as f64;
    let cosine = 0.5 * (1.0 + (std::f64::consts::PI * part).cos());
    settings.rate * rising * (LAST_RATE + (1.0 - LAST_RATE) * cosine)
}

/// Rounds to six significant digits or so (a millionth of the value), which a log can show and JSON
/// returns unchanged.
fn rounded(value: f64) -> f64 {
    format!("{value:.6e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_rises_then_falls() {
        let settings = Settings { steps: 10_000, rate: 1e-3, ..Settings::new(Model::Diffusion) };
        let at = |step| rate(&settings, step);
        assert!(at(0) < 1e-5 && (at(200) / 1e-3 - 1.0).abs() < 0.01);
        assert!((200..9_999).all(|step| at(step + 1) < at(step)));
        assert!((at(9_999) / 1e-5 - 1.0).abs() < 0.1);
    }
}
