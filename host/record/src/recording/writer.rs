//! Writes a recording while the packets arrive.
//!
//! The disk has a thread of its own behind a queue (`spool`), so the thread that reads the camera waits
//! for the disk only when the queue is full.

use super::book::{Book, Opening};
use super::file::{Place, Target};
use super::spool::{self, Disk, Spool};
use super::{Part, RunAccount};
use nirspi_camera::tally::FrameCount;
use nirspi_wire::{DeviceMessage, PacketError};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// The longest time after which packets are handed to the disk's queue.
const FLUSH_EVERY: Duration = Duration::from_millis(500);

/// An open recording.
pub struct Recorder {
    place: Place,
    book: Book<Spool>,
    /// Behind the book, whose end ends the disk's thread.
    disk: Disk,
    /// The same file, for syncing to the disk.
    file: File,
    clock: Clock,
    flushed: Instant,
    /// Time of the newest packet.
    newest: u64,
}

/// The clock of the packets' times. All files of a run have the same one.
#[derive(Debug, Clone, Copy)]
struct Clock {
    epoch: u64,
    started: Instant,
}

impl Clock {
    fn start() -> Self {
        let epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos();
        Self { epoch: u64::try_from(epoch).unwrap_or(u64::MAX), started: Instant::now() }
    }

    fn now(&self) -> u64 {
        let age = u64::try_from(self.started.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.epoch.saturating_add(age)
    }
}

impl Recorder {
    /// Makes the file and writes what stands before the packets.
    ///
    /// # Errors
    /// If the file exists, or cannot be made or written. A file that could not be written is
    /// removed.
    pub fn create(target: &Target, opening: &Opening<'_>) -> io::Result<Self> {
        let (place, file) = Place::make(target)?;
        let begun = file.try_clone().and_then(|clone| {
            let (spool, disk) = spool::start(clone)?;
            let book = Book::begin(spool, opening)?;
            disk.settle()?;
            Ok((book, disk))
        });
        let (book, disk) = match begun {
            Ok(begun) => begun,
            Err(error) => {
                place.remove();
                return Err(error);
            }
        };
        let clock = Clock::start();
        let (flushed, newest) = (clock.started, clock.epoch);
        Ok(Self { place, book, disk, file, clock, flushed, newest })
    }

    /// Makes this the file of a run that follows `before`, with the same clock. To be called before
    /// the first packet. The first file has none before it.
    pub(crate) fn follow(&mut self, before: Option<&Self>, place: &Part) -> io::Result<()> {
        if let Some(before) = before {
            (self.clock, self.newest) = (before.clock, before.newest);
        }
        self.book.place(place)
    }

    /// An estimate of the file's size if the recording ended now, a little too high.
    pub(crate) fn size(&self) -> u64 {
        self.book.size()
    }

    /// Time of the newest packet in ns of the host's clock.
    pub(crate) fn newest_ns(&self) -> u64 {
        self.newest
    }

    /// The current path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.place.path()
    }

    /// Share of the queue that waits for the disk, 0 to 1.
    #[must_use]
    pub fn queued(&self) -> f64 {
        self.disk.queued()
    }

    /// Appends one packet as received.
    ///
    /// # Errors
    /// If the disk is full or gone.
    pub fn packet(&mut self, raw: &[u8]) -> io::Result<()> {
        self.newest = self.clock.now();
        self.book.packet(self.newest, raw)?;
        self.flush_if_due()
    }

    /// Writes what the newest packet means into the channels of log and telemetry. `count` has
    /// counted the packet.
    ///
    /// # Errors
    /// If the disk is full or gone.
    pub fn heard(
        &mut self,
        content: &Result<DeviceMessage<'_>, PacketError>,
        count: &FrameCount,
    ) -> io::Result<()> {
        self.book.heard(self.newest, content, count)
    }

    /// Hands the received packets to the disk's queue, unless the last flush is recent.
    ///
    /// # Errors
    /// As [`packet`](Self::packet).
    pub fn flush_if_due(&mut self) -> io::Result<()> {
        if self.flushed.elapsed() < FLUSH_EVERY {
            return Ok(());
        }
        self.flushed = Instant::now();
        self.book.flush()
    }

    /// Writes the account of the run and syncs the file to the disk. The recording of a whole run
    /// then replaces the file that it should replace. Returns the file's path.
    ///
    /// # Errors
    /// The file's path, and why the file could not be finished.
    pub fn finish(self, account: &RunAccount) -> Result<PathBuf, (PathBuf, io::Error)> {
        let Self { mut place, book, disk, file, .. } = self;
        let written = book.end(Some(account)).and_then(|()| disk.end());
        let settled = written.and_then(|()| place.settle(&file, account.missing.is_none()));
        let path = place.path().to_owned();
        settled.map(|()| path.clone()).map_err(|error| (path, error))
    }

    /// Removes the file, because nothing was recorded.
    pub fn discard(self) {
        let Self { place, book, disk, .. } = self;
        drop((book, disk));
        place.remove();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Recording;
    use nirspi_camera::setup::MeasurementSetup;
    use nirspi_files::identity::CameraIdentity;
    use nirspi_recon::Order;

    /// The clock of the system may be set while a run is recorded.
    #[test]
    fn a_file_that_follows_another_has_its_clock() {
        let folder = tempfile::tempdir().unwrap();
        let identity = CameraIdentity::current("virtual", "1");
        let setup = MeasurementSetup::new(&Order::Natural, 0.1).unwrap();
        let create = |name: &str| {
            let target = Target::New(folder.path().join(name));
            Recorder::create(&target, &Opening::of(&identity, &setup, 7)).unwrap()
        };
        let (mut first, mut second) = (create("1.mcap"), create("2.mcap"));
        const HOUR_NS: u64 = 3_600_000_000_000;
        first.clock.epoch -= HOUR_NS;
        first.packet(&[1, 0]).unwrap();
        let place = Part { number: 2, first_frame: 1, follows: Some("1.mcap".into()) };
        second.follow(Some(&first), &place).unwrap();
        assert_eq!(second.newest_ns(), first.newest_ns());
        second.packet(&[2, 0]).unwrap();
        let path = second.finish(&RunAccount::default()).unwrap();
        let mut recording = Recording::open(&path).unwrap();
        assert_eq!(recording.part, Some(place));
        let later = recording.next().unwrap().unwrap().time_ns - first.newest_ns();
        assert!(later < HOUR_NS / 2, "{later} ns later");
        first.discard();
    }
}
