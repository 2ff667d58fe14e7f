//! A checkpoint: a whole run as bytes. After the SHA-256 of the rest comes a line of JSON, then the
//! states of networks and optimisers.
//!
//! # Invariant
//! Incomplete bytes, damaged bytes, or bytes of another run are refused with the reason, and never
//! partly read (`tests::bytes_cut_short_anywhere_are_refused`,
//! `tests::a_checkpoint_with_any_wrong_bit_is_refused`,
//! `tests::a_run_of_other_settings_or_data_is_not_gone_on_with`).

use super::TrainError;
use super::log::Progress;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// First bytes of a checkpoint; the digit is the format's version.
const MAGIC: &[u8; 8] = b"NIRSPIT2";
/// First bytes of a checkpoint without a checksum.
const MAGIC_1: &[u8; 8] = b"NIRSPIT1";
/// Length of the checksum.
const SUM_BYTES: usize = 32;
const EXPECTED: &str = "a whole checkpoint of nirspi train";

/// A run at one step.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// The run's progress.
    pub progress: Progress,
    /// States of networks and optimisers, from the learner.
    pub states: Vec<Vec<u8>>,
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
    /// [`TrainError::Checkpoint`] if a number cannot be written as JSON.
    pub fn to_bytes(&self) -> Result<Vec<u8>, TrainError> {
        let lengths = self.states.iter().map(Vec::len).collect();
        let header = Header { progress: self.progress.clone(), lengths };
        let header = serde_json::to_vec(&header).map_err(|error| damaged(error.to_string()))?;
        let mut bytes = MAGIC.to_vec();
        bytes.extend([0; SUM_BYTES]);
        bytes.extend((header.len() as u64).to_le_bytes());
        bytes.extend(header);
        self.states.iter().for_each(|state| bytes.extend(state));
        let (start, content) = bytes.split_at_mut(MAGIC.len() + SUM_BYTES);
        start[MAGIC.len()..].copy_from_slice(&Sha256::digest(content));
        Ok(bytes)
    }

    /// Reads a checkpoint.
    ///
    /// # Errors
    /// [`TrainError::Checkpoint`] if the bytes are incomplete, damaged, or not a checkpoint.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, TrainError> {
        let short = || damaged(format!("{} bytes", bytes.len()));
        if bytes.starts_with(MAGIC_1) {
            return Err(TrainError::Checkpoint {
                found: "a checkpoint of an earlier nirspi, without a checksum".to_owned(),
                expected: "one of this version: start the run again, or resume it with the program that began it",
            });
        }
        let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| damaged("other contents".to_owned()))?;
        let (sum, rest) = rest.split_first_chunk::<SUM_BYTES>().ok_or_else(short)?;
        if Sha256::digest(rest)[..] != sum[..] {
            let found = format!("{} bytes that are damaged or incomplete", bytes.len());
            return Err(damaged(found));
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::{Model, Settings};

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
    fn a_checkpoint_with_any_wrong_bit_is_refused() {
        let mut bytes = checkpoint().to_bytes().unwrap();
        for bit in 0..8 * bytes.len() {
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert!(Checkpoint::from_bytes(&bytes).is_err(), "bit {bit}");
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        assert_eq!(Checkpoint::from_bytes(&bytes).unwrap(), checkpoint());
    }

    #[test]
    fn a_checkpoint_of_the_format_before_is_refused_by_name() {
        let error = Checkpoint::from_bytes(b"NIRSPIT1 and the rest").unwrap_err().to_string();
        assert!(error.contains("a checkpoint of an earlier nirspi"), "{error}");
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
