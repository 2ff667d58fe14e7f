//! The camera's thread: drains every frame, hands the newest to the slot, and looks for a camera that has gone.
//!
//! The one law: it waits for the camera and for nobody else. After a fault LEDs go on again only when a person says so.

use super::camera_log::Phase;
use super::slot::{Look, RunSetup};
use super::{Shared, lock};
use crate::account::LossCounters;
use crate::calibrate::{CalibrationError, Settling};
use crate::capture::{
    Calibration, CaptureError, CaptureOptions, Ended, Observer, Progress, observe,
};
use crate::events;
use crate::integrate::Newest;
use crate::session::{Session, SessionError};
use crate::setup::MeasurementSetup;
use nirspi_nets::DepthMaps;
use nirspi_wire::{Depth, DeviceMessage, Fault, Frame, Refusal};
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

/// How to find the camera again; one line where that fails.
pub type Connect = Box<dyn FnMut() -> Result<Connected, String> + Send>;

/// A camera and how to measure with it.
pub struct CameraSource {
    /// As the command line names it.
    pub address: String,
    /// The measurement. Its latency is replaced by that of the calibration, where there is one.
    pub setup: MeasurementSetup,
    /// Finds it again.
    pub connect: Connect,
}

/// Measures until told to stop.
///
/// # Errors
/// One line, where the first run cannot even begin.
pub fn run(shared: &Shared, mut source: CameraSource, first: Connected) -> Result<(), String> {
    let mut live = Live { shared, earlier: LossCounters::default(), now: None, depth: None };
    let mut next = Some(first);
    let mut begun = false;
    while !shared.is_over() {
        let Connected { mut session, calibration, note } = match next.take() {
            Some(connected) => connected,
            None => match (source.connect)() {
                Ok(connected) => {
                    lock(&shared.camera).greeted(connected.session.identity());
                    connected
                }
                Err(problem) => {
                    lock(&shared.camera).enter(Phase::Lost, format!("{problem}; trying again"));
                    shared.rest(RETRY);
                    continue;
                }
            },
        };
        for text in session.reports().iter().cloned().chain(note) {
            lock(&shared.camera).event(text);
        }
        let setup = source.setup.clone();
        let options = CaptureOptions { setup, frames: None, calibration, record: None };
        let ended = observe(&mut session, &options, &mut live);
        // The link is let go before the camera is looked for again.
        drop(session);
        begun |= live.now.take().is_some();
        match ended {
            Ok(captured) => {
                live.earlier = live.earlier + captured.counters;
                shared.slot.account(live.earlier);
                match captured.ended {
                    Ended::Complete | Ended::Stopped => {}
                    Ended::LinkLost(error) => gone(shared, &error.to_string()),
                    Ended::Fault(fault) => await_person(shared, fault),
                }
            }
            Err(error) if !begun => return Err(error.to_string()),
            // Its cause is not gone yet. When it is, LEDs must not go on by themselves.
            Err(CaptureError::Session(SessionError::Refused {
                refusal: Refusal::Fault(fault),
                ..
            })) => await_person(shared, fault),
            Err(error) => gone(shared, &error.to_string()),
        }
    }
    Ok(())
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
fn await_person(shared: &Shared, fault: Fault) {
    let line = format!("the camera switched its LEDs off: {fault:?}");
    lock(&shared.camera).enter(Phase::Fault, line);
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
    /// The account of the runs before.
    earlier: LossCounters,
    now: Option<(Arc<RunSetup>, Newest)>,
    depth: Option<Arc<DepthMaps>>,
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
        self.depth = None;
        let mut log = lock(&self.shared.camera);
        if let Some(problem) = problem {
            log.event(format!("not calibrated: {problem}"));
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
            DeviceMessage::Event(event) => events::as_it_happens(&event.kind),
            DeviceMessage::Crash(report) => events::crash(report),
            DeviceMessage::Depth(depth) => {
                self.depth = depth_map(depth).map(Arc::new);
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

/// A depth map of a side that fusion takes.
fn depth_map(depth: &Depth<'_>) -> Option<DepthMaps> {
    let side = usize::from(depth.side);
    let zones_m = depth.distances_mm.iter().map(|mm| f32::from(mm) * 1e-3).collect();
    DepthMaps::new(zones_m, [1, side, side], 1).ok()
}
