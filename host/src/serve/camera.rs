//! The camera's thread: drains every frame, hands the newest to the slot, and looks for a camera that has gone.
//!
//! The one law: it waits for the camera and for nobody else. After a fault LEDs go on again only when a person says so.

use super::camera_log::Phase;
use super::slot::{Look, RunSetup};
use super::{ForeignError, Shared, lock};
use crate::account::LossCounters;
use crate::calibration::{CalibrationError, Settling};
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

/// Between two looks for a camera that has gone.
const RETRY: Duration = Duration::from_secs(1);
/// Between two looks whether to go on.
const TICK: Duration = Duration::from_millis(50);

/// A camera that has answered, and what is known of its response.
pub struct Connected {
    /// The conversation.
    pub session: Session,
    /// Where latency and settling come from.
    pub calibration: Calibration,
    /// What is to be said about that.
    pub note: Option<String>,
}

/// How to find the camera again.
pub type Connect = Box<dyn FnMut() -> Result<Connected, ForeignError> + Send>;

/// A camera and how to measure with it.
pub struct CameraSource {
    /// As the command line names it.
    pub address: String,
    /// The measurement. Its latency is replaced by that of the calibration, where there is one.
    pub setup: MeasurementSetup,
    /// Where the depth sensor's zones lie in the image.
    pub model: CameraModel,
    /// Finds it again.
    pub connect: Connect,
}

/// What ended a run.
enum End {
    /// All is over.
    Told,
    /// The camera has gone, in one line.
    Gone(String),
    /// It switched its LEDs off.
    Fault(Fault),
    /// Its latency is not known, in one line.
    Uncalibrated(String),
}

/// Measures until told to stop.
///
/// # Errors
/// [`CaptureError`] where the first run cannot even begin.
pub fn run(
    shared: &Shared,
    mut source: CameraSource,
    first: Connected,
) -> Result<(), CaptureError> {
    let earlier = LossCounters::default();
    let model = source.model.clone();
    let mut live =
        Live { shared, model, earlier, now: None, depth: None, fault: None, begun: false };
    let mut next = Some(first);
    // Whoever starts this program has the camera in sight.
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
        // The link is let go before the camera is looked for again.
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

/// The fault that stands in a camera that has come back. That its host was gone is none: it is here again.
fn standing_fault(session: &mut Session) -> Option<Fault> {
    // A camera that does not answer will not measure either, and that says why.
    session.status(&mut IgnorePackets).ok()?.fault.filter(|fault| *fault != Fault::HostSilent)
}

/// The camera has gone: rests before it is looked for.
fn gone(shared: &Shared, why: &str) {
    let mut log = lock(&shared.camera);
    log.event(why.to_owned());
    log.enter(Phase::Lost, format!("{why}; trying again"));
    drop(log);
    shared.rest(RETRY);
}

/// Waits until somebody says that LEDs may go on again.
fn await_person(shared: &Shared, phase: Phase, line: String) {
    lock(&shared.camera).enter(phase, line);
    shared.resume.store(false, Ordering::Relaxed);
    while !shared.is_over() && !shared.resume.swap(false, Ordering::Relaxed) {
        std::thread::sleep(TICK);
    }
}

impl Shared {
    /// Rests for a while, but not when all is over.
    fn rest(&self, time: Duration) {
        let started = Instant::now();
        while !self.is_over() && started.elapsed() < time {
            std::thread::sleep(TICK);
        }
    }
}

/// Sees every frame of a run and hands the newest over.
struct Live<'s> {
    shared: &'s Shared,
    model: CameraModel,
    /// The account of the runs before.
    earlier: LossCounters,
    now: Option<(Arc<RunSetup>, Newest)>,
    depth: Option<Arc<DepthMaps>>,
    /// What the camera says has switched its LEDs off.
    fault: Option<Fault>,
    /// Whether any run has begun.
    begun: bool,
}

impl Live<'_> {
    /// One run. Fails where it is the first and cannot begin.
    fn measure(
        &mut self,
        connected: &mut Connected,
        setup: MeasurementSetup,
    ) -> Result<End, CaptureError> {
        let Connected { session, calibration, note } = connected;
        for text in session.reports().iter().cloned().chain(note.take()) {
            lock(&self.shared.camera).event(text);
        }
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
            // Its cause is not gone yet. When it is, LEDs must not go on by themselves.
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
            // The link may have gone right after it.
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
        let run = RunSetup { setup: setup.clone(), settling: settling.cloned() };
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

/// The depth map in the camera's image; none for a sensor of other than 8 x 8 zones, of which it is not known where they lie.
fn depth_map(model: &CameraModel, depth: &Depth<'_>) -> Option<DepthMaps> {
    let zones_mm: Vec<u16> = depth.distances_mm.iter().collect();
    let field = model.projector().field_over_distance();
    let view = model.depth_geometry().view(zones_mm.as_slice().try_into().ok()?, field);
    let pixels_m = view.pixels_mm.iter().map(|&mm| f32::from(mm) * 1e-3).collect();
    DepthMaps::new(pixels_m, [1, SIDE, SIDE], 1).ok()
}
