//! Writes a recording as it comes in.

use super::{ACCOUNT, IDENTITY, JSON, PROFILE, SETTLING, SETUP, TOPIC, encoding};
use crate::account::LossCounters;
use crate::calibration::Settling;
use crate::session::CameraIdentity;
use crate::setup::MeasurementSetup;
use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{McapResult, WriteOptions, Writer};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Longest time that packets stay in memory.
const FLUSH_EVERY: Duration = Duration::from_millis(500);

/// An open recording.
pub struct Recorder {
    writer: Writer<NoSeek<BufWriter<File>>>,
    channel: u16,
    packets: u32,
    epoch: u64,
    started: Instant,
    flushed: Instant,
}

fn to_io(error: mcap::McapError) -> io::Error {
    match error {
        mcap::McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

impl Recorder {
    /// Creates the file and writes who is recorded, doing what.
    ///
    /// # Errors
    /// When the file cannot be created or written; it is not left behind then.
    pub fn create(
        path: &Path,
        identity: &CameraIdentity,
        setup: &MeasurementSetup,
        settling: Option<&Settling>,
    ) -> io::Result<Self> {
        let file = BufWriter::with_capacity(1 << 20, File::create(path)?);
        Self::with_file(file, identity, setup, settling).map_err(|error| {
            // Not a device that the user records into. What cannot be removed is empty.
            if path.is_file() {
                let _ = std::fs::remove_file(path);
            }
            to_io(error)
        })
    }

    fn with_file(
        file: BufWriter<File>,
        identity: &CameraIdentity,
        setup: &MeasurementSetup,
        settling: Option<&Settling>,
    ) -> McapResult<Self> {
        let options = WriteOptions::new().use_chunks(false).profile(PROFILE).disable_seeking(true);
        let mut writer = options.create(NoSeek::new(file))?;
        let channel =
            writer.add_channel(0, TOPIC, &encoding(identity.protocol), &BTreeMap::new())?;
        let epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos();
        let now = Instant::now();
        let mut recorder = Self {
            writer,
            channel,
            packets: 0,
            epoch: u64::try_from(epoch).unwrap_or(u64::MAX),
            started: now,
            flushed: now,
        };
        recorder.note(IDENTITY, identity)?;
        recorder.note(SETUP, setup)?;
        if let Some(settling) = settling {
            recorder.note(SETTLING, settling)?;
        }
        // Whatever happens from here on, the file says what it is.
        recorder.writer.flush()?;
        Ok(recorder)
    }

    fn note(&mut self, name: &str, value: &impl Serialize) -> McapResult<()> {
        let json = serde_json::to_string(value).map_err(io::Error::other)?;
        let metadata = BTreeMap::from([(JSON.to_owned(), json)]);
        self.writer.write_metadata(&Metadata { name: name.to_owned(), metadata })?;
        Ok(())
    }

    /// Appends one packet as it came.
    ///
    /// # Errors
    /// When the disk is full or gone.
    pub fn packet(&mut self, raw: &[u8]) -> io::Result<()> {
        let age = self.started.elapsed();
        let time = self.epoch.saturating_add(u64::try_from(age.as_nanos()).unwrap_or(u64::MAX));
        let header = MessageHeader {
            channel_id: self.channel,
            sequence: self.packets,
            log_time: time,
            publish_time: time,
        };
        self.writer.write_to_known_channel(&header, raw).map_err(to_io)?;
        self.packets = self.packets.wrapping_add(1);
        self.flush_if_due()
    }

    /// Puts what has come on disk, unless that was done lately.
    ///
    /// # Errors
    /// As [`packet`](Self::packet).
    pub fn flush_if_due(&mut self) -> io::Result<()> {
        if self.flushed.elapsed() < FLUSH_EVERY {
            return Ok(());
        }
        self.flushed = Instant::now();
        self.writer.flush().map_err(to_io)
    }

    /// Writes the account of the run and closes the file.
    ///
    /// # Errors
    /// As [`packet`](Self::packet).
    pub fn finish(mut self, counters: &LossCounters) -> io::Result<()> {
        self.note(ACCOUNT, counters).map_err(to_io)?;
        self.writer.finish().map_err(to_io)?;
        self.writer.into_inner().into_inner().flush()
    }
}
