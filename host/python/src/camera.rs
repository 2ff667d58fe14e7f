//! A camera: real or virtual.
//!
//! # Invariant
//! A run ends with the LEDs off, in whatever way its user leaves it: by the end of the run, an exception, Ctrl-C, `close`,
//! or because nothing refers to it any more (`test_camera.py`). The thread of a run never takes the GIL, so that waiting
//! for its end cannot block it. A child of `fork` leaves the camera of its parent alone.

mod options;
mod run;

pub use run::Run;

use crate::errors::{of_opening, refusal, refused};
use crate::made::{made, said};
use crate::work::long;
use nirspi::address::CameraAddress;
use nirspi::capture::CalibrationPolicy;
use nirspi::capture::{Calibration, CaptureError, CaptureOptions, Record};
use nirspi::causes::in_one_line;
use nirspi::frame_time::HostClock;
use nirspi::link::Link;
use nirspi::provenance::{Made, Taken};
use nirspi::recording::Target;
use nirspi::response::Settling;
use nirspi::session::{IgnorePackets, Session, SessionError};
use nirspi::setup::MeasurementSetup;
use nirspi_virtual::{MemoryLink, calibrate_against_white, flat_field_against_white};
use numpy::PyArray1;
use options::Options;
use pyo3::exceptions::{PyConnectionError, PyOSError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use run::{Counted, Shared, Streaming, run};
use std::path::PathBuf;
use std::sync::mpsc::sync_channel;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Frames that wait for the user: of a virtual camera, whose time waits too, and of a real one, which goes on.
const WAITING_VIRTUAL: usize = 1024;
const WAITING: usize = 65_536;

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
    /// What a perfect camera would see of a virtual camera's scene.
    truth: Option<Vec<f32>>,
    identity: String,
    /// Where its readings come from, as JSON.
    taken: String,
    reports: Vec<String>,
    /// What the last run has counted.
    last: Mutex<Option<Arc<Shared>>>,
    process: u32,
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
        let (session, calibrated, flat, truth) = long(py, move |_| {
            let truth = match &optics {
                Some(optics) => {
                    let seen = optics.focused_footprint().map_err(refusal)?;
                    Some(seen.weights().to_vec())
                }
                None => None,
            };
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
            Ok((session, calibrated, flat, truth))
        })?;
        let identity = serde_json::to_string(session.identity());
        let taken = said(&Taken::by(session.identity()))?;
        Ok(Self {
            taken,
            identity: identity.map_err(|error| refused(error.to_string()))?,
            reports: session.reports().lines.clone(),
            state: Arc::new(Mutex::new(State::Idle(Box::new(session)))),
            setup,
            calibrated,
            flat,
            is_virtual,
            truth,
            last: Mutex::new(None),
            process: std::process::id(),
        })
    }

    /// Where the readings come from, as JSON.
    #[getter]
    fn taken(&self) -> &str {
        &self.taken
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

    /// What a perfect camera of these LEDs would see of the scene, 0 to 1.
    #[getter]
    fn truth<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f32>>> {
        self.truth.as_ref().map(|truth| PyArray1::from_slice(py, truth))
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
        let made = made(py)?;
        let session = self.take()?;
        let (options, flat) = match self.options(&session, &wanted, made) {
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
            host: HostClock::new(),
            clock: None,
            arrived_ns: 0,
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
        made: Made,
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
        let target = wanted.record.as_ref().map(|path| match wanted.overwrite {
            true => Target::Replace(path.clone()),
            false => Target::New(path.clone()),
        });
        let (frames, record) = (wanted.frames, target.map(|target| Record { target, made }));
        Ok((CaptureOptions { setup, frames, calibration, record }, flat))
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
