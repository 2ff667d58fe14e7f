//! One run of a capture in turns, so that a caller can do other work in between.

use super::files::{Head, RunRecorder};
use super::frames_due::FramesDue;
use super::junk::Junk;
use super::{
    Calibration, Capture, CaptureError, CaptureOptions, Ended, Observer, Progress, Record,
    StopCause,
};
use crate::recording::{Recording, RunAccount, tally_recording};
use nirspi_camera::calibration::{CalibrationError, calibrate, calibrate_or};
use nirspi_camera::response::Settling;
use nirspi_camera::session::{
    ANSWER_TIMEOUT, IgnorePackets, Listener, Recorded, Request, Session, SessionError, request,
};
use nirspi_camera::setup::MeasurementSetup;
use nirspi_camera::tally::{FrameCount, Tally};
use nirspi_files::clock::Instant;
use nirspi_files::provenance::Taken;
use nirspi_wire::{
    Answer, DeviceMessage, Event, EventKind, Fault, PacketError, Refusal, Reply, RunLength, State,
    Status,
};
use std::io;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

/// Interval of the host's messages while it only listens.
const KEEP_ALIVE: Duration = Duration::from_secs(1);
/// A camera that reports the end of a run and sends nothing for this long has stopped.
const QUIET: Duration = Duration::from_millis(500);
/// The longest time in which a stopped run must end.
const STOP_TIMEOUT: Duration = Duration::from_secs(10);
/// The longest time that one turn waits for packets, and the time between two calls of
/// [`Observer::watch`].
const TURN: Duration = Duration::from_millis(50);
/// A turn that takes this long means that this program itself stood still: its computer slept, or
/// a person suspended it. What the camera sent meanwhile is read next.
const STOOD_STILL: Duration = ANSWER_TIMEOUT.checked_div(2).expect("two is not zero");

/// Watches the calibration of the camera.
struct Calibrating<'o> {
    observer: &'o mut dyn Observer,
    began: Instant,
}

impl Listener for Calibrating<'_> {
    fn packet(&mut self, _: &[u8], _: &Result<DeviceMessage<'_>, PacketError>) {}

    fn goes_on(&mut self) -> bool {
        let progress = Progress { elapsed: self.began.elapsed(), ..Progress::default() };
        self.observer.watch(&progress).is_continue()
    }
}

/// A run that has begun: the camera measures until [`end`](Self::end).
///
/// ```text
/// let mut run = Run::begin(session, options, observer)?;
/// while run.turn(session, observer) {}
/// let capture = run.end(session, observer)?;
/// ```
pub struct Run {
    setup: MeasurementSetup,
    settling: Option<Settling>,
    calibration_problem: Option<CalibrationError>,
    asked: Option<u32>,
    number: u16,
    tally: Tally,
    recorder: Option<RunRecorder>,
    recorder_error: Option<io::Error>,
    fault: Option<Fault>,
    status: Option<Status>,
    /// The camera knows of no session, so it has restarted.
    forgotten: bool,
    junk: Junk,
    due: FramesDue,
    /// How long the camera has sent no frame, if that is too long.
    overdue: Option<Duration>,
    started: Instant,
    /// Time of the last intact packet.
    last_intact: Instant,
    /// When the last turn ended.
    turned: Instant,
    /// When the run was stopped, and why; `None` before.
    stopped: Option<(Instant, StopCause)>,
    kept_alive: Instant,
    kept_alive_us: u64,
    watched: Instant,
    /// Why the session ended.
    broken: Option<SessionError>,
}

/// Interprets the packets of a run.
struct Packets<'r> {
    run: &'r mut Run,
    observer: &'r mut dyn Observer,
}

impl Listener for Packets<'_> {
    fn arrived(&mut self, at: Instant) {
        self.observer.arrived(at);
    }

    fn packet(&mut self, raw: &[u8], content: &Result<DeviceMessage<'_>, PacketError>) {
        let Self { run, observer } = self;
        if run.junk.is_too_much() {
            return;
        }
        let now = Instant::now();
        if content.is_ok() {
            run.last_intact = now;
        }
        run.record(|recorder| recorder.packet(raw, content));
        let before = run.tally.arrived();
        let received = run.tally.packet(content);
        if let (Some(recorder), None) = (&mut run.recorder, &run.recorder_error) {
            run.recorder_error = recorder.heard(content, &run.tally, received).err();
        }
        run.junk.packet(raw.len(), content, run.tally.arrived() > before, now);
        match content {
            Ok(DeviceMessage::Frame(frame)) if received => {
                run.due.frame(now);
                observer.frame(frame, &run.tally.account().counters());
            }
            Ok(message) => observer.message(message),
            Err(_) => {}
        }
        match content {
            Ok(DeviceMessage::Event(Event { kind: EventKind::Fault(fault), .. })) => {
                run.fault = Some(*fault);
            }
            Ok(DeviceMessage::Reply(Reply { outcome: Ok(Answer::Status(status)), .. })) => {
                run.status = Some(*status);
                run.due.status(status.uptime_us);
            }
            Ok(DeviceMessage::Reply(Reply { outcome: Err(Refusal::Protocol { .. }), .. })) => {
                run.forgotten = true;
            }
            _ => {}
        }
    }
}

impl Run {
    /// Calibrates, configures and starts the camera.
    ///
    /// # Errors
    /// [`CaptureError`] if the camera cannot measure. A camera that does not start shows in
    /// [`end`](Self::end).
    pub fn begin(
        session: &mut Session,
        options: &CaptureOptions,
        observer: &mut dyn Observer,
    ) -> Result<Self, CaptureError> {
        // A replayed camera has the setup and settling of its recording.
        let replayed = session.recorded().cloned();
        let mut setup =
            replayed.as_ref().map_or(&options.setup, |recorded| &recorded.setup).clone();
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
            Some(Record { target, made }) => {
                let identity = session.identity().clone();
                let provenance = Some(Taken::by(&identity).made(made));
                let (setup, settling) = (setup.clone(), settling.clone());
                let head = Head { identity, setup, settling, run: number, provenance };
                let path = || target.path().to_owned();
                let recorder = RunRecorder::create(target, head);
                Some(recorder.map_err(|source| CaptureError::Recording { path: path(), source })?)
            }
        };
        observer.begins(&setup, settling.as_ref(), calibration_problem.as_ref());
        let now = Instant::now();
        let first = replayed.as_ref().map_or(0, |recorded| recorded.first_frame);
        let count = FrameCount::new(&setup, Some(number)).beginning_at(first);
        let tally = Tally::new(&setup, count);
        let due = FramesDue::new(setup.frame_ns(), now);
        let mut run = Self {
            setup,
            settling,
            calibration_problem,
            asked: options.frames,
            number,
            tally,
            recorder,
            recorder_error: None,
            fault: None,
            status: None,
            forgotten: false,
            junk: Junk::new(now),
            due,
            overdue: None,
            started: now,
            last_intact: now,
            turned: now,
            stopped: None,
            kept_alive: now,
            kept_alive_us: 0,
            watched: now,
            broken: None,
        };
        let length = options.frames.map_or(RunLength::Continuous, RunLength::Frames);
        run.broken =
            session.command(request::Start(length), &mut Packets { run: &mut run, observer }).err();
        (run.kept_alive, run.watched) = (Instant::now(), Instant::now());
        Ok(run)
    }

    /// Listens to the camera for a moment: until packets have arrived, or for 50 ms. Returns
    /// whether the run goes on.
    pub fn turn(&mut self, session: &mut Session, observer: &mut dyn Observer) -> bool {
        if self.broken.is_none() && self.goes_on() {
            self.broken = self.listen(session, observer).err();
        }
        self.broken.is_none() && self.goes_on()
    }

    /// Asks the camera to stop, as if the observer had broken. The last frames come in later turns.
    pub fn stop(&mut self, session: &mut Session, observer: &mut dyn Observer) {
        if self.broken.is_none() && self.stopped.is_none() && self.goes_on() {
            self.broken = self.stop_at_once(session, observer, StopCause::User).err();
        }
    }

    fn goes_on(&self) -> bool {
        !self.tally.has_ended()
            && !self.junk.is_too_much()
            && !self.has_more_than_asked()
            && self.overdue.is_none()
    }

    /// Whether the camera has sent more frames than requested.
    fn has_more_than_asked(&self) -> bool {
        self.asked.is_some_and(|asked| self.accounted() > u64::from(asked))
    }

    /// Number of frames in the account.
    fn accounted(&self) -> u64 {
        self.tally.account().accounted() - self.tally.account().first()
    }

    /// Number of frames that the camera reports to have made. A replay of a file in the middle of a run
    /// makes those from its first frame on.
    fn made(&self) -> Option<u64> {
        let first = self.tally.account().first();
        self.tally.made().map(|made| made.saturating_sub(first))
    }

    /// Whether the recording takes no more, or cannot go on in its next file.
    fn cannot_record(&self) -> bool {
        self.recorder_error.is_some() || self.recorder.as_ref().is_some_and(RunRecorder::must_stop)
    }

    /// Writes to the recording, if there is one without an earlier error.
    fn record(&mut self, write: impl FnOnce(&mut RunRecorder) -> io::Result<()>) {
        if let Some(recorder) = &mut self.recorder
            && self.recorder_error.is_none()
        {
            self.recorder_error = write(recorder).err();
        }
    }

    fn listen(
        &mut self,
        session: &mut Session,
        observer: &mut dyn Observer,
    ) -> Result<(), SessionError> {
        session.listen(TURN, &mut Packets { run: self, observer })?;
        if self.forgotten {
            return Err(SessionError::Ended { command: request::Status::NAME });
        }
        if self.watched.elapsed() > TURN {
            self.watched = Instant::now();
            self.record(RunRecorder::flush_if_due);
            let counters = self.tally.account().counters();
            let progress = Progress {
                counters,
                elapsed: self.started.elapsed(),
                waited: Some(session.waited()),
                device_time_us: self.tally.device_time_us(),
                failed_checks: self.tally.account().failed_checks(),
                queued: self.recorder.as_ref().map_or(0.0, RunRecorder::queued),
            };
            let cause = match observer.watch(&progress) {
                ControlFlow::Break(cause) => Some(cause),
                // The error of the recording is what ends the capture.
                ControlFlow::Continue(()) => self.cannot_record().then_some(StopCause::User),
            };
            if let Some(cause) = cause
                && self.stopped.is_none()
                && !self.tally.has_ended()
            {
                self.stop_at_once(session, observer, cause)?;
            }
        }
        if self.stopped.is_some_and(|(stopped, _)| stopped.elapsed() > STOP_TIMEOUT) {
            return Err(SessionError::NoAnswer { command: request::Stop::NAME });
        }
        let now = Instant::now();
        if now.saturating_duration_since(self.turned) > STOOD_STILL {
            self.last_intact = now;
            self.due.stood_still(now);
        }
        self.turned = now;
        // A replay has the pauses of its recording.
        if self.stopped.is_none() && session.recorded().is_none() {
            self.overdue = self.due.overdue(now);
        }
        if self.last_intact.elapsed() > ANSWER_TIMEOUT {
            return Err(SessionError::NoAnswer { command: request::Status::NAME });
        }
        // The time of a simulated camera may run faster than the host's, and the camera measures
        // the host's silence.
        let device_age =
            Duration::from_micros(self.tally.device_time_us().saturating_sub(self.kept_alive_us));
        if self.kept_alive.elapsed() > KEEP_ALIVE || device_age > KEEP_ALIVE {
            self.kept_alive = Instant::now();
            self.kept_alive_us = self.tally.device_time_us();
            session.keep_alive()?;
            // The damaged packet may have been the one with the end of the run.
            if let Some(status) = self.status
                && status.state != State::Running
                && status.run == self.number
                && self.last_intact.elapsed() > QUIET
            {
                self.tally.end(status.frames_made);
            }
        }
        Ok(())
    }

    /// Ends the run: stops a camera that still measures, and closes the recording.
    ///
    /// # Errors
    /// [`CaptureError`] if nothing was captured, or the recording failed.
    pub fn end(
        mut self,
        session: &mut Session,
        observer: &mut dyn Observer,
    ) -> Result<Capture, CaptureError> {
        let ended = match self.broken.take() {
            None => self.ended(session, observer),
            Some(error) => Err(error),
        };
        let ended = match ended {
            Ok(ended) => ended,
            Err(error) if self.tally.has_begun() => Ended::LinkLost(error),
            Err(error) => {
                // A run that never started leaves no recording.
                if let Some(recorder) = self.recorder {
                    recorder.discard();
                }
                return Err(error.into());
            }
        };
        let made = self.made();
        let account = self.tally.account();
        let mut captured = Capture {
            camera: session.identity().clone(),
            setup: self.setup,
            settling: self.settling,
            calibration_problem: self.calibration_problem,
            integrated: self.tally.integrated().clone().of_run(&self.tally.known()),
            counters: account.counters(),
            failed_checks: account.failed_checks(),
            unknown_packets: self.tally.unknown_packets(),
            repeated: account.repeated(),
            status: self.status,
            asked: self.asked,
            made,
            recording: None,
            files: Vec::new(),
            ended,
            elapsed: self.started.elapsed(),
        };
        if let Some(recorder) = self.recorder {
            let Capture { counters, asked, made, .. } = captured;
            let missing = captured.missing();
            let account = RunAccount { counters, asked, made, missing, continues: None };
            let missing_in = |count: &FrameCount| captured.missing_in(count);
            let recorded = recorder.finish(self.recorder_error, account, missing_in);
            captured.recording = recorded.files.first().cloned();
            captured.files = recorded.files;
            if let Some((path, source)) = recorded.failed {
                let held = captured.files.iter().map(|path| frames_held(path)).sum();
                let captured = Box::new(captured);
                return Err(CaptureError::RecordingCut { path, source, held, captured });
            }
        }
        Ok(captured)
    }

    /// What ended the run, after asking the camera.
    fn ended(
        &mut self,
        session: &mut Session,
        observer: &mut dyn Observer,
    ) -> Result<Ended, SessionError> {
        if self.junk.is_too_much() {
            // The camera may not receive the stop.
            let _ = self.stop_at_once(session, observer, StopCause::User);
            return Ok(Ended::Junk { bytes: self.junk.bytes() });
        }
        if let Some(waited) = self.overdue {
            self.stop_at_once(session, observer, StopCause::User)?;
            return Ok(Ended::NoFrames { waited });
        }
        let asked = self.asked;
        if !self.tally.has_ended() {
            self.stop_at_once(session, observer, StopCause::User)?;
            return Ok(Ended::WrongNumber { made: self.accounted(), asked });
        }
        // The status also shows a fault whose event was in a damaged packet.
        let status = session.status(&mut Packets { run: self, observer });
        let accounted = self.accounted();
        let made = self.made().unwrap_or(accounted);
        // The number that the camera reports and the number that arrived must both be the number
        // requested.
        // A replay is whole when the recorded run is over.
        let is_all = |made: u64| match asked {
            Some(asked) => made == u64::from(asked),
            None => session.recorded().is_some() && self.stopped.is_none(),
        };
        let all_made = is_all(made) && is_all(accounted);
        let made = if asked.map(u64::from) == Some(made) { accounted } else { made };
        Ok(match (self.fault, status) {
            (Some(fault), _) | (None, Ok(Status { fault: Some(fault), .. })) => Ended::Fault(fault),
            (None, Err(error)) => Ended::Unconfirmed(error),
            (None, Ok(_)) if all_made => Ended::Complete,
            (None, Ok(_)) => match self.stopped {
                Some((_, cause)) => Ended::Stopped(cause),
                None => Ended::WrongNumber { made, asked },
            },
        })
    }

    /// Stops the camera. A run that has already ended refuses the stop, which counts as stopped.
    fn stop_at_once(
        &mut self,
        session: &mut Session,
        observer: &mut dyn Observer,
        cause: StopCause,
    ) -> Result<(), SessionError> {
        self.stopped = Some((Instant::now(), cause));
        match session.command(request::Stop, &mut Packets { run: self, observer }) {
            Err(SessionError::Refused { .. }) | Ok(()) => Ok(()),
            Err(error) => Err(error),
        }
    }
}

/// Number of frames in a file; 0 for a device or a file that cannot be read.
fn frames_held(path: &Path) -> u64 {
    if !path.is_file() {
        return 0;
    }
    let tally = Recording::open(path).and_then(|mut recording| tally_recording(&mut recording));
    tally.map_or(0, |tally| tally.account().counters().received)
}
