//! The progress of a run: its log, its best score, its losses since the last entry.

use super::{Score, Settings, TrainError};
use serde::{Deserialize, Serialize};

/// One line of the log.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Number of steps done.
    pub step: u64,
    /// Mean loss since the entry before.
    pub loss: f64,
    /// Score of held-out examples, if they were judged at this step; larger is better.
    pub held_out: Option<f64>,
    /// The kind of score.
    pub score: Score,
    /// Learning rate.
    pub rate: f64,
    /// Seconds of training.
    pub seconds: f64,
}

/// The progress and the history of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Settings of the run.
    pub settings: Settings,
    /// Description of the training data, which differs for other data.
    pub data: String,
    /// Number of steps done.
    pub step: u64,
    /// Best held-out score so far, and its step.
    pub best: Option<(f64, u64)>,
    /// Number of judgements of held-out examples since the best score.
    pub looks_since_best: u64,
    /// Losses since the last entry of the log: sum and number.
    #[serde(with = "exact")]
    pub losses: (f64, u64),
    /// Seconds of training so far.
    pub seconds: f64,
    /// The log so far.
    pub log: Vec<Entry>,
}

/// Stores a sum by its bits, because a JSON reader may change its last bit.
mod exact {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(losses: &(f64, u64), to: S) -> Result<S::Ok, S::Error> {
        (losses.0.to_bits(), losses.1).serialize(to)
    }

    pub(super) fn deserialize<'d, D: Deserializer<'d>>(from: D) -> Result<(f64, u64), D::Error> {
        let (bits, count) = <(u64, u64)>::deserialize(from)?;
        Ok((f64::from_bits(bits), count))
    }
}

impl Progress {
    /// Checks that a run with these settings on this data may continue from here. The user may
    /// change the number of steps and the learning rate.
    ///
    /// # Errors
    /// [`TrainError::Checkpoint`] names the difference.
    pub fn expect(&self, settings: &Settings, data: &str) -> Result<(), TrainError> {
        let theirs = &self.settings;
        let alike = Settings { steps: theirs.steps, rate: theirs.rate, ..settings.clone() };
        if alike != *theirs {
            let found = format!("made with {theirs:?}");
            return Err(TrainError::Checkpoint {
                found,
                expected: "the same settings but steps and rate",
            });
        }
        if self.data != data {
            let found = "made from other data".to_owned();
            return Err(TrainError::Checkpoint { found, expected: "the same data" });
        }
        Ok(())
    }
}
