//! Capture: greet, calibrate, configure, start, and account for every frame until the run ends.
//!
//! The one law: whatever ends a capture (its length, the user, the camera, the link), what has come is kept
//! and the counters say what has not.

use crate::account::LossCounters;
use crate::calibration::{CalibrationError, Settling, calibrate, calibrate_or};
use crate::integrate::Integrated;
use crate::recording::Recorder;
use crate::session::{
    ANSWER_TIMEOUT, IgnorePackets, Listener, Request, Session, SessionError, request,
};
use crate::setup::MeasurementSetup;
use crate::tally::Tally;
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
    pub record: Option<PathBuf>,
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
    /// All frames asked for were made.
    Complete,
    /// The user has stopped it.
    Stopped,
    /// The camera switched its LEDs off.
    Fault(Fault),
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
    /// Frames that came twice.
    pub repeated: u64,
    /// The camera's own view at the end.
    pub status: Option<Status>,
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
    /// The recording cannot be started.
    #[error("{path}: cannot record")]
    Recording {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The recording cannot be continued: the disk is full or gone.
    #[error("{path}: cannot record any more, what was written before is kept ({counters} so far)")]
    RecordingCut {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: io::Error,
        /// The account of the run, of which the last frames are not in the file.
        counters: LossCounters,
    },
}

impl From<CalibrationError> for CaptureError {
    fn from(error: CalibrationError) -> Self {
        match error {
            CalibrationError::Session(error) => Self::Session(error),
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

    /// How far it is; called at least ten times a second, breaks to stop.
    fn watch(&mut self, progress: &Progress) -> ControlFlow<()>;
}

/// Looks on, now and then.
struct Watching<'w>(&'w mut dyn FnMut(&Progress) -> ControlFlow<()>);

impl Observer for Watching<'_> {
    fn watch(&mut self, progress: &Progress) -> ControlFlow<()> {
        (self.0)(progress)
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
    last_packet: Instant,
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
}

impl Listener for RunListener<'_> {
    fn packet(&mut self, raw: &[u8], content: &Result<DeviceMessage<'_>, PacketError>) {
        self.last_packet = Instant::now();
        self.record(|recorder| recorder.packet(raw));
        let received = self.tally.packet(content);
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
    let (settling, calibration_problem) = match &options.calibration {
        Calibration::None => (None, None),
        Calibration::Kept(settling) => (Some(settling.clone()), None),
        Calibration::Measure => (Some(calibrate(session, &mut IgnorePackets)?), None),
        Calibration::MeasureOr(known) => {
            let (settling, problem) = calibrate_or(session, &mut IgnorePackets, known)?;
            (Some(settling), problem)
        }
    };
    if let Some(settling) = &settling {
        setup.adc_latency = settling.adc_latency;
    }
    setup.with_configuration(|c| session.command(request::Configure(c), &mut IgnorePackets))?;
    let before = session.status(&mut IgnorePackets)?;

    let recorder = match &options.record {
        None => None,
        Some(path) => Some(
            Recorder::create(path, session.identity(), &setup, settling.as_ref())
                .map_err(|source| CaptureError::Recording { path: path.clone(), source })?,
        ),
    };
    observer.begins(&setup, settling.as_ref(), calibration_problem.as_ref());
    let now = Instant::now();
    let mut run = RunListener {
        observer,
        number: before.run.wrapping_add(1),
        tally: Tally::new(&setup, Some(before.run.wrapping_add(1))),
        recorder,
        recorder_error: None,
        fault: None,
        status: None,
        last_packet: now,
    };
    let ended = match stream(session, options.frames, &mut run, now) {
        Ok(ended) => ended,
        Err(error) if run.tally.has_begun() => Ended::LinkLost(error),
        Err(error) => {
            discard_empty(options.record.as_deref(), run);
            return Err(error.into());
        }
    };
    let counters = run.tally.account().counters();
    let recorded = match (run.recorder_error.take(), run.recorder.take()) {
        (Some(error), _) => Err(error),
        (None, Some(recorder)) => recorder.finish(&counters),
        (None, None) => Ok(()),
    };
    if let (Err(source), Some(path)) = (recorded, options.record.clone()) {
        return Err(CaptureError::RecordingCut { path, source, counters });
    }
    Ok(Capture {
        setup,
        settling,
        calibration_problem,
        integrated: run.tally.integrated().clone(),
        counters,
        damaged_packets: run.tally.account().damaged_packets(),
        repeated: run.tally.account().repeated(),
        status: run.status,
        ended,
        elapsed: now.elapsed(),
    })
}

/// A run that never started leaves no recording behind.
fn discard_empty(path: Option<&Path>, run: RunListener<'_>) {
    drop(run.recorder);
    // Not a device that the user records into.
    if let Some(path) = path.filter(|path| path.is_file()) {
        // It was made a moment ago and holds no packet; where it cannot be removed it does no harm.
        let _ = std::fs::remove_file(path);
    }
}

fn stream(
    session: &mut Session,
    frames: Option<u32>,
    run: &mut RunListener<'_>,
    started: Instant,
) -> Result<Ended, SessionError> {
    let length = frames.map_or(RunLength::Continuous, RunLength::Frames);
    session.command(request::Start(length), run)?;
    let mut stopped = false;
    let mut kept_alive = Instant::now();
    let mut kept_alive_us = 0;
    let mut watched = Instant::now();
    while !run.tally.has_ended() {
        session.listen(Duration::from_millis(50), run)?;
        if watched.elapsed() > Duration::from_millis(50) {
            watched = Instant::now();
            run.record(Recorder::flush_if_due);
            let progress =
                Progress { counters: run.tally.account().counters(), elapsed: started.elapsed() };
            let wants_stop =
                run.observer.watch(&progress).is_break() || run.recorder_error.is_some();
            if wants_stop && !stopped && !run.tally.has_ended() {
                stopped = true;
                match session.command(request::Stop, run) {
                    // It had ended by itself meanwhile.
                    Err(SessionError::Refused { .. }) | Ok(()) => {}
                    Err(error) => return Err(error),
                }
            }
        }
        if run.last_packet.elapsed() > ANSWER_TIMEOUT {
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
                && run.last_packet.elapsed() > QUIET
            {
                run.tally.end(status.frames_made);
            }
        }
    }
    // The camera's own view, for the record. All that it made is accounted for: if it cannot be asked any
    // more, nothing is lost.
    let _ = session.status(run);
    Ok(match (run.fault, stopped) {
        (Some(fault), _) => Ended::Fault(fault),
        (None, true) => Ended::Stopped,
        (None, false) => Ended::Complete,
    })
}
