//! A feed: the live readings of any bench, from an address or from the Python program itself, and its page.
//!
//! # Invariant
//! The thread of a page never takes the GIL, and ends with its [`FeedPage`] (`test_feed.py`).

use crate::arrays::{array, slice, whole};
use crate::errors::{of_file, of_source, refusal, refused};
use crate::loaded::Loaded;
use crate::made::made;
use crate::work::{SIGNALS, backend, heavy, long, signals};
use nirspi::causes::in_one_line;
use nirspi::feed::{Account, Address, Feed as Readings, FeedError, Giver, Header, Next};
use nirspi::feed::{Recorder, mean};
use nirspi::files::measurement::Sweeps;
use nirspi::source::Source;
use nirspi_nets::prior;
use nirspi_recon::reconstruct::{MethodSettings, Strength};
use nirspi_serve::settings::{MAX_FRAMES, Settings};
use nirspi_serve::{Access, FeedSource, Imaging, ServeError, Served, Server, Token, serve_feed};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::{PyConnectionError, PyOSError};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn of_feed(error: FeedError) -> PyErr {
    let text = in_one_line(&error);
    match error {
        FeedError::Header { .. } | FeedError::Stopped(_) => refused(text),
        _ => PyConnectionError::new_err(text),
    }
}

/// Whether Python goes on: no Ctrl-C and no other signal that raises. The exception is kept.
fn goes_on(raised: &Mutex<Option<PyErr>>) -> bool {
    match signals() {
        Ok(()) => true,
        Err(error) => {
            *lock(raised) = Some(error);
            false
        }
    }
}

/// A feed whose header has come.
#[pyclass(frozen, module = "nirspi._nirspi")]
pub struct Feed {
    name: String,
    header: Header,
    /// The address at which the feed is opened again, for a page.
    again: Option<Address>,
    /// The readings; `None` after the feed was closed or given to a page.
    readings: Mutex<Option<Readings>>,
    /// The account of the readings so far, also after the end.
    account: Mutex<Account>,
    /// Gives the readings of this program; `None` for a feed of an address, and after the end.
    giver: Mutex<Option<Giver>>,
    /// Makes measurements, once they are asked for.
    sweeps: Mutex<Option<Sweeps>>,
    process: u32,
}

/// What became of numbers: frames, frames without a reading, refused numbers, readings not read, readings that the trigger
/// lost, early edges, readings that were cut.
type Counted = (u64, u64, u64, u64, u64, u64, u64);

/// What came next: a frame, or why no more will come. Neither of both: nothing in time.
type Came<'py> = (Option<Bound<'py, PyArray1<f64>>>, Option<String>);

impl Feed {
    fn of(name: String, again: Option<Address>, readings: Readings, giver: Option<Giver>) -> Self {
        Self {
            name,
            header: readings.header().clone(),
            again,
            readings: Mutex::new(Some(readings)),
            account: Mutex::default(),
            giver: Mutex::new(giver),
            sweeps: Mutex::new(None),
            process: std::process::id(),
        }
    }

    fn origin(&self) -> PathBuf {
        PathBuf::from(&self.name)
    }
}

#[pymethods]
impl Feed {
    /// Opens an address and waits for the header.
    #[staticmethod]
    fn open(py: Python<'_>, address: &str) -> PyResult<Self> {
        let place: Address = address
            .strip_prefix("feed:")
            .unwrap_or(address)
            .parse()
            .map_err(|expected| refused(format!("feed {address:?}: {expected}")))?;
        let raised = Mutex::new(None);
        let opened = py.detach(|| Readings::open(&place, || goes_on(&raised)));
        match lock(&raised).take() {
            Some(error) => Err(error),
            None => {
                let again = (place != Address::Stdin).then(|| place.clone());
                Ok(Self::of(place.to_string(), again, opened.map_err(of_feed)?, None))
            }
        }
    }

    /// A feed of this program's own readings, with a header of JSON.
    #[staticmethod]
    fn of_numbers(name: String, header: &str) -> PyResult<Self> {
        let header = header.parse::<Header>().map_err(refusal)?;
        let (giver, readings) = Readings::of_numbers(header);
        Ok(Self::of(name, None, readings, Some(giver)))
    }

    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// The header: name of the bench, unit, whether simulated, form of the readings, order of the patterns.
    #[getter]
    fn header(&self) -> (Option<&str>, Option<&str>, Option<bool>, &str, String) {
        let Header { name, unit, simulated, form, .. } = &self.header;
        (name.as_deref(), unit.as_deref(), *simulated, form.name(), self.header.order())
    }

    /// Height and width of the image.
    #[getter]
    fn size(&self) -> (usize, usize) {
        let size = self.header.size();
        (size.height(), size.width())
    }

    /// Rows of Hadamard patterns.
    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let (_, rows) = self.header.hadamard().map_err(refusal)?;
        Ok(array(py, rows.iter().map(|&row| row.into()).collect()))
    }

    /// Number of patterns of a frame.
    #[getter]
    fn patterns(&self) -> usize {
        self.header.patterns()
    }

    /// Numbers of a frame: samples, and those of the trigger.
    #[getter]
    fn numbers(&self) -> usize {
        let each = self.header.samples.each as usize;
        self.header.readings() * each * if self.header.trigger.is_some() { 2 } else { 1 }
    }

    /// Number of readings of a frame.
    #[getter]
    fn readings(&self) -> usize {
        self.header.readings()
    }

    #[getter]
    fn account(&self) -> Counted {
        let Account { frames, empty_frames, refused, not_read, lost, early, cut, .. } =
            *lock(&self.account);
        (frames, empty_frames, refused, not_read, lost, early, cut)
    }

    /// What is missing, in one line.
    fn missing(&self) -> Option<String> {
        lock(&self.account).missing()
    }

    /// Gives readings, and waits while the feed is full. Returns whether the feed takes readings.
    fn give(&self, py: Python<'_>, numbers: PyReadonlyArray1<'_, f64>) -> PyResult<bool> {
        let numbers = slice(&numbers)?;
        let raised = Mutex::new(None);
        // The lock is not held while the giver asks Python for signals.
        let giver = lock(&self.giver).clone();
        let given =
            py.detach(|| giver.is_some_and(|giver| giver.give(numbers, || goes_on(&raised))));
        lock(&raised).take().map_or(Ok(given), Err)
    }

    /// No more readings come from this program.
    fn end(&self) {
        *lock(&self.giver) = None;
    }

    /// Closes the feed.
    fn close(&self) {
        self.end();
        let readings = lock(&self.readings).take();
        if self.process != std::process::id() {
            // The thread of the parent does not exist here.
            std::mem::forget(readings);
        }
    }

    #[getter]
    fn closed(&self) -> bool {
        lock(&self.readings).is_none()
    }

    /// Waits for a frame, so many seconds at most.
    fn next<'py>(&self, py: Python<'py>, seconds: f64) -> PyResult<Came<'py>> {
        enum Owned {
            Frame(Vec<f64>),
            Quiet,
            End(String),
        }
        let until = Instant::now() + Duration::try_from_secs_f64(seconds).unwrap_or_default();
        loop {
            let wait = until.saturating_duration_since(Instant::now());
            let came = py.detach(|| {
                let mut readings = lock(&self.readings);
                let feed = readings.as_mut()?;
                let came = match feed.next(wait.min(SIGNALS)) {
                    Next::Frame(frame) => Owned::Frame(frame.to_vec()),
                    Next::Quiet(_) => Owned::Quiet,
                    Next::End(end) => Owned::End(end.to_string()),
                };
                lock(&self.account).clone_from(feed.account());
                Some(came)
            });
            match came {
                None => return Err(refused("the feed is closed, open it again")),
                Some(Owned::Frame(frame)) => return Ok((Some(array(py, frame)), None)),
                Some(Owned::End(end)) => return Ok((None, Some(end))),
                Some(Owned::Quiet) if wait.is_zero() => return Ok((None, None)),
                Some(Owned::Quiet) => py.check_signals()?,
            }
        }
    }

    /// The measurement of frames one after another: of their mean.
    fn measurement(&self, py: Python<'_>, readings: PyReadonlyArray1<'_, f64>) -> PyResult<Loaded> {
        let readings = slice(&readings)?;
        let each = self.header.readings();
        whole("readings", readings.len(), each)?;
        let source = heavy(py, || {
            let mut sweeps = lock(&self.sweeps);
            let sweeps = match &mut *sweeps {
                Some(sweeps) => sweeps,
                none => none.insert(self.made_sweeps()?),
            };
            let frames: Vec<&[f64]> = readings.chunks_exact(each).collect();
            let sweep = sweeps.read(mean(&frames)).map_err(of_file)?;
            Source::of_sweep(&self.origin(), sweep).map_err(of_source)
        })?;
        Loaded::of(py, vec![source], false)
    }

    /// Begins a recording.
    fn record(&self, py: Python<'_>, path: PathBuf, overwrite: bool) -> PyResult<FeedRecorder> {
        let provenance = self.header.taken(&self.name).made(&made(py)?);
        let recorder =
            Recorder::begin(&path, overwrite, &self.header, &provenance).map_err(of_file)?;
        Ok(FeedRecorder { recorder: Mutex::new(Some(recorder)), readings: self.header.readings() })
    }
}

impl Feed {
    fn made_sweeps(&self) -> PyResult<Sweeps> {
        let Header { form, simulated, .. } = self.header;
        let (side, rows) = self.header.hadamard().map_err(refusal)?;
        Sweeps::new(&self.origin(), side, rows, form, simulated).map_err(of_file)
    }
}

/// Writes frames of a feed.
#[pyclass(frozen, module = "nirspi._nirspi")]
pub struct FeedRecorder {
    recorder: Mutex<Option<Recorder>>,
    readings: usize,
}

#[pymethods]
impl FeedRecorder {
    /// Adds a frame.
    fn push(&self, py: Python<'_>, frame: PyReadonlyArray1<'_, f64>) -> PyResult<()> {
        let frame = slice(&frame)?;
        if frame.len() != self.readings {
            let (found, expected) = (frame.len(), self.readings);
            return Err(refused(format!("a frame of {found} readings, expected {expected}")));
        }
        let pushed = py.detach(|| lock(&self.recorder).as_mut().map(|to| to.push(frame)));
        pushed.transpose().map_err(of_file).map(|_| ())
    }

    /// Completes the recording: its files.
    fn finish(&self, py: Python<'_>) -> PyResult<Vec<PathBuf>> {
        let recorder = lock(&self.recorder).take();
        let finished = py.detach(|| recorder.map(Recorder::finish));
        let finished = finished.transpose().map_err(of_file)?;
        Ok(finished.map_or(Vec::new(), |recorded| recorded.files))
    }
}

/// How a page shows a feed.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Wanted {
    listen: String,
    token: Option<String>,
    method: String,
    strength: Option<f64>,
    sum: u32,
    record_to: Option<PathBuf>,
    matrix: Option<PathBuf>,
    device: String,
}

/// The process whose pages compute on the threads of rayon's global pool, which do not exist in its forked children.
static SERVES: AtomicU32 = AtomicU32::new(0);

type Serving = JoinHandle<Result<Served, ServeError>>;

/// A live page of a feed, served by threads of its own.
#[pyclass(frozen, module = "nirspi._nirspi")]
pub struct FeedPage {
    url: String,
    stop: Arc<AtomicBool>,
    thread: Mutex<Option<Serving>>,
    process: u32,
}

#[pymethods]
impl FeedPage {
    /// Begins to serve the feed.
    #[new]
    fn new(py: Python<'_>, feed: &Feed, wanted: &Bound<'_, PyAny>) -> PyResult<Self> {
        let wanted: Wanted = wanted.extract()?;
        let (process, none) = (std::process::id(), Ordering::Relaxed);
        if SERVES.compare_exchange(0, process, none, none).is_err_and(|serves| serves != process) {
            let advice = "start a process of its own, as multiprocessing's spawn does";
            return Err(refused(format!("this process was forked from one with a page: {advice}")));
        }
        if wanted.sum > MAX_FRAMES {
            let sum = wanted.sum;
            return Err(refused(format!("sum is {sum}, expected 1 to {MAX_FRAMES} frames")));
        }
        let token = wanted.token.as_deref().map(str::parse::<Token>).transpose();
        let access = Access { token: token.map_err(refusal)?, ..Access::default() };
        if let Some(folder) = wanted.record_to.as_ref().filter(|folder| !folder.is_dir()) {
            return Err(refused(format!("record_to {}: found no such folder", folder.display())));
        }
        let method = word_of_method(&wanted.method)?;
        let (computes, device) = backend(&wanted.device)?;
        let settings = MethodSettings {
            strength: wanted.strength.map_or_else(Strength::default, Strength::Fixed),
            network: Some(prior::shipped()),
            backend: computes,
            ..MethodSettings::default()
        };
        let own = wanted.matrix.is_some();
        if !own {
            feed.header.hadamard().map_err(refusal)?;
        }
        let imaging = long(py, |_| {
            let imaging = Imaging::new(&settings, device);
            let imaging = match own {
                true => imaging.and_then(|imaging| imaging.of_own_patterns(method)),
                false => imaging,
            };
            imaging.map_err(refusal)
        })?;
        let server = Server::bind(&wanted.listen, access, &made(py)?).map_err(|error| {
            let (listen, why) = (&wanted.listen, in_one_line(&error));
            PyOSError::new_err(format!("listen {listen}: cannot listen there: {why}"))
        })?;
        let Some(readings) = lock(&feed.readings).take() else {
            return Err(refused("the feed is closed, open it again"));
        };
        let (name, again) = (feed.name.clone(), feed.again.clone());
        let source = FeedSource::new(name, readings, again, wanted.matrix, wanted.record_to);
        let source = source.map_err(refusal)?;
        let settings =
            Settings { strength: wanted.strength, ..source.settings(method, wanted.sum) };
        let (url, stop) = (server.url(), Arc::new(AtomicBool::new(false)));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::Builder::new()
            .name("nirspi-page".to_owned())
            .spawn(move || serve_feed(server, source, imaging, settings, &stopped))
            .map_err(|error| PyOSError::new_err(format!("no thread for the page: {error}")))?;
        Ok(Self { url, stop, thread: Mutex::new(Some(thread)), process: std::process::id() })
    }

    /// The address of the page.
    #[getter]
    fn url(&self) -> &str {
        &self.url
    }

    /// Whether the page is no longer served.
    #[getter]
    fn is_over(&self) -> bool {
        lock(&self.thread).as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Ends the page: the account of its frames in words; `None` for a page that has ended before.
    fn close(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.stop.store(true, Ordering::Relaxed);
        let Some(thread) = lock(&self.thread).take() else { return Ok(None) };
        if self.process != std::process::id() {
            // The thread of the parent does not exist here.
            std::mem::forget(thread);
            return Ok(None);
        }
        match py.detach(|| thread.join()) {
            Ok(served) => served.map(|served| Some(served.to_string())).map_err(refusal),
            Err(_) => Err(refused("a thread of the page died, please report it")),
        }
    }
}

impl Drop for FeedPage {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// The method of this name, which a page offers.
fn word_of_method(name: &str) -> PyResult<nirspi_recon::reconstruct::Method> {
    name.parse().map_err(refusal)
}
