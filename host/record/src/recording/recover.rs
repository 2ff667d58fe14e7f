//! Repairs a damaged recording into a new file.

use super::{Book, Opening, Recording, RecordingError, RunAccount};
use crate::recording::hear_recording;
use nirspi_camera::account::LossCounters;
use nirspi_files::FileError;
use nirspi_files::output::{Existing, write_in_pieces};
use nirspi_recon::words::count;
use serde::Serialize;
use std::fmt;
use std::io::Write;
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
    #[error(transparent)]
    File(#[from] FileError),
}

/// Copies every packet that can be read into a new recording, with its time, which is whole or not
/// made. The account of the new recording says what is missing. With `overwrite`, a file of the name
/// `out` is replaced, but never the damaged recording itself.
///
/// # Errors
/// [`RecoverError`] if the recording has no setup any more, or the new file exists or cannot be
/// written.
pub fn recover(path: &Path, out: &Path, overwrite: bool) -> Result<Recovered, RecoverError> {
    write_in_pieces(out, Existing::of(overwrite, Some(path)), |file| copy(path, file, out))
}

fn copy(path: &Path, file: impl Write, out: &Path) -> Result<Recovered, RecoverError> {
    let mut recording = Recording::open(path)?;
    let write = |error| FileError::io(out, "write", error);
    let (setup, settling) = (recording.setup.clone(), recording.settling.clone());
    let (identity, run) = (recording.identity.clone(), recording.run);
    let (identity, setup, settling) = (&identity, &setup, settling.as_ref());
    let (part, provenance) = (recording.part.clone(), recording.provenance.clone());
    let (part, provenance) = (part.as_ref(), provenance.as_ref());
    let opening = Opening { identity, setup, settling, run, part, provenance };
    let mut book = Book::begin(file, &opening).map_err(write)?;
    let mut count = hear_recording(&mut recording, |heard, count| {
        book.packet(heard.time_ns, heard.raw)
            .and_then(|()| book.heard(heard.time_ns, heard.content, count))
            .map_err(|error| RecoverError::from(write(error)))
    })?;
    let end = recording.end().clone();
    let old = end.account.clone().unwrap_or_default();
    if let (Some(made), false) =
        (old.made.and_then(|made| u32::try_from(made).ok()), count.has_ended())
    {
        count.end(made);
    }
    let frames = count.account().counters();
    let account = match (&end.account, &end.cut_short) {
        (Some(account), _) if account.counters == frames => account.clone(),
        (_, damage) => {
            let damage = damage.as_deref().unwrap_or("a packet is damaged");
            let before = old.missing.map_or_else(String::new, |missing| format!("; {missing}"));
            let missing = Some(format!("recovered, {damage}{before}"));
            let made = count.made();
            RunAccount {
                counters: frames,
                asked: old.asked,
                made,
                missing,
                continues: old.continues,
            }
        }
    };
    book.end(Some(&account)).map_err(write)?;
    let received = end.account.as_ref().map(|account| account.counters.received);
    Ok(Recovered {
        recording: out.to_owned(),
        packets: end.packets,
        frames,
        frames_lost: received.map(|received| received.saturating_sub(frames.received)),
        bytes_lost: end.damage.bytes,
        damage: end.cut_short,
    })
}
