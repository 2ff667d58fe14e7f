//! Repairs a damaged recording into a new file.

use super::{Recorder, Recording, RecordingError, RunAccount, Target};
use crate::account::LossCounters;
use crate::tally::hear_recording;
use nirspi_recon::words::count;
use serde::Serialize;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// What was recovered.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Recovered {
    /// The new file.
    pub recording: PathBuf,
    /// Packets in the new file.
    pub packets: u64,
    /// The loss counters of the new file.
    pub frames: LossCounters,
    /// Frames that the capture had received and that are not whole any more; `null` if the old file
    /// has no account.
    pub frames_lost: Option<u64>,
    /// Bytes of the old file that were passed over.
    pub bytes_lost: u64,
    /// What was wrong with the old file; `null` if nothing was.
    pub damage: Option<String>,
}

impl fmt::Display for Recovered {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { recording, packets, frames, frames_lost, .. } = self;
        let damage = self.damage.as_deref().unwrap_or("nothing was damaged");
        writeln!(f, "{damage}")?;
        match frames_lost {
            Some(lost) => writeln!(f, "{} of the capture lost", count(*lost, "frame"))?,
            None => writeln!(f, "the account of the capture is lost")?,
        }
        let packets = count(*packets, "packet");
        write!(f, "{}: {packets}, {frames}", recording.display())
    }
}

/// Why a recording cannot be recovered.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RecoverError {
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The new file cannot be written.
    #[error("{path}: cannot write the recovered recording")]
    Write {
        /// The new file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// Copies every packet that can be read into a new recording, with its time. The account of the new
/// recording says what is missing.
///
/// # Errors
/// [`RecoverError`] if the recording has no setup any more, or the new file exists or cannot be
/// written. A new file that was not finished is removed.
pub fn recover(path: &Path, target: &Target) -> Result<Recovered, RecoverError> {
    let mut recording = Recording::open(path)?;
    let write = |source| RecoverError::Write { path: target.path().to_owned(), source };
    let (setup, settling) = (recording.setup.clone(), recording.settling.clone());
    let (identity, run) = (recording.identity.clone(), recording.run);
    let mut recorder =
        Recorder::create(target, &identity, &setup, settling.as_ref(), run).map_err(write)?;
    let copied = hear_recording(&mut recording, |heard, tally| {
        recorder
            .packet_of(heard.time_ns, heard.raw)
            .and_then(|()| recorder.heard(heard.content, tally))
            .map_err(write)
    });
    let mut tally = match copied {
        Ok(tally) => tally,
        Err(error) => {
            recorder.discard();
            return Err(error);
        }
    };
    let end = recording.end().clone();
    let old = end.account.clone().unwrap_or_default();
    if let (Some(made), false) =
        (old.made.and_then(|made| u32::try_from(made).ok()), tally.has_ended())
    {
        tally.end(made);
    }
    let frames = tally.account().counters();
    let account = match (&end.account, &end.cut_short) {
        (Some(account), _) if account.counters == frames => account.clone(),
        (_, damage) => {
            let damage = damage.as_deref().unwrap_or("a packet is damaged");
            let before = old.missing.map_or_else(String::new, |missing| format!("; {missing}"));
            let missing = Some(format!("recovered, {damage}{before}"));
            let made = tally.made();
            RunAccount { counters: frames, asked: old.asked, made, missing }
        }
    };
    let recording =
        recorder.finish(&account).map_err(|(path, source)| RecoverError::Write { path, source })?;
    let received = end.account.as_ref().map(|account| account.counters.received);
    Ok(Recovered {
        recording,
        packets: end.packets,
        frames,
        frames_lost: received.map(|received| received.saturating_sub(frames.received)),
        bytes_lost: end.damage.bytes,
        damage: end.cut_short,
    })
}
