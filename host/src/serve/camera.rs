//! The camera's thread: receives every frame, puts the newest into the slot, and reconnects after
//! the camera has gone.
//!
//! # Invariant
//! The thread waits for the camera only. After a fault or a stop the LEDs go on again only when a
//! person asks (`after_a_fault_leds_go_on_again_only_when_a_person_says_so` and
//! `a_person_stops_a_camera_and_only_a_person_starts_it_again` in `host/src/serve/tests.rs`).

use super::camera_log::Phase;
use super::light::Leds;
use super::settings::Measuring;
use super::slot::{DepthImage, Look, RunSetup};
use super::stage::StagedScene;
use super::{ForeignError, Shared, lock};
use crate::account::LossCounters;
use crate::calibration::{CalibrationError, FlatField, KeptFlatField, Settling};
use crate::capture::{
    Calibration, CaptureError, CaptureOptions, Ended, Observer, Progress, observe,
};
use crate::integrate::Newest;
use crate::recording::Target;
use crate::session::{IgnorePackets, Listener, Session, SessionError, request};
use crate::setup::MeasurementSetup;
use crate::{causes, events};
use nirspi_nets::DepthMaps;
use nirspi_optics::{CameraModel, SIDE};
use nirspi_recon::words::count;
use nirspi_wire::{
    Depth, DeviceMessage, EventKind, Fault, Frame, PacketError, Refusal, State as Device,
};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Time between two attempts to reconnect.
const RETRY: Duration = Duration::from_secs(1);
/// Time between two checks whether to stop.
const TICK: Duration = Duration::from_millis(50);
/// Time between two questions to a camera whose LEDs a person switched off.
const ASK: Duration = Duration::from_secs(1);

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
enum End {
    /// The server is stopping.
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

/// Measures until the server stops.
///
/// # Errors
/// [`CaptureError`] if the first run cannot begin.
pub fn run(
    shared: &Shared,
    mut source: CameraSource,
    first: Connected,
) -> Result<(), CaptureError> {
    let mut live = Live {
        shared,
        model: source.model.clone(),
        base: source.setup.clone(),
        record_to: source.record_to.take(),
        plan: Plan::default(),
        known: None,
        earlier: LossCounters::default(),
        now: None,
        flat_field: None,
        depth: None,
        fault: None,
        begun: false,
    };
    let mut next = Some(first);
    // A person who starts this program can see the camera.
    let mut person_said = true;
    while !shared.is_over() {
        let mut connected = match next.take() {
            Some(connected) => connected,
            None => match reconnect(shared, &mut source.connect) {
                Ok(connected) => connected,
                Err(None) => continue,
                Err(Some(problem)) => {
                    shared.enter(Phase::Lost, Leds::Unknown, format!("{problem}; trying again"));
                    shared.rest(RETRY);
                    continue;
                }
            },
        };
        let dark = if person_said { None } else { why_dark(&mut connected.session) };
        person_said = false;
        let end = match dark {
            Some(why) => End::Dark(why),
            None => live.session(&mut connected)?,
        };
        // The old link is closed before reconnecting.
        drop(connected);
        // A camera that was away may have other gateware.
        live.known = live.known.filter(|_| matches!(end, End::Scene));
        match end {
            End::Told => {}
            // A person allowed light before another scene.
            End::Scene => person_said = true,
            End::Gone(why) => gone(shared, &why),
            End::Fault(fault) => {
                await_person(shared, Phase::Fault, switched_off(fault));
                person_said = true;
            }
            End::Dark(why) => {
                lock(&shared.camera).event(why.clone());
                await_person(shared, Phase::Fault, why);
                person_said = true;
            }
            End::Uncalibrated(why) => {
                lock(&shared.camera).event(why.clone());
                await_person(shared, Phase::Uncalibrated, why);
                person_said = true;
            }
        }
    }
    Ok(())
}

/// Connects to the camera again, before the scene that is wanted. Fails without a reason if the
/// scene is refused and the scene before it can be shown.
fn reconnect(shared: &Shared, connect: &mut Connect) -> Result<Connected, Option<String>> {
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
                lock(&shared.camera).event(format!("the scene is not shown: {problem}"));
            }
            Err((!refused).then_some(problem))
        }
    }
}

/// Why a camera that has come back stays dark until a person agrees: a fault that is still latched, whatever
/// its kind, or a crash of the firmware since the last session.
fn why_dark(session: &mut Session) -> Option<String> {
    // A camera that does not answer will not measure either; the measurement then reports the
    // reason.
    let crash = session.await_reports().ok()?.iter().find(|told| events::is_crash(told)).cloned();
    let fault = session.status(&mut IgnorePackets).ok()?.fault;
    fault.map(switched_off).or(crash)
}

fn switched_off(fault: Fault) -> String {
    format!("the camera switched its LEDs off: {fault}")
}

/// Reports that the link is gone, and waits before reconnecting.
fn gone(shared: &Shared, why: &str) {
    lock(&shared.camera).event(why.to_owned());
    shared.enter(Phase::Lost, Leds::Unknown, format!("{why}; trying again"));
    shared.rest(RETRY);
}

/// Switches light off, and waits until a person switches it on again.
fn await_person(shared: &Shared, phase: Phase, line: String) {
    shared.light.set(false);
    shared.enter(phase, Leds::Off, line);
    while !shared.is_over() && !shared.light.is_on() {
        std::thread::sleep(TICK);
    }
}

/// Keeps a camera whose LEDs a person switched off, until a person switches them on again.
///
/// # Errors
/// If the link ends.
fn stopped(shared: &Shared, session: &mut Session) -> Result<(), SessionError> {
    let mut asked: Option<Instant> = None;
    let line = "stopped: a person switched the LEDs off";
    while !shared.is_over() && !shared.light.is_on() && !shared.stage.has_changed() {
        if asked.is_none_or(|asked| asked.elapsed() > ASK) {
            // The camera's own word counts, whatever was sent before.
            let dark = session.status(&mut EventLog(shared))?.state != Device::Running;
            if !dark {
                session.command(request::Stop, &mut EventLog(shared))?;
            }
            asked = dark.then(Instant::now);
            let leds = if dark { Leds::Off } else { Leds::On };
            shared.enter(Phase::Stopped, leds, line.to_owned());
        }
        session.listen(TICK, &mut EventLog(shared))?;
        // The link in memory does not wait.
        std::thread::sleep(TICK);
    }
    Ok(())
}

/// Adds events to the log, and ignores frames.
struct EventLog<'s>(&'s Shared);

impl Listener for EventLog<'_> {
    fn packet(&mut self, _: &[u8], content: &Result<DeviceMessage<'_>, PacketError>) {
        if let Some(text) = content.as_ref().ok().and_then(in_words) {
            lock(&self.0.camera).event(text);
        }
    }
}

/// An event or a crash in words; `None` for any other message.
fn in_words(message: &DeviceMessage<'_>) -> Option<String> {
    match message {
        DeviceMessage::Event(event) => Some(events::as_it_happens(&event.kind)),
        DeviceMessage::Crash(report) => Some(events::crash(report)),
        _ => None,
    }
}

impl Shared {
    /// Records a new phase, and tells pages at once.
    fn enter(&self, phase: Phase, leds: Leds, line: String) {
        let mut log = lock(&self.camera);
        log.camera.leds = leds;
        log.enter(phase, line);
        drop(log);
        self.slot.wake();
    }

    /// Waits for `time`, or until the server stops.
    fn rest(&self, time: Duration) {
        let started = Instant::now();
        while !self.is_over() && started.elapsed() < time {
            std::thread::sleep(TICK);
        }
    }
}

/// What a run was started for. Another plan needs another run.
#[derive(Debug, Clone, PartialEq, Default)]
struct Plan {
    measuring: Option<Measuring>,
    record: bool,
}

/// Receives every frame of a run and puts the newest into the slot.
struct Live<'s> {
    shared: &'s Shared,
    model: CameraModel,
    /// The setup of the command line, with the timing for all runs.
    base: MeasurementSetup,
    record_to: Option<PathBuf>,
    /// The plan of the current run.
    plan: Plan,
    /// The serial number and the response of the camera, if a run has measured the response.
    known: Option<(String, Settling)>,
    /// The loss counters of all earlier runs.
    earlier: LossCounters,
    now: Option<(Arc<RunSetup>, Newest)>,
    /// The flat field of the connected camera.
    flat_field: Option<FlatField>,
    depth: Option<Arc<DepthImage>>,
    /// The fault that switched the LEDs off, as reported by the camera.
    fault: Option<Fault>,
    /// Whether any run has begun.
    begun: bool,
}

impl Live<'_> {
    /// One session: runs, and pauses without light between the runs. Fails only if the first run of
    /// all cannot begin.
    fn session(&mut self, connected: &mut Connected) -> Result<End, CaptureError> {
        let Connected { session, note, flat_field, .. } = connected;
        for text in session.reports().iter().cloned().chain(note.take()) {
            lock(&self.shared.camera).event(text);
        }
        if let Some(kept) = flat_field {
            lock(&self.shared.camera).event(kept.summary());
        }
        self.flat_field = flat_field.as_ref().map(|kept| kept.flat.clone());
        while !self.shared.is_over() {
            let end = if self.shared.stage.has_changed() {
                Some(End::Scene)
            } else if self.shared.light.is_on() {
                self.measure(connected)?
            } else {
                let stopped = stopped(self.shared, &mut connected.session);
                stopped.err().map(|error| End::Gone(causes::in_one_line(&error)))
            };
            if let Some(end) = end {
                return Ok(end);
            }
        }
        Ok(End::Told)
    }

    /// The plan that pages want.
    fn wanted(&self) -> Plan {
        let settings = lock(&self.shared.settings);
        Plan { measuring: Some(settings.measuring.clone()), record: settings.record }
    }

    /// Ends recording. A person must begin another one.
    fn record_no_more(&self) {
        lock(&self.shared.settings).record = false;
    }

    /// The setup and the options of the next run.
    fn options(&mut self, connected: &Connected) -> CaptureOptions {
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
        CaptureOptions { setup, frames: None, calibration, record: folder.map(Target::FirstFree) }
    }

    /// One run. `None` if the run was stopped from here. Fails only if the run is the first of all
    /// and cannot begin.
    fn measure(&mut self, connected: &mut Connected) -> Result<Option<End>, CaptureError> {
        let options = self.options(connected);
        let session = &mut connected.session;
        (self.now, self.fault) = (None, None);
        let line = "preparing: latency and settling are measured, or the setup is sent";
        self.shared.enter(Phase::Preparing, Leds::On, line.to_owned());
        let captured = match observe(session, &options, self) {
            Ok(captured) => captured,
            Err(error @ CaptureError::Calibration(_)) => {
                return Ok(Some(End::Uncalibrated(causes::in_one_line(&error))));
            }
            Err(CaptureError::Stopped) => return Ok(None),
            // The run has ended, the camera has not.
            Err(error @ (CaptureError::Recording { .. } | CaptureError::RecordingCut { .. })) => {
                if let CaptureError::RecordingCut { counters, .. } = &error {
                    self.earlier = self.earlier + *counters;
                }
                self.record_no_more();
                lock(&self.shared.camera).event(causes::in_one_line(&error));
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
        self.earlier = self.earlier + captured.counters;
        self.shared.slot.account(self.earlier);
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
            (None, Ended::WrongNumber { .. } | Ended::Junk { .. }) => {
                Some(End::Gone(missing.unwrap_or_default()))
            }
            (None, Ended::Complete | Ended::Stopped) => None,
        };
        // A recording goes on in a new file if the measurement was changed, and ends otherwise.
        if end.is_some() || !self.shared.light.is_on() {
            self.record_no_more();
        }
        Ok(end)
    }

    /// Reports a recording.
    fn recorded(&self, path: &Path, frames: u64) {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        let frames = count(frames, "frame");
        lock(&self.shared.camera).event(format!("recorded {frames} in {name}"));
    }
}

impl Observer for Live<'_> {
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
            log.event(format!("the kept calibration is used: {problem}"));
        }
        log.measuring(setup, settling.is_some());
    }

    fn frame(&mut self, frame: &Frame<'_>, counters: &LossCounters) {
        let Some((run, newest)) = &mut self.now else { return };
        newest.push(frame, lock(&self.shared.settings).frames as usize);
        let look = Look { sum: newest.sum(), run: Arc::clone(run), depth: self.depth.clone() };
        self.shared.slot.offer(look, self.earlier + *counters);
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
        if let Some(text) = in_words(message) {
            lock(&self.shared.camera).event(text);
        }
    }

    fn watch(&mut self, progress: &Progress) -> ControlFlow<()> {
        self.shared.slot.account(self.earlier + progress.counters);
        let goes_on = !self.shared.is_over()
            && self.shared.light.is_on()
            && !self.shared.stage.has_changed()
            && self.wanted() == self.plan;
        if goes_on { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }
}

/// The depth map in the camera's image; `None` for a sensor with other than 8 x 8 zones, because
/// the positions of its zones are not known.
fn depth_map(model: &CameraModel, depth: &Depth<'_>) -> Option<DepthImage> {
    let zones_mm: Vec<u16> = depth.distances_mm.iter().collect();
    let field = model.projector().field_over_distance();
    let view = model.depth_geometry().view(zones_mm.as_slice().try_into().ok()?, field);
    let pixels_m: Vec<f32> = view.pixels_mm.iter().map(|&mm| f32::from(mm) * 1e-3).collect();
    let map = DepthMaps::new(pixels_m.clone(), [1, SIDE, SIDE], 1).ok()?;
    Some(DepthImage { map, pixels_m })
}
