//! Records a run into one file, or into several files one after the other.
//!
//! The next file is made on a thread of its own and the last one is closed on another, because a disk
//! may take seconds for either while the camera goes on. Until the next file is ready, the run goes on
//! in the current one.
//!
//! # Invariant
//! Nothing is lost at the change of file: each packet goes into exactly one file, and a run whose next
//! file cannot be made goes on in the current file until it is stopped (`host/tests/split.rs`).

use super::missing::lacking;
use crate::recording::{Opening, Part, Recorder, RunAccount, Split, Target, name_of, part_path};
use nirspi_camera::response::Settling;
use nirspi_camera::setup::MeasurementSetup;
use nirspi_camera::tally::FrameCount;
use nirspi_files::identity::CameraIdentity;
use nirspi_files::provenance::Provenance;
use nirspi_wire::{DeviceMessage, PacketError};
use std::io;
use std::mem;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// What every file of a run says before its packets.
#[derive(Debug)]
pub(super) struct Head {
    pub(super) identity: CameraIdentity,
    pub(super) setup: MeasurementSetup,
    pub(super) settling: Option<Settling>,
    /// The number of the run whose frames count.
    pub(super) run: u16,
    pub(super) provenance: Option<Provenance>,
}

impl Head {
    fn create(&self, target: &Target) -> io::Result<Recorder> {
        let Self { identity, setup, settling, run, provenance } = self;
        let (settling, provenance) = (settling.as_ref(), provenance.as_ref());
        let run = Some(*run);
        Recorder::create(
            target,
            &Opening { identity, setup, settling, run, part: None, provenance },
        )
    }

    /// The count of the frames from this one on.
    fn count(&self, first_frame: u64) -> FrameCount {
        FrameCount::new(&self.setup, Some(self.run)).beginning_at(first_frame)
    }
}

/// A file that cannot be made or written, and why.
pub(super) type Failed = (PathBuf, io::Error);

/// The files of a run that ended.
#[derive(Debug)]
pub(super) struct Recorded {
    /// The files in their order. The last one may be cut short.
    pub(super) files: Vec<PathBuf>,
    /// The first file that could not be made or written.
    pub(super) failed: Option<Failed>,
}

/// The recording of a run.
pub(super) struct RunRecorder {
    current: Recorder,
    splitting: Option<Splitting>,
}

/// A recording in several files.
struct Splitting {
    split: Split,
    /// The name without the number.
    whole: PathBuf,
    head: Arc<Head>,
    /// The number of the current file.
    number: u32,
    /// The frames of the current file.
    count: FrameCount,
    /// Whether the newest packet was a frame that arrived in order.
    is_after_frame: bool,
    /// When the current file began, in ns of the host's clock.
    began_ns: u64,
    next: Next,
    closing: Option<JoinHandle<Result<PathBuf, Failed>>>,
    /// The files that are closed.
    closed: Vec<PathBuf>,
    /// Why an earlier file could not be finished.
    failed: Option<Failed>,
}

/// The file after the current one.
enum Next {
    /// Not needed yet.
    Later,
    Making(JoinHandle<io::Result<Recorder>>),
    /// Cannot be made.
    Refused(io::Error),
}

impl RunRecorder {
    /// Makes the file, or the first of several files.
    ///
    /// # Errors
    /// As [`Recorder::create`].
    pub(super) fn create(target: &Target, head: Head) -> io::Result<Self> {
        let mut current = head.create(target)?;
        let Some(split) = target.split() else { return Ok(Self { current, splitting: None }) };
        let first = Part { number: 1, first_frame: 0, follows: None };
        if let Err(error) = current.follow(None, &first) {
            current.discard();
            return Err(error);
        }
        let splitting = Splitting {
            split,
            whole: match target {
                Target::Parts(whole, _) => whole.clone(),
                _ => whole_of(current.path()),
            },
            count: head.count(0),
            head: Arc::new(head),
            number: 1,
            is_after_frame: false,
            began_ns: current.newest_ns(),
            next: Next::Later,
            closing: None,
            closed: Vec::new(),
            failed: None,
        };
        Ok(Self { current, splitting: Some(splitting) })
    }

    /// Share of the queue that waits for the disk, 0 to 1.
    pub(super) fn queued(&self) -> f64 {
        self.current.queued()
    }

    /// Appends one packet as received. The next file may begin with a frame or a damaged packet that
    /// directly follows a frame that arrived in order; so the end of a run alone is in no file.
    ///
    /// # Errors
    /// If the disk is full or gone.
    pub(super) fn packet(
        &mut self,
        raw: &[u8],
        content: &Result<DeviceMessage<'_>, PacketError>,
    ) -> io::Result<()> {
        let Self { current, splitting } = self;
        if let Some(splitting) = splitting
            && mem::take(&mut splitting.is_after_frame)
            && matches!(content, Ok(DeviceMessage::Frame(_)) | Err(_))
        {
            splitting.go_on(current)?;
        }
        self.current.packet(raw)
    }

    /// Writes what the newest packet means. `count` has counted the packet, and `received` says whether
    /// the packet was a frame that arrived in order.
    ///
    /// # Errors
    /// If the disk is full or gone.
    pub(super) fn heard(
        &mut self,
        content: &Result<DeviceMessage<'_>, PacketError>,
        count: &FrameCount,
        received: bool,
    ) -> io::Result<()> {
        self.current.heard(content, count)?;
        if let Some(splitting) = &mut self.splitting {
            splitting.count.packet(content);
            splitting.is_after_frame = received;
        }
        Ok(())
    }

    /// Hands the received packets to the disk's queue, unless the last flush is recent.
    ///
    /// # Errors
    /// If the disk is full or gone.
    pub(super) fn flush_if_due(&mut self) -> io::Result<()> {
        self.current.flush_if_due()
    }

    /// Whether the run must be stopped, because its next file cannot be made or an earlier one could
    /// not be closed.
    pub(super) fn must_stop(&self) -> bool {
        self.splitting.as_ref().is_some_and(|splitting| {
            splitting.failed.is_some() || matches!(splitting.next, Next::Refused(_))
        })
    }

    /// Removes the file, because nothing was recorded.
    pub(super) fn discard(self) {
        if let Some(splitting) = self.splitting {
            splitting.end();
        }
        self.current.discard();
    }

    /// Closes the recording with the account of the run. `failed` is why the current file takes no more.
    /// `lacks` says what the last file of several lacks, which has these frames.
    pub(super) fn finish(
        self,
        failed: Option<io::Error>,
        account: RunAccount,
        lacks: impl Fn(&FrameCount) -> Option<String>,
    ) -> Recorded {
        let Self { current, splitting } = self;
        let (mut files, mut earlier, mut account) = (Vec::new(), None, account);
        if let Some(mut splitting) = splitting {
            // The packet with the end of the run may have been damaged.
            if let (Some(made), false) = (account.made, splitting.count.has_ended()) {
                splitting.count.end(made as u32);
            }
            account.counters = splitting.count.account().counters();
            account.missing = lacks(&splitting.count);
            (files, earlier) = splitting.end();
            if let Some((path, error)) = &earlier {
                let problem = format!("{} could not be recorded: {error}", name_of(path));
                let missing = [Some(problem), account.missing.take()];
                account.missing =
                    Some(missing.into_iter().flatten().collect::<Vec<_>>().join("; "));
            }
        }
        let finished = match failed {
            None => current.finish(&account),
            Some(error) => Err((current.path().to_owned(), error)),
        };
        let (path, failed) = match finished {
            Ok(path) => (path, None),
            Err((path, error)) => (path.clone(), Some((path, error))),
        };
        files.push(path);
        Recorded { files, failed: earlier.or(failed) }
    }
}

impl Splitting {
    /// Goes on in the next file if that is due and the file is ready.
    fn go_on(&mut self, current: &mut Recorder) -> io::Result<()> {
        match mem::replace(&mut self.next, Next::Later) {
            Next::Later if self.is_due(current) => {
                let head = Arc::clone(&self.head);
                let target = Target::New(part_path(&self.whole, self.number + 1));
                let make = move || head.create(&target);
                self.next = match thread::Builder::new().name("next file".to_owned()).spawn(make) {
                    Ok(making) => Next::Making(making),
                    Err(error) => Next::Refused(error),
                };
            }
            // The last file must be on the disk, so that a slow disk has two queues at most.
            Next::Making(making) if making.is_finished() && self.has_closed() => {
                match made(making) {
                    Ok(next) => return self.change(current, next),
                    Err(error) => self.next = Next::Refused(error),
                }
            }
            next => self.next = next,
        }
        Ok(())
    }

    fn is_due(&self, current: &Recorder) -> bool {
        let age = Duration::from_nanos(current.newest_ns().saturating_sub(self.began_ns));
        self.split.is_due(current.size(), age)
    }

    /// Whether the file before the current one is closed.
    fn has_closed(&mut self) -> bool {
        if self.closing.as_ref().is_some_and(|closing| !closing.is_finished()) {
            return false;
        }
        self.closed();
        true
    }

    /// Waits until the file before the current one is closed.
    fn closed(&mut self) {
        let Some(closing) = self.closing.take() else { return };
        let closed = closing.join().unwrap_or_else(|_| {
            let path = part_path(&self.whole, self.number - 1);
            Err((path, io::Error::other("closing the file panicked")))
        });
        let path = match closed {
            Ok(path) => path,
            Err((path, error)) => {
                self.failed.get_or_insert((path.clone(), error));
                path
            }
        };
        self.closed.push(path);
    }

    /// Goes on in `next`, and closes the current file.
    fn change(&mut self, current: &mut Recorder, mut next: Recorder) -> io::Result<()> {
        let first_frame = self.count.account().accounted();
        let number = self.number + 1;
        let place = Part { number, first_frame, follows: Some(name_of(current.path())) };
        if let Err(error) = next.follow(Some(current), &place) {
            next.discard();
            return Err(error);
        }
        let account = RunAccount {
            counters: self.count.account().counters(),
            asked: None,
            made: None,
            missing: lacking(None, &self.count),
            continues: Some(name_of(next.path())),
        };
        let last = mem::replace(current, next);
        self.closing = Some(thread::spawn(move || last.finish(&account)));
        self.count = self.head.count(first_frame);
        (self.number, self.began_ns) = (number, current.newest_ns());
        Ok(())
    }

    /// The files before the current one, and the first file that could not be made or closed. A next
    /// file that was made too early is removed.
    fn end(mut self) -> (Vec<PathBuf>, Option<Failed>) {
        self.closed();
        let refused = match mem::replace(&mut self.next, Next::Later) {
            Next::Later => None,
            Next::Refused(error) => Some(error),
            Next::Making(making) => {
                // Nothing is lost with a file that is not needed any more.
                if let Ok(next) = made(making) {
                    next.discard();
                }
                None
            }
        };
        let next = || part_path(&self.whole, self.number + 1);
        (self.closed, self.failed.or_else(|| refused.map(|error| (next(), error))))
    }
}

/// The recorder that a thread has made.
fn made(making: JoinHandle<io::Result<Recorder>>) -> io::Result<Recorder> {
    making.join().unwrap_or_else(|_| Err(io::Error::other("making the file panicked")))
}

/// `capture-7.mcap` of `capture-7-0001.mcap`.
fn whole_of(first: &Path) -> PathBuf {
    first.with_file_name(name_of(first).replacen("-0001.", ".", 1))
}
