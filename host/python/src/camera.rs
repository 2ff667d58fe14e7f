//! A camera: real or virtual.
//!
//! # Invariant
//! A run ends with the LEDs off, in whatever way its user leaves it: by the end of the run, an exception, Ctrl-C, `close`,
//! or because nothing refers to it any more (`test_camera.py`). The thread of a run never takes the GIL, so that waiting
//! for its end cannot block it. A child of `fork` leaves the camera of its parent alone.

use crate::arrays::array;
use crate::errors::{of_opening, refusal, refused};
use crate::measurement::FlatField;
use crate::orders::named;
use crate::work::{SIGNALS, long};
use nirspi::account::LossCounters;
use nirspi::calibration::{CalibrationPolicy, Settling};
use nirspi::capture::{
    Calibration, Capture, CaptureError, CaptureOptions, Ended, Observer, Progress, observe,
};
use nirspi::causes::in_one_line;
use nirspi::events;
use nirspi::link::{CameraAddress, Link};
use nirspi::recording::Target;
use nirspi::scene::{SceneMap, SceneSource};
use nirspi::session::{IgnorePackets, Session, SessionError};
use nirspi::setup::MeasurementSetup;
use nirspi::source::Source;
use nirspi::virtual_camera::{
    CameraModel, MemoryLink, VirtualOptics, calibrate_against_white, flat_field_against_white,
};
use nirspi::weather::read_weather;
use nirspi_recon::Sampling;
use nirspi_wire::{DeviceMessage, Frame};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::{PyConnectionError, PyOSError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Frames that wait for the user: of a virtual camera, whose time waits too, and of a real one, which goes on.
const WAITING_VIRTUAL: usize = 1024;
const WAITING: usize = 65_536;
/// Edge of a drawn scene's map of reflectance.
const SCENE_PX: usize = 256;

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Where the session is.
enum State {
    Idle(Box<Session>),
    /// A run has the session.
    Running,
    /// A run has the session, and closes it at its end.
    Closing,
    Closed,
}

/// How a camera is calibrated.
#[derive(Clone)]
enum Calibrated {
    Policy(CalibrationPolicy),
    /// A virtual camera, against its simulated white sheet.
    White(Settling),
}

/// An open camera.
#[pyclass(frozen, module = "nirspi._nirspi")]
pub struct Camera {
    state: Arc<Mutex<State>>,
    setup: MeasurementSetup,
    calibrated: Calibrated,
    flat: Option<nirspi::calibration::FlatField>,
    is_virtual: bool,
    identity: String,
    reports: Vec<String>,
    /// What the last run has counted.
    last: Mutex<Option<Arc<Shared>>>,
    process: u32,
}

/// Options of a camera.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Options<'py> {
    order: String,
    sampling: String,
    sweeps: u32,
    clocks_per_pattern: Option<u16>,
    blanked: Option<u16>,
    differential: bool,
    calibration: String,
    calibration_file: Option<PathBuf>,
    adc_latency: Option<u8>,
    scene: Option<String>,
    scene_map: Option<PyReadonlyArray1<'py, f32>>,
    scene_side_mm: Option<f64>,
    distance_m: Option<f64>,
    weather: Option<String>,
    model: Option<String>,
    model_text: Option<String>,
    seed: u64,
}

impl Options<'_> {
    fn model(&self) -> PyResult<CameraModel> {
        match (&self.model_text, &self.model) {
            (Some(text), _) => CameraModel::parse(text).map_err(refusal),
            (None, Some(name)) => nirspi::virtual_camera::read_camera_model(name).map_err(refusal),
            (None, None) => Ok(CameraModel::paper().clone()),
        }
    }

    fn setup(&self, model: &CameraModel) -> PyResult<MeasurementSetup> {
        let order = named(&self.order)?;
        let sampling: Sampling = self
            .sampling
            .parse()
            .map_err(|error| refused(format!("sampling is {}, {error}", self.sampling)))?;
        let mut setup = MeasurementSetup::new(&order, sampling.share()).map_err(refusal)?;
        // The ranges were checked when the description was read.
        let clocks = self.clocks_per_pattern.unwrap_or(model.readout.clocks_per_pattern as u16);
        setup = setup.timed(clocks, self.blanked.unwrap_or(model.readout.blanked as u16));
        setup.sweeps = self.sweeps;
        setup.differential = self.differential;
        setup.adc_latency = self.adc_latency.unwrap_or(0);
        setup.check().map_err(refusal)?;
        Ok(setup)
    }

    fn policy(&self) -> PyResult<CalibrationPolicy> {
        Ok(match (self.calibration.as_str(), &self.calibration_file) {
            ("off", _) if self.adc_latency.is_none() => {
                return Err(refused("calibration is \"off\", which needs adc_latency"));
            }
            ("off", _) => CalibrationPolicy::Off,
            (_, _) if self.adc_latency.is_some() => {
                return Err(refused("adc_latency belongs to calibration=\"off\""));
            }
            ("file", Some(file)) => CalibrationPolicy::File(file.clone()),
            ("kept", _) => CalibrationPolicy::Kept,
            ("measure", _) => CalibrationPolicy::Measure,
            (other, _) => {
                return Err(refused(format!(
                    "calibration is {other:?}, expected \"kept\", \"measure\", \"off\" or a file"
                )));
            }
        })
    }

    fn map(&self) -> PyResult<SceneMap> {
        if let Some(values) = &self.scene_map {
            let reflectance = crate::arrays::slice(values)?.to_vec();
            let size_px = reflectance.len().isqrt();
            if let Some(at) = reflectance.iter().position(|v| !(0.0..=1.0).contains(v)) {
                let (row, column, value) = (at / size_px, at % size_px, reflectance[at]);
                return Err(refused(format!(
                    "scene is {value} at [{row}, {column}], expected 0 to 1"
                )));
            }
            return Ok(SceneMap {
                name: "array".to_owned(),
                size_px,
                reflectance,
                side_mm: self.scene_side_mm,
            });
        }
        let source: SceneSource =
            self.scene.as_deref().unwrap_or("letter:R").parse().map_err(refusal)?;
        source.load(SCENE_PX).map_err(refusal)
    }

    fn optics(&self, model: &CameraModel) -> PyResult<VirtualOptics> {
        let distance_mm = self.distance_m.map_or(model.projector().focus_distance_mm, |m| m * 1e3);
        if !(distance_mm.is_finite() && distance_mm > 0.0) {
            let found = distance_mm / 1e3;
            return Err(refused(format!(
                "distance_m is {found}, expected a positive number of metres"
            )));
        }
        let optics = VirtualOptics::before(model, &self.map()?, distance_mm).map_err(refusal)?;
        let air = match &self.weather {
            Some(weather) => read_weather(weather).map_err(refusal)?,
            None => model.weather.air.clone(),
        };
        optics.in_air(&air).map_err(refusal)
    }
}

fn of_session(error: SessionError) -> PyErr {
    let text = in_one_line(&error);
    match error {
        SessionError::Refused { .. } | SessionError::Version { .. } => refused(text),
        _ => PyConnectionError::new_err(text),
    }
}

fn of_capture(error: CaptureError) -> PyErr {
    match error {
        CaptureError::Session(error) => of_session(error),
        CaptureError::Recording { .. } | CaptureError::RecordingCut { .. } => {
            PyOSError::new_err(in_one_line(&error))
        }
        error => refusal(error),
    }
}

/// What a run does.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Wanted {
    frames: Option<u32>,
    /// Whether each frame is given to the user.
    stream: bool,
    record: Option<PathBuf>,
    overwrite: bool,
}

#[pymethods]
impl Camera {
    #[new]
    fn new(py: Python<'_>, address: &str, options: &Bound<'_, PyDict>) -> PyResult<Self> {
        let options: Options<'_> = options.extract()?;
        let place: CameraAddress = address
            .parse()
            .map_err(|expected| refused(format!("camera {address:?}: {expected}")))?;
        let model = options.model()?;
        let setup = options.setup(&model)?;
        let policy = options.policy()?;
        let is_virtual = place == CameraAddress::Virtual;
        let optics = is_virtual.then(|| options.optics(&model)).transpose()?;
        let seed = options.seed;
        let (session, calibrated, flat) = long(py, move |_| {
            let mut flat = None;
            let calibrated = match (&optics, policy) {
                (Some(optics), CalibrationPolicy::Kept) => {
                    let settling = calibrate_against_white(optics, seed).map_err(refusal)?;
                    flat = flat_field_against_white(optics, &settling, seed).map_err(refusal)?;
                    Calibrated::White(settling)
                }
                (_, policy) => Calibrated::Policy(policy),
            };
            let link = || -> Result<Box<dyn Link>, Box<dyn std::error::Error + Send + Sync>> {
                let optics = optics.ok_or("it has no optics")?;
                Ok(Box::new(MemoryLink::new(optics.camera(seed)?)))
            };
            let mut session = place.open(link).map_err(of_opening)?;
            session.await_reports().map_err(of_session)?;
            Ok((session, calibrated, flat))
        })?;
        let identity = serde_json::to_string(session.identity());
        Ok(Self {
            identity: identity.map_err(|error| refused(error.to_string()))?,
            reports: session.reports().to_vec(),
            state: Arc::new(Mutex::new(State::Idle(Box::new(session)))),
            setup,
            calibrated,
            flat,
            is_virtual,
            last: Mutex::new(None),
            process: std::process::id(),
        })
    }

    /// The identity as JSON.
    #[getter]
    fn identity(&self) -> &str {
        &self.identity
    }

    /// The setup as JSON.
    #[getter]
    fn setup(&self) -> PyResult<String> {
        serde_json::to_string(&self.setup).map_err(|error| refused(error.to_string()))
    }

    /// What the camera reported with its greeting, and during the last run.
    #[getter]
    fn events(&self) -> Vec<String> {
        let mut events = self.reports.clone();
        if let Some(last) = &*lock(&self.last) {
            events.extend(lock(&last.events).iter().cloned());
        }
        events
    }

    /// The account of the run, or of the last one.
    #[getter]
    fn account(&self) -> Counted {
        lock(&self.last).as_ref().map_or_else(Counted::default, |last| last.counted())
    }

    #[getter]
    fn is_virtual(&self) -> bool {
        self.is_virtual
    }

    #[getter]
    fn closed(&self) -> bool {
        matches!(*lock(&self.state), State::Closed | State::Closing)
    }

    /// `(state, fault, LEDs on, temperature)` of the camera between two runs.
    fn status(&self, py: Python<'_>) -> PyResult<(String, Option<String>, bool, Option<f64>)> {
        let mut session = self.take()?;
        let status = py.detach(|| {
            let status = session.status(&mut IgnorePackets);
            put_back(&self.state, session);
            status
        });
        let status = status.map_err(of_session)?;
        let warm = status.temperature_centi_celsius;
        Ok((
            status.state.to_string(),
            status.fault.map(|fault| fault.to_string()),
            status.leds_on,
            (warm != i16::MIN).then(|| f64::from(warm) / 100.0),
        ))
    }

    /// Starts a run.
    fn start(&self, py: Python<'_>, wanted: &Bound<'_, PyDict>) -> PyResult<Run> {
        let wanted: Wanted = wanted.extract()?;
        if wanted.frames == Some(0) {
            return Err(refused("frames is 0, expected at least 1"));
        }
        let session = self.take()?;
        let (options, flat) = match self.options(&session, &wanted) {
            Ok(found) => found,
            Err(error) => {
                put_back(&self.state, session);
                return Err(error);
            }
        };
        let shared = Arc::new(Shared::default());
        *lock(&self.last) = Some(Arc::clone(&shared));
        let room = if self.is_virtual { WAITING_VIRTUAL } else { WAITING };
        let (sender, receiver) = sync_channel(if wanted.stream { room } else { 0 });
        let observer = Streaming {
            frames: wanted.stream.then_some(sender),
            waits: self.is_virtual,
            shared: Arc::clone(&shared),
        };
        let state = Arc::clone(&self.state);
        let thread = py.detach(|| {
            std::thread::Builder::new()
                .name("nirspi-camera".to_owned())
                .spawn(move || run(session, &options, observer, &state))
        });
        let thread = thread.map_err(|error| {
            *lock(&self.state) = State::Closed;
            PyOSError::new_err(format!("no thread for the camera: {error}"))
        })?;
        Ok(Run {
            receiver: Mutex::new(Some(receiver)),
            thread: Mutex::new(Some(thread)),
            made: Mutex::new(None),
            shared,
            flat,
            process: self.process,
        })
    }

    /// Closes the link. The LEDs of a run that goes on are switched off first, by [`Run::stop`].
    fn close(&self) {
        let mut state = lock(&self.state);
        let before = match *state {
            State::Running | State::Closing => std::mem::replace(&mut *state, State::Closing),
            State::Idle(_) | State::Closed => std::mem::replace(&mut *state, State::Closed),
        };
        drop(state);
        if self.process != std::process::id() {
            std::mem::forget(before);
        }
    }
}

impl Camera {
    fn take(&self) -> PyResult<Box<Session>> {
        if self.process != std::process::id() {
            return Err(refused("the camera belongs to the process that opened it, open one here"));
        }
        let mut state = lock(&self.state);
        match std::mem::replace(&mut *state, State::Running) {
            State::Idle(session) => Ok(session),
            other => {
                let text = match other {
                    State::Closed | State::Closing => "the camera is closed, open it again",
                    _ => "a run goes on, end it first",
                };
                *state = other;
                Err(refused(text))
            }
        }
    }

    fn options(
        &self,
        session: &Session,
        wanted: &Wanted,
    ) -> PyResult<(CaptureOptions, Option<nirspi::calibration::FlatField>)> {
        let setup = self.setup.clone();
        let mut flat = self.flat.clone();
        let calibration = match &self.calibrated {
            Calibrated::White(settling) if setup.differential => {
                Calibration::Kept(settling.clone())
            }
            // Single patterns need the dark level in front of this scene.
            Calibrated::White(settling) => Calibration::MeasureOr(settling.clone()),
            Calibrated::Policy(policy) => {
                let choice = policy.choose(&setup, session.identity()).map_err(refusal)?;
                flat = choice.flat_field.map(|kept| kept.flat);
                choice.calibration
            }
        };
        let record = wanted.record.as_ref().map(|path| match wanted.overwrite {
            true => Target::Replace(path.clone()),
            false => Target::New(path.clone()),
        });
        Ok((CaptureOptions { setup, frames: wanted.frames, calibration, record }, flat))
    }
}

impl Drop for Camera {
    fn drop(&mut self) {
        self.close();
    }
}

/// Gives the session back, unless the camera was closed meanwhile.
fn put_back(state: &Mutex<State>, session: Box<Session>) {
    let mut state = lock(state);
    *state = match *state {
        State::Running => State::Idle(session),
        _ => State::Closed,
    };
}

/// What the thread of a run and its user share.
#[derive(Default)]
struct Shared {
    stop: AtomicBool,
    counters: Mutex<LossCounters>,
    passed_over: AtomicU64,
    events: Mutex<Vec<String>>,
}

/// Received, lost, corrupt, late; and passed over because the user was slow.
type Counted = (u64, u64, u64, u64, u64);

impl Shared {
    fn counted(&self) -> Counted {
        let counted = *lock(&self.counters);
        let passed = self.passed_over.load(Ordering::Relaxed);
        (counted.received, counted.lost, counted.corrupt, counted.late, passed)
    }
}

/// The most events that are kept.
const EVENTS: usize = 1000;

/// One frame on its way to the user.
struct Item {
    sums: Vec<i64>,
    sequence: u32,
    device_time_us: u64,
    sweeps: u32,
    flags: u16,
}

/// Gives the frames of a run to its user.
struct Streaming {
    frames: Option<SyncSender<Item>>,
    /// Whether the camera waits for the user.
    waits: bool,
    shared: Arc<Shared>,
}

impl Observer for Streaming {
    fn frame(&mut self, frame: &Frame<'_>, counters: &LossCounters) {
        *lock(&self.shared.counters) = *counters;
        let Some(frames) = &self.frames else { return };
        if self.shared.stop.load(Ordering::Relaxed) {
            return;
        }
        let item = Item {
            sums: frame.samples.iter().collect(),
            sequence: frame.sequence,
            device_time_us: frame.device_time_us,
            sweeps: frame.sweeps,
            flags: frame.flags.0,
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

    fn watch(&mut self, progress: &Progress) -> ControlFlow<()> {
        *lock(&self.shared.counters) = progress.counters;
        match self.shared.stop.load(Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}

type Captured = Result<Capture, CaptureError>;

/// The thread of a run. The session is back before the channel of frames closes.
fn run(
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
    receiver: Mutex<Option<Receiver<Item>>>,
    thread: Mutex<Option<JoinHandle<Option<Captured>>>>,
    made: Mutex<Option<Made>>,
    shared: Arc<Shared>,
    flat: Option<nirspi::calibration::FlatField>,
    process: u32,
}

/// The end of a run.
enum Made {
    Captured(Box<Capture>),
    Failed(PyErr),
}

type FrameTuple<'py> = (Bound<'py, PyArray1<i64>>, u32, u64, u32, u16);

impl Run {
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
    /// The next frame: `(sums, sequence, device_time_us, sweeps, flags)`; `None` at the end.
    fn next<'py>(&self, py: Python<'py>) -> PyResult<Option<FrameTuple<'py>>> {
        let item = self.receive(py)?;
        Ok(item.map(|i| (array(py, i.sums), i.sequence, i.device_time_us, i.sweeps, i.flags)))
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
        // A thread that waits for room goes on when nobody receives.
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
                let broke = !matches!(captured.ended, Ended::Complete | Ended::Stopped);
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

    /// The measurement of all frames together: `(n, rows, d, notes, flat field)`.
    #[expect(clippy::type_complexity, reason = "a tuple for Python")]
    fn measurement<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(
        usize,
        Bound<'py, PyArray1<i64>>,
        Bound<'py, PyArray1<f64>>,
        Vec<String>,
        Option<FlatField>,
    )> {
        let held = lock(&self.made);
        let Some(Made::Captured(captured)) = &*held else {
            return Err(refused("the run has not ended, or has failed"));
        };
        let source = Source::of_capture(captured).map_err(refusal)?;
        let measured = &source.measurements;
        let rows = measured.rows().iter().map(|&row| i64::from(row)).collect();
        Ok((
            measured.side().pixels(),
            array(py, rows),
            array(py, measured.values().to_vec()),
            source.notes,
            self.flat.clone().map(FlatField),
        ))
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
