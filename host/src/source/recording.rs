//! Reads the frames of a recording as measurements: their sum, or each of them.

use super::several::fits_together;
use super::{NOT_CALIBRATED, Source, SourceError, SourceOptions, not_whole};
use crate::calibration::KeptFlatField;
use crate::causes;
use crate::files::FileError;
use crate::integrate::{Integrated, KnownOfRun};
use crate::moving::followed;
use crate::provenance::Taken;
use crate::recording::{End, Recording, RecordingError, hear_recording, tally_recording};
use crate::setup::MeasurementSetup;
use crate::tally::Tally;
use nirspi_camera::integrate::NEWEST;
use nirspi_recon::Measurements;
use nirspi_wire::Frame;
use rayon::prelude::*;
use std::collections::VecDeque;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread;

/// Sums the frames of a recording, and makes their account again.
pub(super) fn from_recording(path: &Path, options: &SourceOptions) -> Result<Source, SourceError> {
    let mut recording = Recording::open(path)?;
    let tally = tally_recording(&mut recording)?;
    of_sum(path, options, &recording, &tally)
}

/// The measurements of the sum of all frames.
fn of_sum(
    path: &Path,
    options: &SourceOptions,
    recording: &Recording,
    tally: &Tally,
) -> Result<Source, SourceError> {
    match tally.integrated() {
        integrated if integrated.frames() > 0 => {
            let flat_field = flat_field(options, recording);
            let integrated = integrated.clone().of_run(&tally.known());
            of_frames(path, options, recording, &integrated, tally, &flat_field)
        }
        _ => Err(no_frame(path, tally)),
    }
}

/// Why a recording has no valid frame.
fn no_frame(path: &Path, tally: &Tally) -> SourceError {
    let path = path.to_owned();
    match tally.misfit() {
        Some(misfit) => SourceError::Misfit { path, misfit },
        None => SourceError::NoFrame(path),
    }
}

/// The frames of a recording, after a first reading that counted them.
pub struct Frames<'a> {
    path: &'a Path,
    options: &'a SourceOptions,
    /// As the first reading has left it.
    recording: Recording,
    tally: Tally,
    count: usize,
    flat_field: FlatFieldRead,
}

/// Neighbouring frames that were added, or one of them alone. What their readings differ by is known of the whole run.
pub(crate) struct Added {
    sum: Integrated,
    /// The newest of several frames of a scene that changes, each alone, with their numbers.
    newest: VecDeque<(u64, Arc<Integrated>)>,
    /// The last frame.
    pub last: Stamp,
}

/// The number of a frame in a recording and its times.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stamp {
    /// Among those that the camera has made.
    pub sequence: i64,
    /// Of the camera's clock.
    pub device_time_us: u64,
    /// Of the computer's clock, when it arrived.
    pub time_ns: u64,
}

/// Whether a frame begins a new sum, instead of being added to those before.
type Begins = Box<dyn FnMut(Stamp) -> bool + Send>;

impl<'a> Frames<'a> {
    /// Reads the recording once: what its frames tell of each other, and how many there are.
    pub(crate) fn open(path: &'a Path, options: &'a SourceOptions) -> Result<Self, SourceError> {
        let mut recording = Recording::open(path)?;
        let tally = tally_recording(&mut recording)?;
        let count = tally.integrated().frames() as usize;
        if count == 0 {
            return Err(no_frame(path, &tally));
        }
        let flat_field = flat_field(options, &recording);
        Ok(Self { path, options, recording, tally, count, flat_field })
    }

    /// Number of frames.
    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// Refuses more frames than the memory holds at a time.
    pub(super) fn fit_together(&self) -> Result<(), SourceError> {
        let rows = &self.recording.setup.rows;
        fits_together(self.path, self.count, rows.len(), rows.side())
    }

    /// The measurements of the sum of all frames.
    pub(crate) fn together(&self) -> Result<Source, SourceError> {
        of_sum(self.path, self.options, &self.recording, &self.tally)
    }

    /// Begins to read the frames one by one, `most` at a time, in a thread of its own.
    pub(crate) fn read(&self, most: usize) -> Result<Reading, SourceError> {
        self.read_added(most, Box::new(|_| true))
    }

    /// Begins to read sums of neighbouring frames, `most` of them at a time, in a thread of its own.
    pub(crate) fn read_added(
        &self,
        most: usize,
        mut begins: Begins,
    ) -> Result<Reading, SourceError> {
        let mut recording = Recording::open(self.path)?;
        let (path, setup, count) = (self.path.to_owned(), self.recording.setup.clone(), self.count);
        if recording.setup != setup {
            return Err(SourceError::Changed(path));
        }
        let changes = self.tally.known().changed.is_some();
        // One batch is on its way while the one before is worked on.
        let (to, from) = sync_channel(0);
        let read = move || {
            let (mut batch, mut seen) = (Vec::new(), 0);
            let heard = hear_recording(&mut recording, |heard, count| {
                let Some(frame) = heard.frame() else { return Ok(()) };
                let stamp = Stamp {
                    sequence: count.account().accounted() as i64 - 1,
                    device_time_us: frame.device_time_us,
                    time_ns: heard.time_ns,
                };
                seen += 1;
                let is_new = begins(stamp);
                match batch.last_mut() {
                    Some(added) if !is_new => Added::add(added, &setup, frame, stamp, changes),
                    _ => {
                        if batch.len() == most {
                            to.send(Ok(std::mem::take(&mut batch)))
                                .map_err(|_| Ended::NotWanted)?;
                        }
                        batch.push(Added::of(&setup, frame, stamp));
                    }
                }
                Ok(())
            });
            let last = match heard {
                Ok(_) if seen == count => Ok(batch),
                Ok(_) => Err(SourceError::Changed(path)),
                Err(Ended::Recording(problem)) => Err(problem.into()),
                Err(Ended::NotWanted) => return,
            };
            // A reader that has stopped needs no last batch.
            let _ = to.send(last);
        };
        thread::Builder::new()
            .name("frames".to_owned())
            .spawn(read)
            .map_err(|error| FileError::io(self.path, "read", error))?;
        Ok(Reading { from })
    }

    /// The measurements of frames that were read, and what is known of them.
    pub(crate) fn sources(&self, frames: Vec<Added>) -> Vec<Result<Source, SourceError>> {
        let (known, Self { path, options, recording, tally, flat_field, .. }) =
            (self.tally.known(), self);
        let source = |frame: Added| {
            let frame = frame.of_run(&known);
            of_frames(path, options, recording, &frame, tally, flat_field)
        };
        frames.into_par_iter().map(source).collect()
    }

    /// The readings of frames that were read: all, as they are.
    pub(crate) fn measurements(
        &self,
        frames: Vec<Added>,
    ) -> Result<Vec<Measurements>, SourceError> {
        let (known, Recording { setup, settling, .. }) = (self.tally.known(), &self.recording);
        let measured = |frame: Added| {
            let frame = frame.of_run(&known);
            frame.measurements(setup, settling.as_ref(), self.options.keep_leak)
        };
        let all: Result<_, _> = frames.into_par_iter().map(measured).collect();
        all.map_err(|problem| SourceError::Integrate { path: self.path.to_owned(), problem })
    }
}

impl Added {
    fn of(setup: &MeasurementSetup, frame: &Frame<'_>, last: Stamp) -> Self {
        let mut sum = Integrated::new(setup);
        sum.add_alone(frame);
        Self { sum, newest: VecDeque::new(), last }
    }

    /// Adds a frame; where the scene `changes`, also keeps it alone for a while.
    fn add(&mut self, setup: &MeasurementSetup, frame: &Frame<'_>, at: Stamp, changes: bool) {
        let Self { sum, newest, last } = self;
        if changes {
            if newest.is_empty() {
                newest.push_back((last.sequence as u64, Arc::new(sum.clone())));
            }
            if newest.len() == NEWEST {
                newest.pop_front();
            }
            newest.push_back((at.sequence as u64, Arc::new(Integrated::of_frame(setup, frame))));
        }
        sum.add_alone(frame);
        *last = at;
    }

    /// The sum, with what all frames tell of it.
    fn of_run(self, known: &KnownOfRun) -> Integrated {
        let mut known = known.clone();
        known.newest = self.newest.into();
        self.sum.of_run(&known)
    }
}

/// Frames that another thread reads.
pub(crate) struct Reading {
    from: Receiver<Result<Vec<Added>, SourceError>>,
}

impl Reading {
    /// The next frames, at least one; `None` at the end.
    pub(crate) fn next(&self) -> Option<Result<Vec<Added>, SourceError>> {
        self.from.recv().ok().filter(|batch| !matches!(batch, Ok(batch) if batch.is_empty()))
    }
}

/// Why a recording is not read any further.
enum Ended {
    Recording(RecordingError),
    NotWanted,
}

impl From<RecordingError> for Ended {
    fn from(problem: RecordingError) -> Self {
        Self::Recording(problem)
    }
}

/// The flat field that is kept for the camera, or why it cannot be read; `None` if none is wanted.
type FlatFieldRead = Option<Result<Option<KeptFlatField>, String>>;

fn flat_field(options: &SourceOptions, recording: &Recording) -> FlatFieldRead {
    let read = || KeptFlatField::of(&recording.identity).map_err(|e| causes::in_one_line(&e));
    (!options.no_flat_field).then(read)
}

/// The measurements of the sum of some frames.
fn of_frames(
    path: &Path,
    options: &SourceOptions,
    recording: &Recording,
    integrated: &Integrated,
    tally: &Tally,
    flat_field: &FlatFieldRead,
) -> Result<Source, SourceError> {
    let counters = tally.account().counters();
    let Recording { setup, settling, .. } = recording;
    let End { cut_short, account, .. } = recording.end();
    let (measurements, mut notes) =
        followed(integrated, setup, settling.as_ref(), options.keep_leak)
            .map_err(|problem| SourceError::Integrate { path: path.to_owned(), problem })?;
    let mut lacks = Vec::new();
    lacks.extend(cut_short.as_ref().map(|reason| format!("cut short or damaged: {reason}")));
    if let Some(account) = account {
        if account.counters != counters {
            lacks.push(format!("the capture had {}", account.counters));
        }
        lacks.extend(account.missing.clone());
    }
    lacks.extend(tally.misfit().map(|misfit| format!("some frames are left out: {misfit}")));
    if settling.is_none() {
        notes.push(NOT_CALIBRATED.to_owned());
    }
    let read = super::of_frames(measurements)
        .map_err(|problem| SourceError::Measurements { path: path.to_owned(), problem })?;
    let (dropouts, not_read, frames) = (Vec::new(), Vec::new(), Some(counters));
    let (imaginary, reference) = (None, None);
    let source = Source {
        measurements: read.measurements,
        imaginary,
        dropouts,
        outliers: read.outliers,
        not_read,
        reference,
        frames,
        taken: Taken::by(&recording.identity).from_file(path),
        damage: (!lacks.is_empty()).then(|| not_whole(counters, &lacks)),
        warnings: read.doubts.iter().map(ToString::to_string).collect(),
        notes,
        lamp: None,
        flat_field: None,
    };
    Ok(match flat_field {
        None | Some(Ok(None)) => source,
        Some(Ok(Some(kept))) => source.with_flat_field(kept.clone()),
        Some(Err(problem)) => {
            let mut source = source;
            source.notes.push(format!("flat field not used: {problem}"));
            source
        }
    })
}
