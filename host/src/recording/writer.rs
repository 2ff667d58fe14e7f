//! Writes a recording while the packets arrive.

use super::file::{Place, Target};
use super::{ACCOUNT, IDENTITY, JSON, PROFILE, RUN, RunAccount, SETTLING, SETUP, TOPIC, encoding};
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
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// The longest time that packets stay in memory.
const FLUSH_EVERY: Duration = Duration::from_millis(500);

/// An open recording.
pub struct Recorder {
    place: Place,
    writer: Records,
    /// The same file, for syncing to the disk.
    file: File,
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
    /// Makes the file and writes identity and setup. `run` is the number of the run whose frames
    /// count.
    ///
    /// # Errors
    /// If the file exists, or cannot be made or written. A file that could not be written is
    /// removed.
    pub fn create(
        target: &Target,
        identity: &CameraIdentity,
        setup: &MeasurementSetup,
        settling: Option<&Settling>,
        run: Option<u16>,
    ) -> io::Result<Self> {
        let (place, file) = Place::make(target)?;
        let begun = file.try_clone().map_err(Into::into).and_then(|clone| {
            let buffered = BufWriter::with_capacity(1 << 20, clone);
            begun(buffered, identity, setup, settling, run)
        });
        let (writer, channel) = match begun {
            Ok(begun) => begun,
            Err(error) => {
                place.remove();
                return Err(to_io(error));
            }
        };
        let epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos();
        let epoch = u64::try_from(epoch).unwrap_or(u64::MAX);
        let now = Instant::now();
        Ok(Self { place, writer, file, channel, packets: 0, epoch, started: now, flushed: now })
    }

    /// The current path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.place.path()
    }

    /// Appends one packet as received.
    ///
    /// # Errors
    /// If the disk is full or gone.
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

    /// Writes the received packets to the file, unless the last flush is recent.
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

    /// Writes the account of the run and syncs the file to the disk. The recording of a whole run
    /// then replaces the file that it should replace. Returns the file's path.
    ///
    /// # Errors
    /// The file's path, and why the file could not be finished.
    pub fn finish(self, account: &RunAccount) -> Result<PathBuf, (PathBuf, io::Error)> {
        let Self { mut place, writer, file, .. } = self;
        let settled = closed(writer, account)
            .map_err(to_io)
            .and_then(|()| place.settle(&file, account.missing.is_none()));
        let path = place.path().to_owned();
        settled.map(|()| path.clone()).map_err(|error| (path, error))
    }

    /// Removes the file, because nothing was recorded.
    pub fn discard(self) {
        let Self { place, writer, .. } = self;
        drop(writer);
        place.remove();
    }
}

type Records = Writer<NoSeek<BufWriter<File>>>;

/// Writes the information before the packets. Returns the channel of the packets.
fn begun(
    file: BufWriter<File>,
    identity: &CameraIdentity,
    setup: &MeasurementSetup,
    settling: Option<&Settling>,
    run: Option<u16>,
) -> McapResult<(Records, u16)> {
    let options = WriteOptions::new().use_chunks(false).profile(PROFILE).disable_seeking(true);
    let mut writer = options.create(NoSeek::new(file))?;
    let channel = writer.add_channel(0, TOPIC, &encoding(identity.protocol), &BTreeMap::new())?;
    note(&mut writer, IDENTITY, identity)?;
    note(&mut writer, SETUP, setup)?;
    if let Some(settling) = settling {
        note(&mut writer, SETTLING, settling)?;
    }
    if let Some(run) = run {
        note(&mut writer, RUN, &run)?;
    }
    // After this flush the file identifies itself, whatever happens.
    writer.flush()?;
    Ok((writer, channel))
}

/// Writes the information after the packets.
fn closed(mut writer: Records, account: &RunAccount) -> McapResult<()> {
    note(&mut writer, ACCOUNT, account)?;
    writer.finish()?;
    Ok(writer.into_inner().into_inner().flush()?)
}

fn note(writer: &mut Records, name: &str, value: &impl Serialize) -> McapResult<()> {
    let json = serde_json::to_string(value).map_err(io::Error::other)?;
    let metadata = BTreeMap::from([(JSON.to_owned(), json)]);
    writer.write_metadata(&Metadata { name: name.to_owned(), metadata })?;
    Ok(())
}
