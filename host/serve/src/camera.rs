//! The camera of a page: connects, receives every frame, and puts the newest into the slot.
//!
//! # Invariant
//! After a fault or a stop the LEDs go on again only when a person asks (`after_a_fault_leds_go_on_again_only_when_a_person_says_so` and
//! `a_person_stops_a_camera_and_only_a_person_starts_it_again` in `host/serve/src/tests.rs`).

use super::camera_log::Phase;
use super::delays::Passed;
use super::light::Leds;
use super::look::{DepthImage, Look, RunSetup, Seen};
use super::overload::Load;
use super::settings::Measuring;
use super::stage::StagedScene;
use super::{ForeignError, Shared, lock};
use nirspi::account::{FailedChecks, LossCounters};
use nirspi::calibration::{CalibrationError, FlatField, KeptFlatField};
use nirspi::capture::{
    Calibration, Capture, CaptureError, CaptureOptions, Ended, Observer, Progress, Record,
    StopCause,
};
use nirspi::clock::Instant;
use nirspi::events::{self, Level};
use nirspi::integrate::Newest;
use nirspi::provenance::Made;
use nirspi::recording::Target;
use nirspi::response::Settling;
use nirspi::session::{IgnorePackets, Listener, Session, SessionError, request};
use nirspi::setup::MeasurementSetup;
use nirspi::{causes, depth_image};
use nirspi_nets::DepthMaps;
use nirspi_optics::{CameraModel, SIDE};
use nirspi_recon::words::count;
use nirspi_wire::{
    Answer, Depth, DeviceMessage, EventKind, Fault, Frame, PacketError, Refusal, Reply,
    State as Device,
};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// A camera that has answered, and its response.
pub struct Connected {
    /// The session with the camera.
    pub session: Session,
    /// The source of latency and settling.
    pub calibration: Calibration,
    /// Remarks about the source of latency and settling.
    pub note: Option<String>,
    /// The flat field kept for the camera.
    pub flat_field: Option<KeptFlatField>,
}

/// A function that connects to the camera again. A virtual camera gets the scene before it.
pub type Connect = Box<dyn FnMut(Option<&StagedScene>) -> Result<Connected, ForeignError> + Send>;

/// A camera and its measurement.
pub struct CameraSource {
    /// The camera's address as on the command line.
    pub address: String,
    /// The measurement. If there is a calibration, its latency replaces the latency of the setup.
    pub setup: MeasurementSetup,
    /// Where the depth sensor's zones lie in the image.
    pub model: CameraModel,
    /// The scene before a virtual camera, which pages can change; `None` for any other camera.
    pub scene: Option<StagedScene>,
    /// The folder for recordings; `None` if pages cannot record.
    pub record_to: Option<PathBuf>,
    /// Connects to the camera again.
    pub connect: Connect,
}

/// Why a session ended.
pub(super) enum End {
    /// The server is stopping.
    #[cfg(not(target_family = "wasm"))]
    Told,
    /// The link to the camera is gone, for this reason in one line.
    Gone(String),
    /// The camera switched its LEDs off.
    Fault(Fault),
    /// The camera has come back and must stay dark until a person agrees, for this reason in one line.
    Dark(String),
    /// The camera's latency is not known, for this reason in one line.
    Uncalibrated(String),
    /// Another scene is wanted.
    Scene,
}

/// What comes after a session.
pub(super) enum Next {
    /// Another session at once. Light was allowed by a person, or is allowed unless a fault stands.
    Connect {
        /// Whether a person allowed light.
        person_said: bool,
    },
    /// Another session after a while.
    Retry,
    /// Another session after a person has allowed light.
    Person,
}

/// Connects to the camera again, before the scene that is wanted. Fails without a reason if the
/// scene is refused and the scene before it can be shown.
pub(super) fn reconnect(
    shared: &Shared,
    connect: &mut Connect,
) -> Result<Connected, Option<String>> {
    let scene = shared.stage.wanted();
    match connect(scene.as_deref()) {
        Ok(connected) => {
            shared.stage.show(scene);
            lock(&shared.camera).greeted(connected.session.identity());
            Ok(connected)
        }
        Err(problem) => {
            let problem = causes::in_one_line(&*problem);
            let refused = shared.stage.refuse(scene.as_ref(), &problem);
            if refused {
                let line = format!("the scene is not shown: {problem}");
                lock(&shared.camera).event(Level::Warning, line);
            }
            Err((!refused).then_some(problem))
        }
    }
}

/// Why a camera that has come back stays dark until a person agrees: a fault that is still latched,
/// whatever its kind, or a crash of the firmware since the last session.
pub(super) fn why_dark(session: &mut Session) -> Option<String> {
    // A camera that does not answer will not measure either; the measurement then reports the
    // reason.
    let crash = session.await_reports().ok()?.crash.clone();
    let fault = session.status(&mut IgnorePackets).ok()?.fault;
    fault.map(switched_off).or(crash)
}

fn switched_off(fault: Fault) -> String {
    format!("the camera switched its LEDs off: {fault}")
}

/// Asks a camera whose LEDs a person switched off whether they are off, and stops it if they are
/// not. Returns the camera's answer.
///
/// # Errors
/// If the link ends.
pub(super) fn darken(shared: &Shared, session: &mut Session) -> Result<bool, SessionError> {
    let dark = is_dark(shared, session)?;
    let line = "stopped: a person switched the LEDs off".to_owned();
    lock(&shared.camera).enter(Phase::Stopped, line);
    shared.slot.wake();
    Ok(dark)
}

/// Asks a camera whether its LEDs are off, and stops it if they are not. Records the camera's answer, or
/// that it gave none.
///
/// # Errors
/// If the link ends.
pub(super) fn is_dark(shared: &Shared, session: &mut Session) -> Result<bool, SessionError> {
    let asked = Instant::now();
    // The camera's own word counts, whatever was sent before.
    let mut ask = || {
        let dark = session.status(&mut EventLog(shared))?.state != Device::Running;
        if !dark {
            session.command(request::Stop, &mut EventLog(shared))?;
        }
        Ok(dark)
    };
    let answer = ask();
    let leds = match answer {
        Ok(true) => Leds::Off,
        Ok(false) => Leds::On,
        Err(_) => Leds::Unknown,
    };
    lock(&shared.camera).camera.leds_were(leds, asked);
    shared.slot.wake();
    answer
}

/// Adds events to the log, and ignores frames.
pub(super) struct EventLog<'s>(pub(super) &'s Shared);

impl Listener for EventLog<'_> {
    fn packet(&mut self, _: &[u8], content: &Result<DeviceMessage<'_>, PacketError>) {
        if let Ok(message) = content {
            self.0.note(message);
        }
    }
}

impl Shared {
    /// Records what a camera says of itself: events, crashes and its status.
    fn note(&self, message: &DeviceMessage<'_>) {
        if let Some((level, text)) = events::line(message) {
            lock(&self.camera).event(level, text);
        }
        if let DeviceMessage::Reply(Reply { outcome: Ok(Answer::Status(status)), .. }) = message {
            lock(&self.camera).camera.said.status = Some(*status);
        }
    }

    /// Records a new phase, and tells pages at once.
    pub(super) fn enter(&self, phase: Phase, leds: Leds, line: String) {
        let mut log = lock(&self.camera);
        log.camera.leds_are(leds);
        log.enter(phase, line);
        drop(log);
        self.slot.wake();
    }
}

/// What a run was started for. Another plan needs another run.
#[derive(Debug, Clone, PartialEq, Default)]
struct Plan {
    measuring: Option<Measuring>,
    record: bool,
}

/// Receives every frame of a run and puts the newest into the slot.
pub(super) struct Live {
    shared: Arc<Shared>,
    model: CameraModel,
    /// The setup of the command line, with the timing for all runs.
    base: MeasurementSetup,
    record_to: Option<PathBuf>,
    /// The program, for the provenance in recordings.
    made: Option<Made>,
    /// The plan of the current run.
    plan: Plan,
    /// The serial number and the response of the camera, if a run has measured the response.
    known: Option<(String, Settling)>,
    /// The loss counters of all earlier runs.
    earlier: LossCounters,
    /// The failed checks of all earlier runs.
    failed: FailedChecks,
    now: Option<(Arc<RunSetup>, Newest)>,
    /// The flat field of the connected camera.
    flat_field: Option<FlatField>,
    depth: Option<Arc<DepthImage>>,
    /// The fault that switched the LEDs off, as reported by the camera.
    fault: Option<Fault>,
    /// Frames put into the slot.
    offered: u64,
    /// Whether any run has begun.
    begun: bool,
    /// When the newest packets came out of the link.
    arrived: Instant,
    /// The moment of the last look at the load, and how long the link had been waited for. `None` where
    /// camera and images take turns: the load then says nothing of the camera.
    load: Option<(Instant, Duration)>,
}

/// Time between two looks at the load: the link may be waited for as long without a packet.
const LOAD_EVERY: Duration = Duration::from_millis(100);

impl Live {
    /// Takes over the source's measurement and its folder.
    pub(super) fn new(shared: Arc<Shared>, source: &mut CameraSource) -> Self {
        Self {
            shared,
            model: source.model.clone(),
            base: source.setup.clone(),
            record_to: source.record_to.take(),
            made: None,
            plan: Plan::default(),
            known: None,
            earlier: LossCounters::default(),
            failed: FailedChecks::default(),
            now: None,
            flat_field: None,
            depth: None,
            fault: None,
            offered: 0,
            begun: false,
            arrived: Instant::now(),
            load: None,
        }
    }

    /// The same on a thread of its own, whose load decides what the page gives up. `made` is the program, for the
    /// provenance in recordings.
    #[cfg(not(target_family = "wasm"))]
    pub(super) fn on_its_thread(self, made: Made) -> Self {
        Self { load: Some((Instant::now(), Duration::ZERO)), made: Some(made), ..self }
    }

    /// Takes the load since the last time.
    fn look_at_load(&mut self, progress: &Progress) {
        let (Some((since, waited)), Some(waited_now)) = (self.load, progress.waited) else {
            return;
        };
        let now = Instant::now();
        let passed = now.saturating_duration_since(since);
        if passed < LOAD_EVERY {
            return;
        }
        self.load = Some((now, waited_now));
        // Another session has waited for less.
        let Some(idle) = waited_now.checked_sub(waited) else { return };
        let camera_thread = 1.0 - (idle.as_secs_f64() / passed.as_secs_f64()).min(1.0);
        self.shared.loaded(Load { camera_thread, recording_queue: progress.queued });
    }

    /// Records why a session ended. Returns what comes next.
    pub(super) fn ended(&mut self, end: End) -> Next {
        // A camera that was away may have other gateware.
        if !matches!(end, End::Scene) {
            self.known = None;
        }
        let shared = &self.shared;
        let dark = |phase, line| {
            shared.light.set(false);
            shared.enter(phase, Leds::Off, line);
            Next::Person
        };
        match end {
            #[cfg(not(target_family = "wasm"))]
            End::Told => Next::Connect { person_said: false },
            // A person allowed light before another scene.
            End::Scene => Next::Connect { person_said: true },
            End::Gone(why) => {
                lock(&shared.camera).event(Level::Error, why.clone());
                shared.enter(Phase::Lost, Leds::Unknown, format!("{why}; trying again"));
                Next::Retry
            }
            End::Fault(fault) => dark(Phase::Fault, switched_off(fault)),
            End::Dark(why) => {
                lock(&shared.camera).event(Level::Error, why.clone());
                dark(Phase::Fault, why)
            }
            End::Uncalibrated(why) => {
                lock(&shared.camera).event(Level::Error, why.clone());
                dark(Phase::Uncalibrated, why)
            }
        }
    }

    /// Records that a session begins.
    pub(super) fn greeted(&mut self, connected: &mut Connected) {
        let Connected { session, note, flat_field, .. } = connected;
        for text in session.reports().lines.iter().cloned().chain(note.take()) {
            lock(&self.shared.camera).event(Level::Info, text);
        }
        if let Some(kept) = flat_field {
            lock(&self.shared.camera).event(Level::Info, kept.summary());
        }
        self.flat_field = flat_field.as_ref().map(|kept| kept.flat.clone());
    }

    /// The plan that pages want.
    fn wanted(&self) -> Plan {
        let settings = lock(&self.shared.settings);
        Plan { measuring: Some(settings.measuring.clone()), record: settings.record }
    }

    /// Whether the run that was prepared last is still wanted.
    pub(super) fn goes_on(&self) -> bool {
        !self.shared.is_over()
            && self.shared.light.is_on()
            && !self.shared.stage.has_changed()
            && self.wanted() == self.plan
    }

    /// Number of frames that were put into the slot.
    pub(super) fn offered(&self) -> u64 {
        self.offered
    }

    /// Ends recording. A person must begin another one.
    fn record_no_more(&self) {
        lock(&self.shared.settings).record = false;
    }

    /// The setup and the options of the next run, which begins now.
    pub(super) fn prepare(&mut self, connected: &Connected) -> CaptureOptions {
        (self.now, self.fault) = (None, None);
        let line = "preparing: latency and settling are measured, or the setup is sent";
        self.shared.enter(Phase::Preparing, Leds::On, line.to_owned());
        self.plan = self.wanted();
        // Settings are checked before they are kept.
        let setup = self.plan.measuring.as_ref().and_then(|m| m.setup(&self.base).ok());
        let setup = setup.unwrap_or_else(|| self.base.clone());
        let folder = self.record_to.clone().filter(|_| self.plan.record);
        // A calibration holds for all runs of a session, and before any scene. Patterns without
        // complements need the dark level of the moment.
        let serial = &connected.session.identity().serial;
        let known = self.known.as_ref().filter(|(of, _)| of == serial && setup.differential);
        let calibration = match (&connected.calibration, known) {
            (Calibration::Measure | Calibration::MeasureOr(_), Some((_, settling))) => {
                Calibration::Kept(settling.clone())
            }
            (calibration, _) => calibration.clone(),
        };
        let target = folder.map(Target::FirstFree);
        let record = target.zip(self.made.clone()).map(|(target, made)| Record { target, made });
        CaptureOptions { setup, frames: None, calibration, record }
    }

    /// Records the end of a run. `None` if the run was stopped from here. Fails only if the run is
    /// the first of all and could not begin.
    pub(super) fn captured(
        &mut self,
        connected: &Connected,
        captured: Result<Capture, CaptureError>,
    ) -> Result<Option<End>, CaptureError> {
        let captured = match captured {
            Ok(captured) => captured,
            Err(error @ CaptureError::Calibration(_)) => {
                return Ok(Some(End::Uncalibrated(causes::in_one_line(&error))));
            }
            Err(CaptureError::Stopped) => return Ok(None),
            // The run has ended, the camera has not.
            Err(error @ (CaptureError::Recording { .. } | CaptureError::RecordingCut { .. })) => {
                if let CaptureError::RecordingCut { captured, .. } = &error {
                    self.ended_with(captured.counters);
                    self.failed = lock(&self.shared.camera).camera.said.failed_checks;
                }
                self.record_no_more();
                lock(&self.shared.camera).event(Level::Error, causes::in_one_line(&error));
                return Ok(None);
            }
            Err(error) if !self.begun => return Err(error),
            // The cause of the fault persists. When the cause is gone, the LEDs must not go on by
            // themselves.
            Err(CaptureError::Session(SessionError::Refused {
                refusal: Refusal::Fault(fault),
                ..
            })) => return Ok(Some(End::Fault(fault))),
            Err(error) => return Ok(Some(End::Gone(causes::in_one_line(&error)))),
        };
        self.ended_with(captured.counters);
        self.failed = self.failed + captured.failed_checks;
        let mut log = lock(&self.shared.camera);
        let newest_us = log.camera.said.device_time_us;
        log.counted(newest_us, self.failed);
        drop(log);
        let missing = captured.missing();
        if let Some(path) = &captured.recording {
            self.recorded(path, captured.counters.received);
        }
        if let Some(settling) = captured.settling {
            self.known = Some((connected.session.identity().serial.clone(), settling));
        }
        let end = match (self.fault, captured.ended) {
            // The link may be lost right after the fault.
            (Some(fault), _) | (None, Ended::Fault(fault)) => Some(End::Fault(fault)),
            (None, Ended::LinkLost(error) | Ended::Unconfirmed(error)) => {
                Some(End::Gone(causes::in_one_line(&error)))
            }
            (None, Ended::WrongNumber { .. } | Ended::Junk { .. } | Ended::NoFrames { .. }) => {
                Some(End::Gone(missing.unwrap_or_default()))
            }
            (None, Ended::Complete | Ended::Stopped(_)) => None,
        };
        // A recording goes on in a new file if the measurement was changed, and ends otherwise.
        if end.is_some() || !self.shared.light.is_on() {
            self.record_no_more();
        }
        Ok(end)
    }

    /// Records the account of a run that has ended.
    fn ended_with(&mut self, run: LossCounters) {
        self.shared.slot.account(self.earlier, run);
        self.earlier = self.earlier + run;
    }

    /// Reports a recording.
    fn recorded(&self, path: &Path, frames: u64) {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        let frames = count(frames, "frame");
        lock(&self.shared.camera).event(Level::Info, format!("recorded {frames} in {name}"));
    }
}

impl Observer for Live {
    fn begins(
        &mut self,
        setup: &MeasurementSetup,
        settling: Option<&Settling>,
        problem: Option<&CalibrationError>,
    ) {
        let run = RunSetup {
            setup: setup.clone(),
            settling: settling.cloned(),
            flat_field: self.flat_field.clone(),
        };
        self.now = Some((Arc::new(run), Newest::new(setup)));
        (self.depth, self.begun) = (None, true);
        let mut log = lock(&self.shared.camera);
        if let Some(problem) = problem {
            let problem = causes::in_one_line(problem);
            log.event(Level::Warning, format!("the kept calibration is used: {problem}"));
        }
        log.measuring(setup, settling.is_some());
    }

    fn arrived(&mut self, at: Instant) {
        self.arrived = at;
    }

    fn frame(&mut self, frame: &Frame<'_>, counters: &LossCounters) {
        let Some((run, newest)) = &mut self.now else { return };
        self.shared.passed(Passed::Counted, self.arrived);
        newest.push(frame, lock(&self.shared.settings).frames as usize);
        self.offered += 1;
        let look = Look {
            seen: Seen::Camera {
                frames: Box::new(newest.clone()),
                run: Arc::clone(run),
                depth: self.depth.clone(),
            },
            arrived: self.arrived,
            counters: *counters,
            newest: self.offered,
        };
        self.shared.slot.offer(look, self.earlier, *counters);
    }

    fn message(&mut self, message: &DeviceMessage<'_>) {
        match message {
            DeviceMessage::Depth(depth) => {
                self.depth = depth_map(&self.model, depth).map(Arc::new);
            }
            DeviceMessage::Event(event) => {
                if let EventKind::Fault(fault) = event.kind {
                    self.fault = Some(fault);
                }
            }
            _ => {}
        }
        self.shared.note(message);
    }

    fn watch(&mut self, progress: &Progress) -> ControlFlow<StopCause> {
        self.shared.slot.account(self.earlier, progress.counters);
        let failed = self.failed + progress.failed_checks;
        lock(&self.shared.camera).counted(progress.device_time_us, failed);
        self.look_at_load(progress);
        match self.goes_on() {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(StopCause::of_program()),
        }
    }
}

/// The depth map in the camera's image; `None` for a sensor whose zones are not known.
fn depth_map(model: &CameraModel, depth: &Depth<'_>) -> Option<DepthImage> {
    let pixels_m = depth_image::pixels_m(model, depth)?;
    let map = DepthMaps::new(pixels_m.clone(), [1, SIDE, SIDE], 1).ok()?;
    Some(DepthImage { map, pixels_m })
}
