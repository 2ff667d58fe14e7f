//! The camera's thread: receives every frame, puts the newest into the slot, and reconnects after
//! the camera has gone.
//!
//! # Invariant
//! The thread waits for the camera only. After a fault the LEDs go on again only when a person asks
//! (`after_a_fault_leds_go_on_again_only_when_a_person_says_so` in `host/src/serve/tests.rs`).

use super::camera_log::Phase;
use super::slot::{Look, RunSetup};
use super::{ForeignError, Shared, lock};
use crate::account::LossCounters;
use crate::calibration::{CalibrationError, FlatField, KeptFlatField, Settling};
use crate::capture::{
    Calibration, CaptureError, CaptureOptions, Ended, Observer, Progress, observe,
};
use crate::integrate::Newest;
use crate::session::{IgnorePackets, Session, SessionError};
use crate::setup::MeasurementSetup;
use crate::{causes, events};
use nirspi_nets::DepthMaps;
use nirspi_optics::{CameraModel, SIDE};
use nirspi_wire::{Depth, DeviceMessage, EventKind, Fault, Frame, Refusal};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Time between two attempts to reconnect.
const RETRY: Duration = Duration::from_secs(1);
/// Time between two checks whether to stop.
const TICK: Duration = Duration::from_millis(50);

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

/// A function that connects to the camera again.
pub type Connect = Box<dyn FnMut() -> Result<Connected, ForeignError> + Send>;

/// A camera and its measurement.
pub struct CameraSource {
    /// The camera's address as on the command line.
    pub address: String,
    /// The measurement. If there is a calibration, its latency replaces the latency of the setup.
    pub setup: MeasurementSetup,
    /// Where the depth sensor's zones lie in the image.
    pub model: CameraModel,
    /// Connects to the camera again.
    pub connect: Connect,
}

/// Why a run ended.
enum End {
    /// The server is stopping.
    Told,
    /// The link to the camera is gone, for this reason in one line.
    Gone(String),
    /// The camera switched its LEDs off.
    Fault(Fault),
    /// The camera's latency is not known, for this reason in one line.
    Uncalibrated(String),
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
    let earlier = LossCounters::default();
    let model = source.model.clone();
    let mut live = Live {
        shared,
        model,
        earlier,
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
            None => match (source.connect)() {
                Ok(connected) => {
                    lock(&shared.camera).greeted(connected.session.identity());
                    connected
                }
                Err(problem) => {
                    let problem = causes::in_one_line(&*problem);
                    lock(&shared.camera).enter(Phase::Lost, format!("{problem}; trying again"));
                    shared.rest(RETRY);
                    continue;
                }
            },
        };
        let standing = if person_said { None } else { standing_fault(&mut connected.session) };
        person_said = false;
        let end = match standing {
            Some(fault) => End::Fault(fault),
            None => live.measure(&mut connected, source.setup.clone())?,
        };
        // The old link is closed before reconnecting.
        drop(connected);
        match end {
            End::Told => {}
            End::Gone(why) => gone(shared, &why),
            End::Fault(fault) => {
                let line = format!("the camera switched its LEDs off: {fault}");
                await_person(shared, Phase::Fault, line);
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

/// The fault still latched after reconnecting. `HostSilent` does not count: reconnecting clears its
/// cause.
fn standing_fault(session: &mut Session) -> Option<Fault> {
    // A camera that does not answer will not measure either; the measurement then reports the
    // reason.
    session.status(&mut IgnorePackets).ok()?.fault.filter(|fault| *fault != Fault::HostSilent)
}

/// Reports that the link is gone, and waits before reconnecting.
fn gone(shared: &Shared, why: &str) {
    let mut log = lock(&shared.camera);
    log.event(why.to_owned());
    log.enter(Phase::Lost, format!("{why}; trying again"));
    drop(log);
    shared.rest(RETRY);
}

/// Waits until a person allows the LEDs to go on again.
fn await_person(shared: &Shared, phase: Phase, line: String) {
    lock(&shared.camera).enter(phase, line);
    shared.resume.store(false, Ordering::Relaxed);
    while !shared.is_over() && !shared.resume.swap(false, Ordering::Relaxed) {
        std::thread::sleep(TICK);
    }
}

impl Shared {
    /// Waits for `time`, or until the server stops.
    fn rest(&self, time: Duration) {
        let started = Instant::now();
        while !self.is_over() && started.elapsed() < time {
            std::thread::sleep(TICK);
        }
    }
}

/// Receives every frame of a run and puts the newest into the slot.
struct Live<'s> {
    shared: &'s Shared,
    model: CameraModel,
    /// The loss counters of all earlier runs.
    earlier: LossCounters,
    now: Option<(Arc<RunSetup>, Newest)>,
    /// The flat field of the connected camera.
    flat_field: Option<FlatField>,
    depth: Option<Arc<DepthMaps>>,
    /// The fault that switched the LEDs off, as reported by the camera.
    fault: Option<Fault>,
    /// Whether any run has begun.
    begun: bool,
}

impl Live<'_> {
    /// One run. Fails only if the run is the first and cannot begin.
    fn measure(
        &mut self,
        connected: &mut Connected,
        setup: MeasurementSetup,
    ) -> Result<End, CaptureError> {
        let Connected { session, calibration, note, flat_field } = connected;
        for text in session.reports().iter().cloned().chain(note.take()) {
            lock(&self.shared.camera).event(text);
        }
        if let Some(kept) = flat_field {
            lock(&self.shared.camera).event(kept.summary());
        }
        self.flat_field = flat_field.as_ref().map(|kept| kept.flat.clone());
        let calibration = calibration.clone();
        let options = CaptureOptions { setup, frames: None, calibration, record: None };
        (self.now, self.fault) = (None, None);
        let captured = match observe(session, &options, self) {
            Ok(captured) => captured,
            Err(error @ CaptureError::Calibration(_)) => {
                return Ok(End::Uncalibrated(causes::in_one_line(&error)));
            }
            Err(CaptureError::Stopped) => return Ok(End::Told),
            Err(error) if !self.begun => return Err(error),
            // The cause of the fault persists. When the cause is gone, the LEDs must not go on by
            // themselves.
            Err(CaptureError::Session(SessionError::Refused {
                refusal: Refusal::Fault(fault),
                ..
            })) => return Ok(End::Fault(fault)),
            Err(error) => return Ok(End::Gone(causes::in_one_line(&error))),
        };
        self.earlier = self.earlier + captured.counters;
        self.shared.slot.account(self.earlier);
        let missing = captured.missing();
        Ok(match (self.fault, captured.ended) {
            // The link may be lost right after the fault.
            (Some(fault), _) | (None, Ended::Fault(fault)) => End::Fault(fault),
            (None, Ended::LinkLost(error) | Ended::Unconfirmed(error)) => {
                End::Gone(causes::in_one_line(&error))
            }
            (None, Ended::WrongNumber { .. } | Ended::Junk { .. }) => {
                End::Gone(missing.unwrap_or_default())
            }
            (None, Ended::Complete | Ended::Stopped) => End::Told,
        })
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
        let text = match message {
            DeviceMessage::Event(event) => {
                if let EventKind::Fault(fault) = event.kind {
                    self.fault = Some(fault);
                }
                events::as_it_happens(&event.kind)
            }
            DeviceMessage::Crash(report) => events::crash(report),
            DeviceMessage::Depth(depth) => {
                self.depth = depth_map(&self.model, depth).map(Arc::new);
                return;
            }
            _ => return,
        };
        lock(&self.shared.camera).event(text);
    }

    fn watch(&mut self, progress: &Progress) -> ControlFlow<()> {
        self.shared.slot.account(self.earlier + progress.counters);
        if self.shared.is_over() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// The depth map in the camera's image; `None` for a sensor with other than 8 x 8 zones, because
/// the positions of its zones are not known.
fn depth_map(model: &CameraModel, depth: &Depth<'_>) -> Option<DepthMaps> {
    let zones_mm: Vec<u16> = depth.distances_mm.iter().collect();
    let field = model.projector().field_over_distance();
    let view = model.depth_geometry().view(zones_mm.as_slice().try_into().ok()?, field);
    let pixels_m = view.pixels_mm.iter().map(|&mm| f32::from(mm) * 1e-3).collect();
    DepthMaps::new(pixels_m, [1, SIDE, SIDE], 1).ok()
}
