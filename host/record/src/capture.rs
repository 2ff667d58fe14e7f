//! A capture: greet, calibrate, configure, start, and account for every frame until the run ends.
//!
//! # Invariant
//! Whatever ends a capture (its length, the user, the camera, the link), the received frames are
//! kept and the counters report the missing ones.
//!
//! A capture is whole if the camera reports that it made the requested frames, all frames arrived
//! whole and in order, no other packet was damaged, and no fault is latched afterwards.
//! [`Capture::missing`] reports anything else
//! (`missing::tests::a_capture_is_whole_only_if_nothing_is_missing`). The frames that a camera
//! delivers limit what this program writes (`junk::tests`).

#[cfg(not(target_family = "wasm"))]
mod feed;
mod files;
mod flat_field;
mod frames_due;
mod junk;
mod missing;
mod policy;
mod preview;
mod report;
mod run;
mod seconds;

#[cfg(not(target_family = "wasm"))]
pub use feed::{FeedProgress, FeedReport, record_feed};
pub use flat_field::{FlatFieldError, measure_dark, measure_flat_field};
pub use policy::{CalibrationPolicy, Choice, Origin, PolicyError};
pub use preview::Preview;
pub use report::CaptureReport;
pub use run::Run;
pub use seconds::{Seconds, SecondsError};

use crate::recording::Target;
use nirspi_camera::account::{FailedChecks, LossCounters};
use nirspi_camera::calibration::CalibrationError;
use nirspi_camera::integrate::Integrated;
use nirspi_camera::response::Settling;
use nirspi_camera::session::{Session, SessionError};
use nirspi_camera::setup::MeasurementSetup;
use nirspi_files::clock::Instant;
use nirspi_files::identity::CameraIdentity;
use nirspi_files::interrupt::Signal;
use nirspi_files::provenance::Made;
use nirspi_wire::{DeviceMessage, Fault, Frame, Status};
use std::io;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Duration;
use thiserror::Error;

/// Options of a capture.
#[derive(Debug, Clone)]
pub struct CaptureOptions {
    /// The measurement. If there is a calibration, its latency replaces the latency of the setup. A
    /// replayed camera uses the setup and settling of its recording instead.
    pub setup: MeasurementSetup,
    /// Frames to make; `None` means until stopped, and for a replay until the recorded run ends.
    pub frames: Option<u32>,
    /// The source of latency and settling.
    pub calibration: Calibration,
    /// The recording of the capture, if there is one.
    pub record: Option<Record>,
}

/// A recording to make.
#[derive(Debug, Clone)]
pub struct Record {
    /// Where it is written.
    pub target: Target,
    /// The program that writes it.
    pub made: Made,
}

/// The source of a capture's latency and settling.
#[derive(Debug, Clone, PartialEq)]
pub enum Calibration {
    /// The setup's latency is right, and the leak is unknown.
    None,
    /// Measured first. A burst that does not show them ends the capture.
    Measure,
    /// Measured before.
    Kept(Settling),
    /// Measured first. If the burst is too dim, the values measured before are used.
    MeasureOr(Settling),
}

/// The progress of a capture.
#[derive(Debug, Clone, Copy, Default)]
pub struct Progress {
    /// The current counters.
    pub counters: LossCounters,
    /// Time since the start of the run.
    pub elapsed: Duration,
    /// Time of the session in which this thread waited for the link. In the rest of the time the
    /// thread was busy. `None` during calibration.
    pub waited: Option<Duration>,
    /// The camera's time of the newest frame.
    pub device_time_us: u64,
    /// The checks that damaged packets of any kind failed.
    pub failed_checks: FailedChecks,
    /// Share of the recording's queue that waits for the disk, 0 to 1; 0 without a recording.
    pub queued: f64,
}

/// Why a capture is stopped before its camera ends it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopCause {
    /// The user wishes so.
    User,
    /// The time that was asked for is over.
    TimeOver,
    /// A signal that is not the user's wish: the terminal has gone, or the system ends the program.
    Signal(Signal),
}

impl StopCause {
    /// Why this program was asked to stop by a person or the system.
    #[must_use]
    pub fn of_program() -> Self {
        match nirspi_files::interrupt::first() {
            Some(signal) if !signal.is_wish() => Self::Signal(signal),
            _ => Self::User,
        }
    }
}

/// What ended a capture.
#[derive(Debug)]
pub enum Ended {
    /// The camera reports that all requested frames were made, and that no fault is latched.
    Complete,
    /// The capture was stopped.
    Stopped(StopCause),
    /// The camera switched its LEDs off.
    Fault(Fault),
    /// The camera ended the run by itself with another number of frames than requested.
    WrongNumber {
        /// Frames made.
        made: u64,
        /// Frames requested; `None` for a run that goes on until stopped.
        asked: Option<u32>,
    },
    /// The run ended, but the camera did not report afterwards whether a fault is latched.
    Unconfirmed(SessionError),
    /// Most of the received bytes were damaged or not of this run. The run was stopped.
    Junk {
        /// Number of these bytes.
        bytes: u64,
    },
    /// The camera said that it measured, and sent no frame. The run was stopped.
    NoFrames {
        /// How long it sent none.
        waited: Duration,
    },
    /// The camera disconnected or fell silent. How many frames it made after the last received
    /// frame is unknown.
    LinkLost(SessionError),
}

impl Ended {
    /// What ended the capture, in a few words.
    #[must_use]
    pub fn in_words(&self) -> &'static str {
        match self {
            Self::Complete => "all frames made",
            Self::Stopped(StopCause::User) => "stopped by the user",
            Self::Stopped(StopCause::TimeOver) => "all seconds over",
            Self::Stopped(StopCause::Signal(_)) => "ended by a signal",
            Self::Fault(_) => "the camera switched its LEDs off",
            Self::WrongNumber { .. } => "the camera made another number of frames",
            Self::Unconfirmed(_) => "the camera did not say whether a fault is latched",
            Self::Junk { .. } => "most of the bytes were damaged or of other runs",
            Self::NoFrames { .. } => "the camera sent no frames",
            Self::LinkLost(_) => "the link to the camera was lost",
        }
    }
}

/// The result of a capture.
#[derive(Debug)]
pub struct Capture {
    /// The camera.
    pub camera: CameraIdentity,
    /// The setup of the measurement.
    pub setup: MeasurementSetup,
    /// LED and amplifier response used for leak correction; `None` with [`Calibration::None`].
    pub settling: Option<Settling>,
    /// Why [`Calibration::MeasureOr`] used the response measured before.
    pub calibration_problem: Option<CalibrationError>,
    /// The sum of all frames received.
    pub integrated: Integrated,
    /// The loss counters.
    pub counters: LossCounters,
    /// The checks that damaged packets of any kind failed.
    pub failed_checks: FailedChecks,
    /// Number of intact messages that this program does not know and skipped.
    pub unknown_packets: u64,
    /// Number of frames that arrived twice.
    pub repeated: u64,
    /// The camera's status at the end.
    pub status: Option<Status>,
    /// Frames requested; `None` for a run that goes on until stopped.
    pub asked: Option<u32>,
    /// Frames that the camera reports to have made; `None` if the camera could not report.
    pub made: Option<u64>,
    /// The recording, if there is one: the first file of several. An incomplete recording that should
    /// replace another file has a different name than requested.
    pub recording: Option<PathBuf>,
    /// The files of the recording in their order.
    pub files: Vec<PathBuf>,
    /// What ended the capture.
    pub ended: Ended,
    /// Time from start to end of the run.
    pub elapsed: Duration,
}

/// Why a capture has no result.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CaptureError {
    /// The camera did not answer or refused to measure.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Latency and settling could not be measured, and are not known from before.
    #[error(
        "the camera's ADC latency is not known (hold a white sheet before the camera and run nirspi camera calibrate once, or name \
         a latency that you know with --no-calibration --adc-latency N)"
    )]
    Calibration(#[source] CalibrationError),
    /// The capture was stopped before the run began.
    #[error("stopped before the first frame")]
    Stopped,
    /// The recording cannot be started.
    #[error("{path}: cannot record")]
    Recording {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The recording cannot be continued, because the disk is full or gone.
    #[error(
        "{path}: cannot record any more, {held} of the {} frames received are whole on the disk and kept",
        .captured.counters.received
    )]
    RecordingCut {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
        /// Number of frames in the files of the run, counted by reading them again.
        held: u64,
        /// The run. Its last frames are not in the file.
        captured: Box<Capture>,
    },
}

impl From<CalibrationError> for CaptureError {
    fn from(error: CalibrationError) -> Self {
        match error {
            CalibrationError::Session(error) => Self::Session(error),
            CalibrationError::Stopped => Self::Stopped,
            error => Self::Calibration(error),
        }
    }
}

/// Observes a running capture. The thread that drains the link calls the observer, so the observer
/// must be quick.
pub trait Observer {
    /// The camera has accepted this setup, and frames come next. `problem` is the reason for using
    /// the response measured before.
    fn begins(
        &mut self,
        _setup: &MeasurementSetup,
        _settling: Option<&Settling>,
        _problem: Option<&CalibrationError>,
    ) {
    }

    /// The last bytes of the next frames and messages came out of the link at this moment.
    fn arrived(&mut self, _at: Instant) {}

    /// A frame was received, in order. `counters` already count the frame, and the recording has the
    /// frame if there is a recording.
    fn frame(&mut self, _frame: &Frame<'_>, _counters: &LossCounters) {}

    /// Another intact message was received.
    fn message(&mut self, _message: &DeviceMessage<'_>) {}

    /// Reports the progress, which is 0 during calibration. Called at least ten times a second; a
    /// break stops the capture, for this cause.
    fn watch(&mut self, progress: &Progress) -> ControlFlow<StopCause>;
}

/// An observer that only watches the progress.
struct Watching<'w>(&'w mut dyn FnMut(&Progress) -> ControlFlow<StopCause>);

impl Observer for Watching<'_> {
    fn watch(&mut self, progress: &Progress) -> ControlFlow<StopCause> {
        (self.0)(progress)
    }
}

/// Runs one capture. `watch` is called at least ten times a second and breaks to stop.
///
/// # Errors
/// [`CaptureError`] if nothing was captured. A run that started always gives a [`Capture`], unless
/// its recording failed.
pub fn capture(
    session: &mut Session,
    options: &CaptureOptions,
    watch: &mut dyn FnMut(&Progress) -> ControlFlow<StopCause>,
) -> Result<Capture, CaptureError> {
    observe(session, options, &mut Watching(watch))
}

/// Runs one capture with an observer of every frame.
///
/// # Errors
/// As [`capture`].
pub fn observe(
    session: &mut Session,
    options: &CaptureOptions,
    observer: &mut dyn Observer,
) -> Result<Capture, CaptureError> {
    let mut run = Run::begin(session, options, observer)?;
    while run.turn(session, observer) {}
    run.end(session, observer)
}
