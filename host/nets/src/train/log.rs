//! How far a run is: its log, its best score, its losses since the last entry.

use super::{Score, Settings, TrainError};
use serde::{Deserialize, Serialize};

/// One line of the log.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Steps done.
    pub step: u64,
    /// Mean loss since the entry before.
    pub loss: f64,
    /// Score of held-out examples, where they were looked at: more is better.
    pub held_out: Option<f64>,
    /// What the score is.
    pub score: Score,
    /// Learning rate.
    pub rate: f64,
    /// Seconds of training.
    pub seconds: f64,
}

/// How far a run is, and what led there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// How it is trained.
    pub settings: Settings,
    /// What it is trained on: a text that differs for other data.
    pub data: String,
    /// Steps done.
    pub step: u64,
    /// Best held-out score so far, and its step.
    pub best: Option<(f64, u64)>,
    /// Looks at held-out examples since then.
    pub looks_since_best: u64,
    /// Losses since the last entry of the log: their sum and number.
    #[serde(with = "exact")]
    pub losses: (f64, u64),
    /// Seconds of training so far.
    pub seconds: f64,
    /// The log so far.
    pub log: Vec<Entry>,
}

/// A sum by its bits: JSON readers may be off by the last one.
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
    /// Whether a run with these settings on this data may go on from here. A run may become longer or shorter, and
    /// may go on with another rate: that is for its user to say.
    ///
    /// # Errors
    /// [`TrainError::Checkpoint`] naming what differs.
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
