//! Everything that a run is, as bytes: a line of JSON, then the states of networks and optimisers.
//!
//! The one law: bytes that are not whole, or of another run, are refused with what is wrong, never half read.

use super::run::Entry;
use super::{Settings, TrainError};
use serde::{Deserialize, Serialize};

/// What a checkpoint starts with; the digit is the format's version.
const MAGIC: &[u8; 8] = b"NIRSPIT1";
const EXPECTED: &str = "a whole checkpoint of nirspi train";

/// A run at one step.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// How far it is.
    pub progress: Progress,
    /// States of networks and optimisers, as the learner gave them.
    pub states: Vec<Vec<u8>>,
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

#[derive(Serialize, Deserialize)]
struct Header {
    progress: Progress,
    lengths: Vec<usize>,
}

impl Checkpoint {
    /// The bytes of a file.
    ///
    /// # Errors
    /// [`TrainError::Checkpoint`] if a number in it cannot be written as JSON.
    pub fn to_bytes(&self) -> Result<Vec<u8>, TrainError> {
        let lengths = self.states.iter().map(Vec::len).collect();
        let header = Header { progress: self.progress.clone(), lengths };
        let header = serde_json::to_vec(&header).map_err(|error| damaged(error.to_string()))?;
        let mut bytes = MAGIC.to_vec();
        bytes.extend((header.len() as u64).to_le_bytes());
        bytes.extend(header);
        self.states.iter().for_each(|state| bytes.extend(state));
        Ok(bytes)
    }

    /// Reads them back.
    ///
    /// # Errors
    /// [`TrainError::Checkpoint`] if they are not whole, or no checkpoint.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, TrainError> {
        let short = || damaged(format!("{} bytes", bytes.len()));
        let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| damaged("other contents".to_owned()))?;
        let (length, rest) = rest.split_first_chunk::<8>().ok_or_else(short)?;
        let length = usize::try_from(u64::from_le_bytes(*length)).map_err(|_| short())?;
        let (header, mut rest) = rest.split_at_checked(length).ok_or_else(short)?;
        let header: Header =
            serde_json::from_slice(header).map_err(|error| damaged(error.to_string()))?;
        let mut states = Vec::with_capacity(header.lengths.len());
        for length in header.lengths {
            let (state, after) = rest.split_at_checked(length).ok_or_else(short)?;
            states.push(state.to_vec());
            rest = after;
        }
        if !rest.is_empty() {
            return Err(short());
        }
        Ok(Self { progress: header.progress, states })
    }
}

fn damaged(found: String) -> TrainError {
    TrainError::Checkpoint { found, expected: EXPECTED }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::Model;

    fn checkpoint() -> Checkpoint {
        let progress = Progress {
            settings: Settings::new(Model::Gan),
            data: "fnt".to_owned(),
            step: 7,
            best: Some((31.25, 5)),
            looks_since_best: 2,
            losses: (0.1 + 0.2, 4),
            seconds: 1.5,
            log: Vec::new(),
        };
        Checkpoint { progress, states: vec![vec![1, 2, 3], Vec::new(), vec![9]] }
    }

    #[test]
    fn it_is_read_back_as_it_was() {
        let bytes = checkpoint().to_bytes().unwrap();
        assert_eq!(Checkpoint::from_bytes(&bytes).unwrap(), checkpoint());
    }

    #[test]
    fn bytes_cut_short_anywhere_are_refused() {
        let bytes = checkpoint().to_bytes().unwrap();
        for length in 0..bytes.len() {
            assert!(Checkpoint::from_bytes(&bytes[..length]).is_err(), "{length}");
        }
        let longer = [bytes, vec![0]].concat();
        assert!(Checkpoint::from_bytes(&longer).is_err());
    }

    #[test]
    fn a_run_of_other_settings_or_data_is_not_gone_on_with() {
        let progress = checkpoint().progress;
        let settings = Settings::new(Model::Gan);
        let longer = Settings { steps: 99, rate: 1e-5, ..settings.clone() };
        assert!(progress.expect(&longer, "fnt").is_ok());
        let wider = Settings { width: vec![8], ..settings.clone() };
        assert!(progress.expect(&wider, "fnt").unwrap_err().to_string().contains("same settings"));
        assert!(progress.expect(&settings, "hnd").unwrap_err().to_string().contains("same data"));
    }
}
