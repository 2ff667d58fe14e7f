//! Capture: greet, calibrate, configure, start, and account for every frame until the run ends.
//!
//! The one law: whatever ends a capture (its length, the user, the camera, the link), what has come is kept
//! and the counters say what has not.
//!
//! # Invariant
//! A capture is whole if the camera says that it has made the frames that were asked for, all of them came whole and in
//! order, no packet came damaged beyond them, and no fault stands afterwards; anything else is said
//! ([`Capture::missing`], `missing::tests::a_capture_is_whole_only_if_nothing_is_missing`). What a camera can make this program
//! write is bounded by the frames that it delivers (`junk::tests`).

mod junk;
mod missing;

use crate::account::LossCounters;
use crate::calibration::{CalibrationError, Settling, calibrate, calibrate_or};
use crate::integrate::Integrated;
use crate::recording::{Recorder, Recording, RunAccount, Target};
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

/// How often the camera hears from a host that has nothing to say.
const KEEP_ALIVE: Duration = Duration::from_secs(1);
/// A camera that says it has stopped, and sends nothing more for this long, has stopped.
const QUIET: Duration = Duration::from_millis(500);
/// A run that was stopped ends within this, or the camera does not answer.
const STOP_TIMEOUT: Duration = Duration::from_secs(10);

/// What to capture.
#[derive(Debug, Clone)]
pub struct CaptureOptions {
    /// The measurement. Its latency is replaced by that of the calibration, where there is one.
    pub setup: MeasurementSetup,
    /// Frames to make; `None` goes on until stopped.
    pub frames: Option<u32>,
    /// Where latency and settling come from.
    pub calibration: Calibration,
    /// Where to record.
    pub record: Option<Target>,
}

/// Where a capture's latency and settling come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Calibration {
    /// The setup's latency is right, and the leak is not known.
    None,
    /// They are measured first. A burst that does not show them ends the capture.
    Measure,
    /// They were measured before.
    Kept(Settling),
    /// They are measured first. Where the burst is too dim to show them, they are as measured before.
    MeasureOr(Settling),
}

/// How far a capture has come.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// The counters so far.
    pub counters: LossCounters,
    /// Since the start of the run.
    pub elapsed: Duration,
}

/// What ended a capture.
#[derive(Debug)]
pub enum Ended {
    /// The camera says that all frames asked for were made, and that no fault stands.
    Complete,
    /// The user has stopped it.
    Stopped,
    /// The camera switched its LEDs off.
    Fault(Fault),
    /// The camera ended the run by itself with another number of frames than was asked for.
    WrongNumber {
        /// Frames made.
        made: u64,
        /// Frames asked for; `None` for a run that goes on until stopped.
        asked: Option<u32>,
    },
    /// The run ended, and the camera did not say afterwards whether a fault stands.
    Unconfirmed(SessionError),
    /// Most of what came was not of this run, or damaged. The run was stopped.
    Junk {
        /// Bytes of it.
        bytes: u64,
    },
    /// The camera went away or fell silent. What it made after the last frame that came is not known.
    LinkLost(SessionError),
}

/// What a capture brought.
#[derive(Debug)]
pub struct Capture {
    /// The setup as measured.
    pub setup: MeasurementSetup,
    /// LED and amplifier response used for leak correction; `None` with [`Calibration::None`].
    pub settling: Option<Settling>,
    /// Why the response of [`Calibration::MeasureOr`] is the one measured before.
    pub calibration_problem: Option<CalibrationError>,
    /// The sum of all frames received.
    pub integrated: Integrated,
    /// The four counters.
    pub counters: LossCounters,
    /// Damaged packets of any kind.
    pub damaged_packets: u64,
    /// Intact messages that this program does not know: it passed over them.
    pub unknown_packets: u64,
    /// Frames that came twice.
    pub repeated: u64,
    /// The camera's own view at the end.
    pub status: Option<Status>,
    /// Frames asked for; `None` for a run that goes on until stopped.
    pub asked: Option<u32>,
    /// Frames that the camera says it has made; `None` if it could not say.
    pub made: Option<u64>,
    /// The recording, if there is one. It does not have the name asked for if it was to replace another and is not whole.
    pub recording: Option<PathBuf>,
    /// What ended it.
    pub ended: Ended,
    /// From start to end of the run.
    pub elapsed: Duration,
}

/// Why a capture brought nothing at all.
#[derive(Debug, Error)]
pub enum CaptureError {
    /// The camera would not talk or not measure.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Latency and settling could not be measured, and none are known.
    #[error(
        "the camera's ADC latency is not known (hold a white sheet before the camera and run nirspi calibrate once, or name \
         a latency that you know with --no-calibration --adc-latency N)"
    )]
    Calibration(#[source] CalibrationError),
    /// The user has stopped it before the run began.
    #[error("stopped by the user before the first frame")]
    Stopped,
    /// The recording cannot be started.
    #[error("{path}: cannot record")]
    Recording {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The recording cannot be continued: the disk is full or gone.
    #[error(
        "{path}: cannot record any more, {held} of the {} frames received are whole in the file and kept",
        .counters.received
    )]
    RecordingCut {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: io::Error,
        /// Frames that the file holds, by reading it again.
        held: u64,
        /// The account of the run, of which the last frames are not in the file.
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

/// Sees a capture while it runs, from the thread that drains the link: it has to be quick.
pub trait Observer {
    /// The camera has taken this setup; frames come next. `problem` is why its response is the one measured before.
    fn begins(
        &mut self,
        _setup: &MeasurementSetup,
        _settling: Option<&Settling>,
        _problem: Option<&CalibrationError>,
    ) {
    }

    /// A frame was received, in order; `counters` count it.
    fn frame(&mut self, _frame: &Frame<'_>, _counters: &LossCounters) {}

    /// Anything else has come whole.
    fn message(&mut self, _message: &DeviceMessage<'_>) {}

    /// How far it is, at nothing while the camera is being calibrated; called at least ten times a second, breaks to stop.
    fn watch(&mut self, progress: &Progress) -> ControlFlow<()>;
}

/// Looks on, now and then.
struct Watching<'w>(&'w mut dyn FnMut(&Progress) -> ControlFlow<()>);

impl Observer for Watching<'_> {
    fn watch(&mut self, progress: &Progress) -> ControlFlow<()> {
        (self.0)(progress)
    }
}

/// Looks on while the camera is being calibrated.
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

/// Takes the stream apart while it comes.
struct RunListener<'o> {
    observer: &'o mut dyn Observer,
    number: u16,
    tally: Tally,
    recorder: Option<Recorder>,
    recorder_error: Option<io::Error>,
    fault: Option<Fault>,
    status: Option<Status>,
    junk: Junk,
    /// When the last packet came that was not damaged.
    last_intact: Instant,
}

impl RunListener<'_> {
    /// Writes to the recording, if there is one and it has not failed before.
    fn record(&mut self, write: impl FnOnce(&mut Recorder) -> io::Result<()>) {
        if let Some(recorder) = &mut self.recorder
            && self.recorder_error.is_none()
        {
            self.recorder_error = write(recorder).err();
        }
    }

    /// Whether the camera has sent a frame beyond those that were asked for.
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
/// [`CaptureError`] where nothing was captured; a run that started always gives a [`Capture`], unless its
/// recording failed.
pub fn capture(
    session: &mut Session,
    options: &CaptureOptions,
    watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Capture, CaptureError> {
    observe(session, options, &mut Watching(watch))
}

/// Runs one capture, with somebody who sees every frame as it comes.
///
/// # Errors
/// As [`capture`].
pub fn observe(
    session: &mut Session,
    options: &CaptureOptions,
    observer: &mut dyn Observer,
) -> Result<Capture, CaptureError> {
    let mut setup = options.setup.clone();
    let calibrating = &mut Calibrating { observer: &mut *observer, began: Instant::now() };
    let (settling, calibration_problem) = match &options.calibration {
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
            // A run that never started leaves no recording behind.
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

/// Closes the recording of a capture; its name.
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

/// Frames that a file holds; none if it is a device, or does not read.
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
        // A simulated camera's time may outrun ours, and it is the camera that counts our silence.
        let device_age =
            Duration::from_micros(run.tally.device_time_us().saturating_sub(kept_alive_us));
        if kept_alive.elapsed() > KEEP_ALIVE || device_age > KEEP_ALIVE {
            kept_alive = Instant::now();
            kept_alive_us = run.tally.device_time_us();
            session.keep_alive()?;
            // The end of the run may have been the one packet that was damaged.
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
        // The camera may not listen either.
        let _ = stop(session, run);
        return Ok(Ended::Junk { bytes: run.junk.bytes() });
    }
    if !run.tally.has_ended() {
        stop(session, run)?;
        return Ok(Ended::WrongNumber { made: run.tally.account().accounted(), asked: frames });
    }
    // The camera's own view: a fault's event may have been the one packet that was damaged.
    let status = session.status(run);
    let accounted = run.tally.account().accounted();
    let made = run.tally.made().unwrap_or(accounted);
    // What the camera says and what came must both be what was asked for.
    let all_made = [made, accounted].iter().all(|&made| frames.map(u64::from) == Some(made));
    let made = if frames.map(u64::from) == Some(made) { accounted } else { made };
    Ok(match (run.fault, status) {
        (Some(fault), _) | (None, Ok(Status { fault: Some(fault), .. })) => Ended::Fault(fault),
        (None, Err(error)) => Ended::Unconfirmed(error),
        (None, Ok(_)) if all_made => Ended::Complete,
        (None, Ok(_)) if stopped.is_some() => Ended::Stopped,
        (None, Ok(_)) => Ended::WrongNumber { made, asked: frames },
    })
}

/// Ends the run at the camera. A run that has ended by itself meanwhile is refused, and has ended too.
fn stop(session: &mut Session, run: &mut RunListener<'_>) -> Result<(), SessionError> {
    match session.command(request::Stop, run) {
        Err(SessionError::Refused { .. }) | Ok(()) => Ok(()),
        Err(error) => Err(error),
    }
}
