//! A run of a camera: a thread measures, its user takes the frames.

use super::{State, lock, of_capture, put_back};
use crate::arrays::array;
use crate::errors::{refusal, refused};
use crate::measurement::FlatField;
use crate::work::SIGNALS;
use nirspi::account::LossCounters;
use nirspi::calibration::CalibrationError;
use nirspi::capture::{
    Capture, CaptureError, CaptureOptions, Ended, Observer, Progress, StopCause, observe,
};
use nirspi::events;
use nirspi::frame_time::{Clock, HostClock};
use nirspi::integrate::Integrated;
use nirspi::response::Settling;
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi::source::Source;
use nirspi_recon::Measurements;
use nirspi_wire::{DeviceMessage, Frame};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Instant;

/// What the thread of a run and its user share.
#[derive(Default)]
pub(super) struct Shared {
    stop: AtomicBool,
    counters: Mutex<LossCounters>,
    passed_over: AtomicU64,
    pub(super) events: Mutex<Vec<String>>,
    /// How the run measures: the setup that the camera has accepted, and its settling.
    measures: Mutex<Option<(MeasurementSetup, Option<Settling>)>>,
}

/// Received, lost, corrupt, late; and passed over because the user was slow.
pub(super) type Counted = (u64, u64, u64, u64, u64);

impl Shared {
    pub(super) fn counted(&self) -> Counted {
        let counted = *lock(&self.counters);
        let passed = self.passed_over.load(Ordering::Relaxed);
        (counted.received, counted.lost, counted.corrupt, counted.late, passed)
    }
}

/// The most events that are kept.
const EVENTS: usize = 1000;

/// One frame on its way to the user.
pub(super) struct Item {
    sums: Vec<i64>,
    sequence: u32,
    device_time_us: u64,
    sweeps: u32,
    flags: u16,
    /// The host's time of the first pattern in ns since 1970, by the fit so far.
    time_ns: u64,
}

/// Gives the frames of a run to its user.
pub(super) struct Streaming {
    pub(super) frames: Option<SyncSender<Item>>,
    /// Whether the camera waits for the user.
    pub(super) waits: bool,
    pub(super) shared: Arc<Shared>,
    pub(super) host: HostClock,
    /// The camera's clock in the host's time, from the start of the run on.
    pub(super) clock: Option<Clock>,
    /// The time at which the next frames came out of the link.
    pub(super) arrived_ns: u64,
}

impl Observer for Streaming {
    fn begins(
        &mut self,
        setup: &MeasurementSetup,
        settling: Option<&Settling>,
        _: Option<&CalibrationError>,
    ) {
        *lock(&self.shared.measures) = Some((setup.clone(), settling.cloned()));
        self.clock = Some(Clock::new(setup.frame_ns()));
    }

    fn arrived(&mut self, at: Instant) {
        self.arrived_ns = self.host.ns_of(at);
    }

    fn frame(&mut self, frame: &Frame<'_>, counters: &LossCounters) {
        *lock(&self.shared.counters) = *counters;
        let Some(frames) = &self.frames else { return };
        if self.shared.stop.load(Ordering::Relaxed) {
            return;
        }
        let mut time_ns = self.arrived_ns;
        if let Some(clock) = &mut self.clock {
            clock.arrived(frame.run, frame.device_time_us, self.arrived_ns);
            let at = clock.device_time_us(frame.device_time_us);
            time_ns = clock.fit().map_or(time_ns, |fit| fit.host_ns(at));
        }
        let item = Item {
            sums: frame.samples.iter().collect(),
            sequence: frame.sequence,
            device_time_us: frame.device_time_us,
            sweeps: frame.sweeps,
            flags: frame.flags.0,
            time_ns,
        };
        let gone = if self.waits {
            frames.send(item).is_err()
        } else {
            match frames.try_send(item) {
                Ok(()) => false,
                Err(TrySendError::Full(_)) => {
                    self.shared.passed_over.fetch_add(1, Ordering::Relaxed);
                    false
                }
                Err(TrySendError::Disconnected(_)) => true,
            }
        };
        if gone {
            self.shared.stop.store(true, Ordering::Relaxed);
        }
    }

    fn message(&mut self, message: &DeviceMessage<'_>) {
        let text = match message {
            DeviceMessage::Event(event) => events::as_it_happens(&event.kind),
            DeviceMessage::Crash(report) => events::crash(report),
            _ => return,
        };
        let mut events = lock(&self.shared.events);
        if events.len() < EVENTS {
            events.push(text);
        }
    }

    fn watch(&mut self, progress: &Progress) -> ControlFlow<StopCause> {
        *lock(&self.shared.counters) = progress.counters;
        match self.shared.stop.load(Ordering::Relaxed) {
            true => ControlFlow::Break(StopCause::User),
            false => ControlFlow::Continue(()),
        }
    }
}

type Captured = Result<Capture, CaptureError>;

/// The thread of a run. The session is back before the channel of frames closes.
pub(super) fn run(
    mut session: Box<Session>,
    options: &CaptureOptions,
    mut observer: Streaming,
    state: &Mutex<State>,
) -> Option<Captured> {
    let made = catch_unwind(AssertUnwindSafe(|| observe(&mut session, options, &mut observer)));
    match made {
        Ok(made) => {
            if let Ok(Capture { counters, .. }) = &made {
                *lock(&observer.shared.counters) = *counters;
            }
            put_back(state, session);
            drop(observer);
            Some(made)
        }
        Err(_) => {
            *lock(state) = State::Closed;
            None
        }
    }
}

/// A run of a camera.
#[pyclass(frozen, weakref, module = "nirspi._nirspi")]
pub struct Run {
    pub(super) receiver: Mutex<Option<Receiver<Item>>>,
    pub(super) thread: Mutex<Option<JoinHandle<Option<Captured>>>>,
    pub(super) made: Mutex<Option<Made>>,
    pub(super) shared: Arc<Shared>,
    pub(super) flat: Option<nirspi::calibration::FlatField>,
    pub(super) process: u32,
}

/// The end of a run.
pub(super) enum Made {
    Captured(Box<Capture>),
    Failed(PyErr),
}

type FrameTuple<'py> = (Bound<'py, PyArray1<i64>>, u32, u64, u32, u16, u64);

/// `(n, rows, d, noise of a value of d, flat field)`.
type Readings<'py> =
    (usize, Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<f64>>, Option<f64>, Option<FlatField>);

impl Run {
    fn of_python<'py>(&self, py: Python<'py>, measured: &Measurements) -> Readings<'py> {
        (
            measured.side().pixels(),
            array(py, measured.rows().iter().map(|&row| i64::from(row)).collect()),
            array(py, measured.values().to_vec()),
            measured.noise(),
            self.flat.clone().map(FlatField),
        )
    }

    /// The next frame; `None` at the end of the run. At Ctrl-C the LEDs are off before the exception is.
    fn receive(&self, py: Python<'_>) -> PyResult<Option<Item>> {
        self.owned()?;
        loop {
            let waited = py.detach(|| match &*lock(&self.receiver) {
                Some(receiver) => receiver.recv_timeout(SIGNALS),
                None => Err(RecvTimeoutError::Disconnected),
            });
            match waited {
                Ok(item) => return Ok(Some(item)),
                Err(RecvTimeoutError::Disconnected) => {
                    self.end(py);
                    return Ok(None);
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
            self.look_for_signals(py)?;
        }
    }

    fn look_for_signals(&self, py: Python<'_>) -> PyResult<()> {
        let interrupt = py.check_signals();
        if interrupt.is_err() {
            self.stop(py)?;
        }
        interrupt
    }

    fn owned(&self) -> PyResult<()> {
        match self.process == std::process::id() {
            true => Ok(()),
            false => {
                Err(refused("the camera belongs to the process that opened it, open one here"))
            }
        }
    }

    /// Waits for the end of the run.
    fn end(&self, py: Python<'_>) {
        let made = py.detach(|| lock(&self.thread).take().map(JoinHandle::join));
        let Some(made) = made else { return };
        *lock(&self.made) = Some(match made {
            Ok(Some(Ok(captured))) => Made::Captured(Box::new(captured)),
            Ok(Some(Err(error))) => Made::Failed(of_capture(error)),
            _ => Made::Failed(pyo3::exceptions::PyRuntimeError::new_err(
                "a fault of nirspi, please report it: the camera's thread panicked",
            )),
        });
    }
}

#[pymethods]
impl Run {
    /// The next frame: `(sums, sequence, device_time_us, sweeps, flags, time_ns)`; `None` at the end.
    fn next<'py>(&self, py: Python<'py>) -> PyResult<Option<FrameTuple<'py>>> {
        let item = self.receive(py)?;
        Ok(item.map(|i| {
            let sums = array(py, i.sums);
            (sums, i.sequence, i.device_time_us, i.sweeps, i.flags, i.time_ns)
        }))
    }

    /// All frames until the end: sums, sequence numbers and device times.
    #[expect(clippy::type_complexity, reason = "a tuple for Python")]
    fn collect<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i64>>)>
    {
        let (mut sums, mut sequence, mut times) = (Vec::new(), Vec::new(), Vec::new());
        while let Some(item) = self.receive(py)? {
            sums.extend(item.sums);
            sequence.push(i64::from(item.sequence));
            times.push(i64::try_from(item.device_time_us).unwrap_or(i64::MAX));
            // What has come already comes without looking at the clock.
            py.detach(|| {
                let receiver = lock(&self.receiver);
                while let Some(item) = receiver.as_ref().and_then(|r| r.try_recv().ok()) {
                    sums.extend(item.sums);
                    sequence.push(i64::from(item.sequence));
                    times.push(i64::try_from(item.device_time_us).unwrap_or(i64::MAX));
                    if sequence.len() % 256 == 0 {
                        break;
                    }
                }
            });
            self.look_for_signals(py)?;
        }
        Ok((array(py, sums), array(py, sequence), array(py, times)))
    }

    /// Waits for a run without frames for the user.
    fn wait(&self, py: Python<'_>) -> PyResult<()> {
        self.owned()?;
        loop {
            let over = py.detach(|| {
                let over = lock(&self.thread).as_ref().is_none_or(JoinHandle::is_finished);
                if !over {
                    std::thread::sleep(SIGNALS / 10);
                }
                over
            });
            if over {
                self.end(py);
                return Ok(());
            }
            self.look_for_signals(py)?;
        }
    }

    /// Ends the run: the LEDs are off when this returns.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        if self.process != std::process::id() {
            return Ok(());
        }
        self.shared.stop.store(true, Ordering::Relaxed);
        // A thread that waits for room goes on once the receiver is dropped.
        drop(py.detach(|| lock(&self.receiver).take()));
        self.end(py);
        Ok(())
    }

    /// The account of the run so far.
    #[getter]
    fn account(&self) -> Counted {
        self.shared.counted()
    }

    /// How a run has ended: `(ended in words, what is missing, whether it broke off, path of the recording, seconds)`.
    /// An exception if nothing was captured; `None` while the run goes on.
    #[expect(clippy::type_complexity, reason = "a tuple for Python")]
    fn outcome(
        &self,
        py: Python<'_>,
    ) -> PyResult<Option<(&'static str, Option<String>, bool, Option<PathBuf>, f64)>> {
        match &*lock(&self.made) {
            None => Ok(None),
            Some(Made::Failed(error)) => Err(error.clone_ref(py)),
            Some(Made::Captured(captured)) => {
                let broke = !matches!(captured.ended, Ended::Complete | Ended::Stopped(_));
                Ok(Some((
                    captured.ended.in_words(),
                    captured.missing(),
                    broke,
                    captured.recording.clone(),
                    captured.elapsed.as_secs_f64(),
                )))
            }
        }
    }

    /// The measurement of some frames of the run together, whose sums follow one another:
    /// `(n, rows, d, noise, flat field)`.
    fn readings<'py>(
        &self,
        py: Python<'py>,
        sums: PyReadonlyArray1<'py, i64>,
        sweeps: Vec<u64>,
    ) -> PyResult<Readings<'py>> {
        let measures = lock(&self.shared.measures).clone();
        let Some((setup, settling)) = measures else {
            return Err(refused("the run has not begun, take a frame first"));
        };
        let (sums, patterns) = (sums.as_slice()?, setup.rows.len());
        if sums.len() != sweeps.len() * patterns {
            let (found, frames) = (sums.len(), sweeps.len());
            return Err(refused(format!(
                "{found} sums in {frames} frames, expected {patterns} in each"
            )));
        }
        let mut integrated = Integrated::new(&setup);
        for (frame, &sweeps) in sums.chunks_exact(patterns).zip(&sweeps) {
            integrated.add_sums(frame.iter().copied(), sweeps);
        }
        let measured =
            integrated.measurements(&setup, settling.as_ref(), false).map_err(refusal)?;
        Ok(self.of_python(py, &measured))
    }

    /// The measurement of all frames together: `(n, rows, d, noise, flat field)`, and notes.
    fn measurement<'py>(&self, py: Python<'py>) -> PyResult<(Readings<'py>, Vec<String>)> {
        let held = lock(&self.made);
        let Some(Made::Captured(captured)) = &*held else {
            return Err(refused("the run has not ended, or has failed"));
        };
        let source = Source::of_capture(captured).map_err(refusal)?;
        Ok((self.of_python(py, &source.measurements), source.notes))
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        let thread = lock(&self.thread).take();
        if self.process != std::process::id() {
            // The thread and the camera are the parent's.
            std::mem::forget(thread);
            return;
        }
        self.shared.stop.store(true, Ordering::Relaxed);
        drop(lock(&self.receiver).take());
        // The thread does not need the GIL, and ends within a fraction of a second.
        drop(thread.map(JoinHandle::join));
    }
}
