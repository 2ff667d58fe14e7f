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

mod junk;
mod missing;
#[cfg(feature = "pictures")]
mod preview;
mod report;

#[cfg(feature = "pictures")]
pub use preview::Preview;
pub use report::CaptureReport;

use crate::account::LossCounters;
use crate::calibration::{CalibrationError, Settling, calibrate, calibrate_or};
use crate::integrate::Integrated;
use crate::recording::{Recorder, Recording, RunAccount, Target};
use crate::replay::Recorded;
use crate::session::{
    ANSWER_TIMEOUT, IgnorePackets, Listener, Request, Session, SessionError, request,
};
use crate::setup::MeasurementSetup;
use crate::tally::{Tally, tally_recording};
use junk::Junk;
use nirspi_wire::{
    Answer, DeviceMessage, Event, EventKind, Fault, Frame, PacketError, Reply, RunLength, State,
    Status,
};
use std::io;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Interval of the host's messages while it only listens.
const KEEP_ALIVE: Duration = Duration::from_secs(1);
/// A camera that reports the end of a run and sends nothing for this long has stopped.
const QUIET: Duration = Duration::from_millis(500);
/// The longest time in which a stopped run must end.
const STOP_TIMEOUT: Duration = Duration::from_secs(10);

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
    /// The target of a recording.
    pub record: Option<Target>,
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
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// The current counters.
    pub counters: LossCounters,
    /// Time since the start of the run.
    pub elapsed: Duration,
}

/// What ended a capture.
#[derive(Debug)]
pub enum Ended {
    /// The camera reports that all requested frames were made, and that no fault is latched.
    Complete,
    /// The user stopped the capture.
    Stopped,
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
            Self::Stopped => "stopped by the user",
            Self::Fault(_) => "the camera switched its LEDs off",
            Self::WrongNumber { .. } => "the camera made another number of frames",
            Self::Unconfirmed(_) => "the camera did not say whether a fault is latched",
            Self::Junk { .. } => "most of the bytes were damaged or of other runs",
            Self::LinkLost(_) => "the link to the camera was lost",
        }
    }
}

/// The result of a capture.
#[derive(Debug)]
pub struct Capture {
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
    /// Number of damaged packets of any kind.
    pub damaged_packets: u64,
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
    /// The recording, if there is one. An incomplete recording that should replace another file has
    /// a different name than requested.
    pub recording: Option<PathBuf>,
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
        "the camera's ADC latency is not known (hold a white sheet before the camera and run nirspi calibrate once, or name \
         a latency that you know with --no-calibration --adc-latency N)"
    )]
    Calibration(#[source] CalibrationError),
    /// The user stopped the capture before the run began.
    #[error("stopped by the user before the first frame")]
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
        "{path}: cannot record any more, {held} of the {} frames received are whole in the file and kept",
        .counters.received
    )]
    RecordingCut {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
        /// Number of frames in the file, counted by reading the file again.
        held: u64,
        /// The account of the run. The last frames of the account are not in the file.
        counters: LossCounters,
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

    /// A frame was received, in order. `counters` already count the frame.
    fn frame(&mut self, _frame: &Frame<'_>, _counters: &LossCounters) {}

    /// Another intact message was received.
    fn message(&mut self, _message: &DeviceMessage<'_>) {}

    /// Reports the progress, which is 0 during calibration. Called at least ten times a second; a
    /// break stops the capture.
    fn watch(&mut self, progress: &Progress) -> ControlFlow<()>;
}

/// An observer that only watches the progress.
struct Watching<'w>(&'w mut dyn FnMut(&Progress) -> ControlFlow<()>);

impl Observer for Watching<'_> {
    fn watch(&mut self, progress: &Progress) -> ControlFlow<()> {
        (self.0)(progress)
    }
}

/// Watches the calibration of the camera.
struct Calibrating<'o> {
    observer: &'o mut dyn Observer,
    began: Instant,
}

impl Listener for Calibrating<'_> {
    fn packet(&mut self, _: &[u8], _: &Result<DeviceMessage<'_>, PacketError>) {}

    fn goes_on(&mut self) -> bool {
        let progress =
            Progress { counters: LossCounters::default(), elapsed: self.began.elapsed() };
        self.observer.watch(&progress).is_continue()
    }
}

/// Interprets the stream of a run.
struct RunListener<'o> {
    observer: &'o mut dyn Observer,
    number: u16,
    tally: Tally,
    recorder: Option<Recorder>,
    recorder_error: Option<io::Error>,
    fault: Option<Fault>,
    status: Option<Status>,
    junk: Junk,
    /// Time of the last intact packet.
    last_intact: Instant,
}

impl RunListener<'_> {
    /// Writes to the recording, if there is one without an earlier error.
    fn record(&mut self, write: impl FnOnce(&mut Recorder) -> io::Result<()>) {
        if let Some(recorder) = &mut self.recorder
            && self.recorder_error.is_none()
        {
            self.recorder_error = write(recorder).err();
        }
    }

    /// Whether the camera has sent more frames than requested.
    fn has_more_than(&self, asked: Option<u32>) -> bool {
        asked.is_some_and(|asked| self.tally.account().accounted() > u64::from(asked))
    }
}

impl Listener for RunListener<'_> {
    fn packet(&mut self, raw: &[u8], content: &Result<DeviceMessage<'_>, PacketError>) {
        if self.junk.is_too_much() {
            return;
        }
        let now = Instant::now();
        if content.is_ok() {
            self.last_intact = now;
        }
        self.record(|recorder| recorder.packet(raw));
        let before = self.tally.account().counters();
        let received = self.tally.packet(content);
        if let (Some(recorder), None) = (&mut self.recorder, &self.recorder_error) {
            self.recorder_error = recorder.heard(content, &self.tally).err();
        }
        let after = self.tally.account().counters();
        let frames = (after.received + after.late) - (before.received + before.late);
        self.junk.packet(raw.len(), content, frames > 0, now);
        match content {
            Ok(DeviceMessage::Frame(frame)) if received => {
                self.observer.frame(frame, &self.tally.account().counters());
            }
            Ok(message) => self.observer.message(message),
            Err(_) => {}
        }
        match content {
            Ok(DeviceMessage::Event(Event { kind: EventKind::Fault(fault), .. })) => {
                self.fault = Some(*fault);
            }
            Ok(DeviceMessage::Reply(Reply { outcome: Ok(Answer::Status(status)), .. })) => {
                self.status = Some(*status);
            }
            _ => {}
        }
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
    watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
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
    // A replayed camera has the setup and settling of its recording.
    let replayed = session.recorded().cloned();
    let mut setup = replayed.as_ref().map_or(&options.setup, |recorded| &recorded.setup).clone();
    let calibration = match &replayed {
        Some(Recorded { settling: Some(settling), .. }) => &Calibration::Kept(settling.clone()),
        Some(_) => &Calibration::None,
        None => &options.calibration,
    };
    let calibrating = &mut Calibrating { observer: &mut *observer, began: Instant::now() };
    let (settling, calibration_problem) = match calibration {
        Calibration::None => (None, None),
        Calibration::Kept(settling) => (Some(settling.clone()), None),
        Calibration::Measure => (Some(calibrate(session, calibrating)?), None),
        Calibration::MeasureOr(known) => {
            let (settling, problem) = calibrate_or(session, calibrating, known)?;
            (Some(settling), problem)
        }
    };
    if let Some(settling) = &settling {
        setup.adc_latency = settling.adc_latency;
    }
    setup.with_configuration(|c| session.command(request::Configure(c), &mut IgnorePackets))?;
    let before = session.status(&mut IgnorePackets)?;

    let number = before.run.wrapping_add(1);
    let recorder = match &options.record {
        None => None,
        Some(target) => {
            let (identity, settling) = (session.identity(), settling.as_ref());
            let made = Recorder::create(target, identity, &setup, settling, Some(number));
            let path = || target.path().to_owned();
            Some(made.map_err(|source| CaptureError::Recording { path: path(), source })?)
        }
    };
    observer.begins(&setup, settling.as_ref(), calibration_problem.as_ref());
    let now = Instant::now();
    let mut run = RunListener {
        observer,
        number,
        tally: Tally::new(&setup, Some(number)),
        recorder,
        recorder_error: None,
        fault: None,
        status: None,
        junk: Junk::new(now),
        last_intact: now,
    };
    let ended = match stream(session, options.frames, &mut run, now) {
        Ok(ended) => ended,
        Err(error) if run.tally.has_begun() => Ended::LinkLost(error),
        Err(error) => {
            // A run that never started leaves no recording.
            if let Some(recorder) = run.recorder {
                recorder.discard();
            }
            return Err(error.into());
        }
    };
    let account = run.tally.account();
    let mut captured = Capture {
        setup,
        settling,
        calibration_problem,
        integrated: run.tally.integrated().clone(),
        counters: account.counters(),
        damaged_packets: account.damaged_packets(),
        unknown_packets: run.tally.unknown_packets(),
        repeated: account.repeated(),
        status: run.status,
        asked: options.frames,
        made: run.tally.made(),
        recording: None,
        ended,
        elapsed: now.elapsed(),
    };
    if let Some(recorder) = run.recorder {
        captured.recording = Some(finish(recorder, run.recorder_error, &captured)?);
    }
    Ok(captured)
}

/// Closes the recording of a capture. Returns its path.
fn finish(
    recorder: Recorder,
    failed: Option<io::Error>,
    captured: &Capture,
) -> Result<PathBuf, CaptureError> {
    let Capture { counters, asked, made, .. } = *captured;
    let account = RunAccount { counters, asked, made, missing: captured.missing() };
    let finished = match failed {
        None => recorder.finish(&account),
        Some(error) => {
            let path = recorder.path().to_owned();
            drop(recorder);
            Err((path, error))
        }
    };
    finished.map_err(|(path, source)| {
        let held = frames_held(&path);
        CaptureError::RecordingCut { path, source, held, counters }
    })
}

/// Number of frames in a file; 0 for a device or a file that cannot be read.
fn frames_held(path: &Path) -> u64 {
    if !path.is_file() {
        return 0;
    }
    let tally = Recording::open(path).and_then(|mut recording| tally_recording(&mut recording));
    tally.map_or(0, |tally| tally.account().counters().received)
}

fn stream(
    session: &mut Session,
    frames: Option<u32>,
    run: &mut RunListener<'_>,
    started: Instant,
) -> Result<Ended, SessionError> {
    let length = frames.map_or(RunLength::Continuous, RunLength::Frames);
    session.command(request::Start(length), run)?;
    let mut stopped: Option<Instant> = None;
    let mut kept_alive = Instant::now();
    let mut kept_alive_us = 0;
    let mut watched = Instant::now();
    while !run.tally.has_ended() && !run.junk.is_too_much() && !run.has_more_than(frames) {
        session.listen(Duration::from_millis(50), run)?;
        if watched.elapsed() > Duration::from_millis(50) {
            watched = Instant::now();
            run.record(Recorder::flush_if_due);
            let progress =
                Progress { counters: run.tally.account().counters(), elapsed: started.elapsed() };
            let wants_stop =
                run.observer.watch(&progress).is_break() || run.recorder_error.is_some();
            if wants_stop && stopped.is_none() && !run.tally.has_ended() {
                stopped = Some(Instant::now());
                stop(session, run)?;
            }
        }
        if stopped.is_some_and(|stopped| stopped.elapsed() > STOP_TIMEOUT) {
            return Err(SessionError::NoAnswer { command: request::Stop::NAME });
        }
        if run.last_intact.elapsed() > ANSWER_TIMEOUT {
            return Err(SessionError::NoAnswer { command: request::Status::NAME });
        }
        // The time of a simulated camera may run faster than the host's, and the camera measures
        // the host's silence.
        let device_age =
            Duration::from_micros(run.tally.device_time_us().saturating_sub(kept_alive_us));
        if kept_alive.elapsed() > KEEP_ALIVE || device_age > KEEP_ALIVE {
            kept_alive = Instant::now();
            kept_alive_us = run.tally.device_time_us();
            session.keep_alive()?;
            // The damaged packet may have been the one with the end of the run.
            if let Some(status) = run.status
                && status.state != State::Running
                && status.run == run.number
                && run.last_intact.elapsed() > QUIET
            {
                run.tally.end(status.frames_made);
            }
        }
    }
    if run.junk.is_too_much() {
        // The camera may not receive the stop.
        let _ = stop(session, run);
        return Ok(Ended::Junk { bytes: run.junk.bytes() });
    }
    if !run.tally.has_ended() {
        stop(session, run)?;
        return Ok(Ended::WrongNumber { made: run.tally.account().accounted(), asked: frames });
    }
    // The status also shows a fault whose event was in a damaged packet.
    let status = session.status(run);
    let accounted = run.tally.account().accounted();
    let made = run.tally.made().unwrap_or(accounted);
    // The number that the camera reports and the number that arrived must both be the number
    // requested.
    // A replay is whole when the recorded run is over.
    let is_all = |made: u64| match frames {
        Some(frames) => made == u64::from(frames),
        None => session.recorded().is_some() && stopped.is_none(),
    };
    let all_made = is_all(made) && is_all(accounted);
    let made = if frames.map(u64::from) == Some(made) { accounted } else { made };
    Ok(match (run.fault, status) {
        (Some(fault), _) | (None, Ok(Status { fault: Some(fault), .. })) => Ended::Fault(fault),
        (None, Err(error)) => Ended::Unconfirmed(error),
        (None, Ok(_)) if all_made => Ended::Complete,
        (None, Ok(_)) if stopped.is_some() => Ended::Stopped,
        (None, Ok(_)) => Ended::WrongNumber { made, asked: frames },
    })
}

/// Stops the run. A run that has already ended refuses the stop, which counts as stopped.
fn stop(session: &mut Session, run: &mut RunListener<'_>) -> Result<(), SessionError> {
    match session.command(request::Stop, run) {
        Err(SessionError::Refused { .. }) | Ok(()) => Ok(()),
        Err(error) => Err(error),
    }
}
