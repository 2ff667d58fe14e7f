//! Recordings that were made side by side, in the common time of their computer.
//!
//! Each recording is read once for its clock and, for the table, once more for its frames, so
//! memory does not grow with the length.

use super::clock::MOST_DRIFT;
use super::{Clock, Fit, Heard, WINDOW_US};
use crate::account::LossCounters;
use crate::files::FileError;
use crate::files::output::write_in_pieces;
use crate::recording::{Recording, RecordingError};
use crate::tally::Tally;
use nirspi_recon::words::count;
use nirspi_wire::{DeviceMessage, Frame, open};
use serde::Serialize;
use std::fmt;
use std::io::Write;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The columns of the table.
const COLUMNS: &str =
    "time_ns,recording,serial,run,sequence,device_time_us,arrival_ns,uncertainty_us";

/// What recordings say of their cameras' clocks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Synced {
    /// The recordings, in the order in which they were named.
    pub cameras: Vec<CameraClock>,
    /// Each recording but the first beside the first.
    pub pairs: Vec<Pair>,
    /// Time in which all recordings have frames; 0 if their times do not overlap.
    pub common_s: f64,
    /// The table.
    pub out: Option<PathBuf>,
    /// Rows of the table.
    pub rows: u64,
    /// What to know before the times are used.
    pub notes: Vec<String>,
}

/// The clock of one recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CameraClock {
    /// The recording.
    pub recording: PathBuf,
    /// Serial number of the camera.
    pub serial: String,
    /// The account of the frames.
    pub frames: LossCounters,
    /// The host's time of the first frame in ns since 1970.
    pub first_ns: u64,
    /// The host's time of the last frame in ns since 1970.
    pub last_ns: u64,
    /// The newest fit. A recording that is longer than its window has earlier ones, too.
    #[serde(flatten)]
    pub clock: Fit,
}

/// The clock of a camera beside that of the first camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pair {
    /// Number of the recording, from 1.
    pub recording: usize,
    /// Reading of the camera's clock less that of the first camera's clock at the same moment, the
    /// first at which both measured, in microseconds.
    pub offset_us: f64,
    /// Uncertainty of the offset; `None` if one of the recordings is too short.
    pub offset_uncertainty_us: Option<f64>,
    /// By how much the camera's clock gains on the first camera's, in millionths.
    pub drift_ppm: Option<f64>,
    /// Uncertainty of the drift.
    pub drift_uncertainty_ppm: Option<f64>,
}

/// Why recordings have no common time.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SyncError {
    /// A recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The table cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A recording has no frames.
    #[error("{}: no frame in the recording, expected frames of a run", .0.display())]
    NoFrame(PathBuf),
    /// One recording was named twice.
    #[error("{}: named twice, expected recordings of different cameras", .0.display())]
    Twice(PathBuf),
    /// The table would replace a recording.
    #[error("{}: the table to write is one of the recordings, expected another name", .0.display())]
    Itself(PathBuf),
    /// The table has an ending of another form.
    #[error("{}: the table is text with commas, expected a name that ends in .csv", .0.display())]
    Ending(PathBuf),
    /// A camera did not run in real time.
    #[error(
        "{}: the camera's clock ran at {ratio:.3} times the computer's, expected 1: a virtual camera keeps time with \
         nirspi virtual --real-time, a replay without another speed",
        .path.display()
    )]
    NotRealTime {
        /// The recording.
        path: PathBuf,
        /// Seconds of the camera's clock in a second of the host's.
        ratio: f64,
    },
}

/// Fits the clocks of these recordings and, with `out`, writes a table of all their frames in the
/// order of common time: text with commas, one frame a row.
///
/// | column | content |
/// | -- | -- |
/// | `time_ns` | the host's time of the frame's first pattern, ns since 1970, UTC |
/// | `recording` | number of the recording as named, from 1 |
/// | `serial`, `run`, `sequence` | the camera, the run, and the frame in the run |
/// | `device_time_us` | the frame's first pattern by the camera's clock, wraps of 32 bits undone |
/// | `arrival_ns` | arrival by the host's clock |
/// | `uncertainty_us` | of `time_ns`, without the link's shortest delay; empty if unknown |
///
/// # Errors
/// [`SyncError`]. No table is then written.
pub fn recordings(paths: &[PathBuf], out: Option<&Path>) -> Result<Synced, SyncError> {
    check_names(paths, out)?;
    let courses: Vec<Course> =
        paths.iter().map(|path| Course::of(path)).collect::<Result<_, _>>()?;
    let mut rows = 0;
    if let Some(out) = out {
        write_in_pieces(out, |file| -> Result<(), SyncError> {
            rows = table(file, &courses, |error| FileError::io(out, "write", error).into())?;
            Ok(())
        })?;
    }
    let latest = courses.iter().map(|course| course.camera.first_ns).max().unwrap_or(0);
    let earliest = courses.iter().map(|course| course.camera.last_ns).min().unwrap_or(0);
    let pair = |(at, course): (usize, &Course)| course.beside(&courses[0], at + 1, latest);
    Ok(Synced {
        pairs: courses.iter().enumerate().skip(1).map(pair).collect(),
        common_s: earliest.saturating_sub(latest) as f64 * 1e-9,
        out: out.map(Path::to_owned),
        rows,
        notes: notes(&courses, latest > earliest),
        cameras: courses.into_iter().map(|course| course.camera).collect(),
    })
}

fn check_names(paths: &[PathBuf], out: Option<&Path>) -> Result<(), SyncError> {
    let whole = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let named: Vec<PathBuf> = paths.iter().map(|path| whole(path)).collect();
    if let Some(twice) = (1..named.len()).find(|&at| named[..at].contains(&named[at])) {
        return Err(SyncError::Twice(paths[twice].clone()));
    }
    match out {
        Some(out) if named.contains(&whole(out)) => Err(SyncError::Itself(out.to_owned())),
        Some(out) if out.extension().is_none_or(|ending| ending != "csv") => {
            Err(SyncError::Ending(out.to_owned()))
        }
        _ => Ok(()),
    }
}

fn notes(courses: &[Course], apart: bool) -> Vec<String> {
    let mut notes = Vec::new();
    if apart {
        notes.push("the recordings have no time in common".to_owned());
    }
    for Course { camera, .. } in courses {
        if camera.clock.drift_ppm.is_none() {
            let name = camera.recording.display();
            notes.push(format!(
                "{name}: too short for the drift of its clock, which is taken as 0; record for some seconds"
            ));
        }
    }
    notes
}

/// The frames of a recording that count.
struct Frames {
    recording: Recording,
    tally: Tally,
    scratch: Vec<u8>,
}

/// What the table says of a frame.
#[derive(Debug, Clone, Copy)]
struct Stamp {
    run: u16,
    sequence: u64,
    device_time_us: u64,
    arrival_ns: u64,
}

impl Frames {
    fn open(path: &Path) -> Result<Self, RecordingError> {
        let recording = Recording::open(path)?;
        let tally = Tally::new(&recording.setup, recording.run)
            .with_detectors(recording.identity.detectors);
        Ok(Self { recording, tally, scratch: Vec::new() })
    }

    fn next(&mut self) -> Result<Option<Stamp>, RecordingError> {
        while let Some(packet) = self.recording.next().transpose()? {
            self.scratch.clear();
            self.scratch
                .extend_from_slice(packet.bytes.strip_suffix(&[0]).unwrap_or(&packet.bytes));
            let content = open(&mut self.scratch);
            if !self.tally.packet(&content) {
                continue;
            }
            if let Ok(DeviceMessage::Frame(Frame { run, device_time_us, .. })) = content {
                // The account has counted the frame.
                let sequence = self.tally.account().accounted().saturating_sub(1);
                let arrival_ns = packet.time_ns;
                return Ok(Some(Stamp { run, sequence, device_time_us, arrival_ns }));
            }
        }
        Ok(None)
    }
}

/// The fits of a recording in the course of its time.
struct Course {
    camera: CameraClock,
    frame_ns: f64,
    /// Their middles are half a window apart or more.
    fits: Vec<Fit>,
}

impl Course {
    fn of(path: &Path) -> Result<Self, SyncError> {
        let mut frames = Frames::open(path)?;
        let frame_ns = frames.recording.setup.frame_ns();
        let (mut clock, mut fits) = (Clock::new(frame_ns), Vec::new());
        let mut ends: Option<[u64; 2]> = None;
        let mut due_us = 0;
        while let Some(stamp) = frames.next()? {
            clock.arrived(stamp.run, stamp.device_time_us, stamp.arrival_ns);
            let at = clock.device_time_us(stamp.device_time_us);
            let [first, _] = *ends.get_or_insert_with(|| {
                due_us = at.saturating_add(WINDOW_US);
                [at; 2]
            });
            ends = Some([first, at]);
            if at >= due_us {
                due_us = at.saturating_add(WINDOW_US / 2);
                fits.extend(clock.fit());
            }
        }
        let (Some(newest), Some([first, last])) = (clock.fit(), ends) else {
            return Err(SyncError::NoFrame(path.to_owned()));
        };
        // Not because of delays: those of a clock that follows are within the uncertainty.
        if let Some((slope, turn)) = newest.found
            && slope.abs() - turn > MOST_DRIFT
        {
            let ratio = 1.0 / (1.0 + slope);
            return Err(SyncError::NotRealTime { path: path.to_owned(), ratio });
        }
        fits.push(newest);
        let mut course = Self {
            camera: CameraClock {
                recording: path.to_owned(),
                serial: frames.recording.identity.serial.clone(),
                frames: frames.tally.account().counters(),
                first_ns: 0,
                last_ns: 0,
                clock: newest,
            },
            frame_ns,
            fits,
        };
        course.camera.first_ns = course.host_ns(first).0;
        course.camera.last_ns = course.host_ns(last).0;
        Ok(course)
    }

    /// The host's time of a device time, and its uncertainty: between the middles of two fits, both
    /// by their distance.
    fn host_ns(&self, device_time_us: u64) -> (u64, Option<f64>) {
        let after = self.fits.partition_point(|fit| fit.device_time_us <= device_time_us);
        let one = |fit: &Fit| (fit.host_ns(device_time_us), fit.uncertainty_us(device_time_us));
        match (after.checked_sub(1).and_then(|before| self.fits.get(before)), self.fits.get(after))
        {
            (Some(before), Some(after)) => {
                let (from, to) = (before.device_time_us, after.device_time_us);
                let share = (device_time_us - from) as f64 / (to - from).max(1) as f64;
                let ((a, a_us), (b, b_us)) = (one(before), one(after));
                let step = (i128::from(b) - i128::from(a)) as f64 * share;
                let time = u64::try_from(i128::from(a) + step.round() as i128).unwrap_or(a);
                (time, a_us.zip(b_us).map(|(a, b)| a.max(b)))
            }
            (Some(fit), None) | (None, Some(fit)) => one(fit),
            (None, None) => (0, None),
        }
    }

    /// The camera's reading at this moment of the host's clock, by the newest fit, in microseconds.
    fn reading_us(&self, host_ns: u64) -> f64 {
        let fit = &self.camera.clock;
        let ahead_us = (i128::from(host_ns) - i128::from(fit.host_ns)) as f64 * 1e-3;
        fit.device_time_us as f64 + ahead_us * (1.0 + fit.drift_ppm.unwrap_or(0.0) * 1e-6)
    }

    fn beside(&self, first: &Self, recording: usize, at_ns: u64) -> Pair {
        let (own, other) = (&self.camera.clock, &first.camera.clock);
        let sum = |a: Option<f64>, b: Option<f64>| a.zip(b).map(|(a, b)| a + b);
        let at = |course: &Self| {
            course.camera.clock.uncertainty_us(course.reading_us(at_ns).max(0.0) as u64)
        };
        Pair {
            recording,
            offset_us: self.reading_us(at_ns) - first.reading_us(at_ns),
            offset_uncertainty_us: sum(at(self), at(first)),
            drift_ppm: own.drift_ppm.zip(other.drift_ppm).map(|(own, other)| own - other),
            drift_uncertainty_ppm: sum(own.drift_uncertainty_ppm, other.drift_uncertainty_ppm),
        }
    }
}

/// Writes the frames of all recordings in the order of their times. Returns their number.
fn table(
    to: &mut impl Write,
    courses: &[Course],
    io_error: impl Fn(std::io::Error) -> SyncError,
) -> Result<u64, SyncError> {
    /// A recording with its next frame in common time.
    struct Reader<'c> {
        course: &'c Course,
        frames: Frames,
        clock: Clock,
        serial: String,
        next: Option<(u64, Option<f64>, u64, Stamp)>,
    }
    impl Reader<'_> {
        fn advance(&mut self) -> Result<(), RecordingError> {
            self.next = self.frames.next()?.map(|stamp| {
                // For wraps of the device's clock alone.
                let _: Heard =
                    self.clock.arrived(stamp.run, stamp.device_time_us, stamp.arrival_ns);
                let at = self.clock.device_time_us(stamp.device_time_us);
                let (time_ns, uncertainty_us) = self.course.host_ns(at);
                (time_ns, uncertainty_us, at, stamp)
            });
            Ok(())
        }
    }
    let mut readers = Vec::new();
    for course in courses {
        let frames = Frames::open(&course.camera.recording)?;
        let clock = Clock::new(course.frame_ns);
        let serial = field(&course.camera.serial);
        let mut reader = Reader { course, frames, clock, serial, next: None };
        reader.advance()?;
        readers.push(reader);
    }
    writeln!(to, "{COLUMNS}").map_err(&io_error)?;
    let mut rows = 0;
    loop {
        let heads = readers.iter().enumerate();
        let first = heads.filter_map(|(at, reader)| Some((reader.next?.0, at))).min();
        let Some((_, at)) = first else { return Ok(rows) };
        let reader = &mut readers[at];
        let Some((time_ns, uncertainty_us, device_time_us, stamp)) = reader.next else {
            return Ok(rows);
        };
        let Stamp { run, sequence, arrival_ns, .. } = stamp;
        let uncertainty = uncertainty_us.map_or_else(String::new, |us| format!("{us:.1}"));
        let (number, serial) = (at + 1, &reader.serial);
        writeln!(
            to,
            "{time_ns},{number},{serial},{run},{sequence},{device_time_us},{arrival_ns},{uncertainty}"
        )
        .map_err(&io_error)?;
        rows += 1;
        reader.advance()?;
    }
}

/// A text as one field of a table.
fn field(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

impl fmt::Display for Synced {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for camera in &self.cameras {
            let CameraClock { recording, serial, frames, clock, .. } = camera;
            let frames = count(frames.received, "frame");
            write!(f, "{}: {serial}, {frames}, clock ", recording.display())?;
            drift(f, clock.drift_ppm, clock.drift_uncertainty_ppm)?;
            if let Some(us) = clock.uncertainty_us {
                write!(f, ", times +-{us:.0} us")?;
            }
            writeln!(f)?;
        }
        for pair in &self.pairs {
            let Pair { recording, offset_us, offset_uncertainty_us, .. } = *pair;
            write!(f, "recording {recording} beside 1: clock {:+.6} s", offset_us * 1e-6)?;
            if let Some(us) = offset_uncertainty_us {
                write!(f, " +-{us:.0} us")?;
            }
            write!(f, ", ")?;
            drift(f, pair.drift_ppm, pair.drift_uncertainty_ppm)?;
            writeln!(f)?;
        }
        write!(f, "{:.3} s in common", self.common_s)?;
        match &self.out {
            Some(out) => {
                write!(f, "; wrote the times of {} to {}", count(self.rows, "frame"), out.display())
            }
            None => Ok(()),
        }
    }
}

fn drift(f: &mut fmt::Formatter<'_>, ppm: Option<f64>, within: Option<f64>) -> fmt::Result {
    match (ppm, within) {
        (Some(ppm), Some(within)) => write!(f, "{ppm:+.1} +-{within:.1} ppm"),
        _ => write!(f, "of unknown drift"),
    }
}

#[cfg(test)]
mod tests;
