//! Training: examples, losses, one loop for every network.
//!
//! # Invariant
//! A run depends only on its settings, its data and its number of steps. Random numbers of step k
//! come from the seed and k, so a killed run continues from its checkpoint to the same weights as
//! an uninterrupted run (`tests::a_run_that_was_stopped_goes_on_to_the_very_same_weights`). The
//! caller stores the files ([`Keeper`]).
//!
//! | module | contents |
//! |---|---|
//! | [`examples`] | batches: scenes, degraded and enlarged |
//! | `tasks` | the loss and the held-out score of each network |
//! | `trained` | a network with its optimiser and its running average |
//! | `solo`, `adversarial` | learning from examples alone, and against a discriminator |
//! | `learner` | the learner of each model |
//! | `training_loop` | learning rate, log, held-out score, checkpoints, early stop |
//! | `log` | the progress of a run |
//! | [`checkpoint`] | a whole run as bytes |

mod adversarial;
pub mod checkpoint;
pub mod examples;
mod initial;
mod learner;
mod log;
mod solo;
mod tasks;
mod tensors;
#[cfg(test)]
mod tests;
mod trained;
mod training_loop;

pub use examples::{Enlarge, Examples, Fused, Lanczos};
pub use log::{Entry, Progress};
pub use training_loop::{Ended, Keeper, Outcome, check, train};

use crate::data::DataError;
use crate::degrade::DegradeError;
use crate::weights::WeightsError;
use serde::{Deserialize, Serialize};
use std::fmt;
use thiserror::Error;

/// A network that can be trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Model {
    /// FSRCNN: from 32 x 32 and depth to 64 x 64.
    Fsrcnn,
    /// The deblurrer: a bridge from the degraded image, in 1 to 4 steps.
    Diffusion,
    /// The paper's 500 steps (Eq. 5 to 8).
    Ancestral,
    /// The generator of a conditional GAN.
    Gan,
    /// The estimator of blur and noise.
    Estimator,
    /// The classifier of the 62 characters.
    Classifier,
}

impl fmt::Display for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Fsrcnn => "fsrcnn",
            Self::Diffusion => "diffusion",
            Self::Ancestral => "ancestral",
            Self::Gan => "gan",
            Self::Estimator => "estimator",
            Self::Classifier => "classifier",
        })
    }
}

/// The score of held-out examples; larger is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Score {
    /// Peak signal-to-noise ratio of images, in dB.
    PsnrDb,
    /// The same ratio for the two outputs of the estimator.
    EstimateDb,
    /// Share of correctly named characters, in percent.
    AccuracyPercent,
}

impl Score {
    /// The unit of the number.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::PsnrDb | Self::EstimateDb => "dB",
            Self::AccuracyPercent => "%",
        }
    }
}

impl Model {
    /// The kind of score of this model.
    #[must_use]
    pub fn score(self) -> Score {
        match self {
            Self::Estimator => Score::EstimateDb,
            Self::Classifier => Score::AccuracyPercent,
            Self::Fsrcnn | Self::Diffusion | Self::Ancestral | Self::Gan => Score::PsnrDb,
        }
    }
}

/// Settings of a training run. The result depends on these and the data; checkpoints store them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// The network.
    pub model: Model,
    /// Number of channels of each level; empty for the shipped size.
    pub width: Vec<usize>,
    /// Number of steps.
    pub steps: u64,
    /// Number of examples in a step.
    pub batch: usize,
    /// Highest learning rate. The rate rises over the first steps and falls along a cosine.
    pub rate: f64,
    /// Seed of weights, examples and all other random numbers.
    pub seed: u64,
    /// How slowly the running average follows the weights, 0 to 1. The average is judged and kept.
    pub average: f64,
    /// Number of steps between two entries of the log.
    pub log_every: u64,
    /// Number of steps between two judgements of held-out examples, and at most between two
    /// checkpoints.
    pub judge_every: u64,
    /// Number of held-out examples to judge.
    pub held_out: usize,
    /// Number of judgements without a better score after which training ends; `None`: train to the
    /// last step.
    pub patience: Option<u64>,
}

impl Settings {
    /// Settings for the shipped size of this network.
    #[must_use]
    pub fn new(model: Model) -> Self {
        let (steps, rate) = match model {
            Model::Fsrcnn => (8_000, 2e-3),
            Model::Diffusion => (20_000, 1e-3),
            Model::Ancestral => (20_000, 5e-4),
            Model::Gan => (12_000, 5e-4),
            Model::Estimator => (6_000, 1e-3),
            Model::Classifier => (6_000, 1e-3),
        };
        Self {
            model,
            width: Vec::new(),
            steps,
            batch: 16,
            rate,
            seed: 1,
            average: 0.999,
            log_every: 50,
            judge_every: 500,
            held_out: 96,
            patience: Some(12),
        }
    }

    fn validate(&self) -> Result<(), TrainError> {
        let setting = |holds, name, found: String, expected| match holds {
            true => Ok(()),
            false => Err(TrainError::Setting { name, found, expected }),
        };
        setting(self.steps > 0, "steps", self.steps.to_string(), "at least 1")?;
        setting(self.batch > 0, "batch", self.batch.to_string(), "at least 1")?;
        setting(self.held_out > 0, "held-out examples", self.held_out.to_string(), "at least 1")?;
        let often = self.log_every.min(self.judge_every);
        setting(often > 0, "steps between entries", often.to_string(), "at least 1")?;
        let rate = self.rate > 0.0 && self.rate < 1.0;
        setting(rate, "rate", self.rate.to_string(), "more than 0 and less than 1")?;
        let average = (0.0..1.0).contains(&self.average);
        setting(average, "average", self.average.to_string(), "0 to less than 1")?;
        let widths = self.width.iter().all(|&w| (1..=1024).contains(&w));
        let (count, expected) = match self.model {
            Model::Diffusion | Model::Ancestral | Model::Gan => {
                (self.width.len() < 6, "up to 5 levels of 1 to 1024 channels")
            }
            Model::Fsrcnn => (
                [0, 2].contains(&self.width.len()),
                "2 numbers, of features and of shrunk features",
            ),
            Model::Estimator => {
                ([0, 4].contains(&self.width.len()), "4 numbers, one for each convolution")
            }
            Model::Classifier => {
                ([0, 3].contains(&self.width.len()), "3 numbers, one for each pair of convolutions")
            }
        };
        setting(widths && count, "width", format!("{:?}", self.width), expected)
    }
}

/// Why a run failed. `Display` is one line.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TrainError {
    /// A setting is outside its range.
    #[error("{name} is {found}, expected {expected}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// The value found, as text.
        found: String,
        /// The accepted range.
        expected: &'static str,
    },
    /// The loss or a weight is not finite.
    #[error(
        "the loss is {loss} at step {step}; what was kept last is good: go on from it with --resume and a lower --rate"
    )]
    NotFinite {
        /// The step.
        step: u64,
        /// The loss.
        loss: f64,
    },
    /// There are no data, or not the data that the network needs.
    #[error(transparent)]
    Data(#[from] DataError),
    /// A scene could not be degraded.
    #[error(transparent)]
    Degrade(#[from] DegradeError),
    /// The weights do not fit.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// The run cannot continue from this checkpoint.
    #[error("checkpoint: {found}, expected {expected}")]
    Checkpoint {
        /// What is wrong with the checkpoint.
        found: String,
        /// What was expected.
        expected: &'static str,
    },
    /// The caller could not store a result.
    #[error(transparent)]
    Keep(#[from] Box<dyn std::error::Error + Send + Sync>),
}
