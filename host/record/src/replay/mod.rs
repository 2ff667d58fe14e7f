//! Plays a recording back as a camera: `--camera replay:REC[,SPEED]`.
//!
//! The replayed camera has the identity, setup and settling of the recorded one, and sends the
//! packets of the recording: frames, depth maps, events and damaged packets. Replies are not played
//! back, because a reply belongs to a request of its host: the replay answers each request itself.
//!
//! # Invariant
//! A capture of a replay has the packets of the recording, byte for byte and in their order, except
//! replies (`a_capture_of_a_replay_has_the_packets_of_the_recording` in `host/tests/replay.rs`).
//! With a run of fewer frames than recorded, the replay ends the run itself.

mod answers;
mod link;
mod stream;

pub use link::ReplayLink;

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// A recording and the speed at which to play it.
#[derive(Debug, Clone, PartialEq)]
pub struct ReplayAddress {
    /// The recording.
    pub path: PathBuf,
    /// The speed.
    pub speed: Speed,
}

impl Eq for ReplayAddress {}

/// The speed of a replay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Speed {
    /// This many times the camera's time.
    Times(f64),
    /// As fast as the host reads.
    Max,
}

impl FromStr for Speed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "max" {
            return Ok(Self::Max);
        }
        let times = text.strip_suffix('x').unwrap_or(text).parse().ok();
        times
            .filter(|times: &f64| times.is_finite() && *times > 0.0)
            .map(Self::Times)
            .ok_or_else(|| "expected a speed such as 1, 0.5 or max".to_owned())
    }
}

impl FromStr for ReplayAddress {
    type Err = String;

    /// Reads `REC` or `REC,SPEED`. Without a speed, the replay has the camera's time.
    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.rsplit_once(',').map(|(path, speed)| (path, speed.parse()));
        let (path, speed) = match parts {
            Some((path, Ok(speed))) => (path, speed),
            // A comma may belong to the name of the file.
            _ => (text, Speed::Times(1.0)),
        };
        if path.is_empty() {
            return Err("expected replay:REC or replay:REC,SPEED".to_owned());
        }
        Ok(Self { path: PathBuf::from(path), speed })
    }
}

impl fmt::Display for ReplayAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "replay:{}", self.path.display())?;
        match self.speed {
            Speed::Times(1.0) => Ok(()),
            Speed::Times(times) => write!(f, ",{times}"),
            Speed::Max => f.write_str(",max"),
        }
    }
}
