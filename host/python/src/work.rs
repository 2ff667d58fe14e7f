//! Runs work without the GIL, on threads of this process.
//!
//! # Invariant
//! A panic is a `RuntimeError`, never the end of the interpreter (`test_bad_input.py`,
//! `test_a_panic_is_a_runtime_error`). A child of `fork` has threads of its own (`test_a_child_of_fork_computes`): the
//! threads of rayon's global pool do not survive a fork, so that only the pages of feeds use that pool. The lock of
//! [`pool`] is taken with the GIL held, and Python forks with the GIL held, so no fork finds the lock taken.

use crate::errors::refusal;
use nirspi_nets::{Backend, Device};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Interval of looking for Ctrl-C.
pub const SIGNALS: Duration = Duration::from_millis(50);

/// The threads of this process.
fn pool(_gil: Python<'_>) -> PyResult<Arc<ThreadPool>> {
    let mut held = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    match &*held {
        Some((owner, pool)) if *owner == process => return Ok(Arc::clone(pool)),
        _ => {}
    }
    // The threads of the parent do not exist here, so that nothing can wait for them.
    std::mem::forget(held.take());
    let named = |index| format!("nirspi-{index}");
    let pool = ThreadPoolBuilder::new().thread_name(named).build().map(Arc::new);
    let pool = pool.map_err(|error| PyRuntimeError::new_err(format!("no threads: {error}")))?;
    *held = Some((process, Arc::clone(&pool)));
    Ok(pool)
}

/// A panic as an exception.
fn panicked(panic: &(dyn Any + Send)) -> PyErr {
    let text = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("without a word");
    PyRuntimeError::new_err(format!("a fault of nirspi, please report it: {text}"))
}

fn caught<T>(work: impl FnOnce() -> PyResult<T>) -> PyResult<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(panicked(&*panic)))
}

/// Work of microseconds on this thread, which does not use other threads.
pub fn quick<T: Send>(py: Python<'_>, work: impl FnOnce() -> PyResult<T> + Send) -> PyResult<T> {
    py.detach(|| caught(work))
}

/// Work of milliseconds on all cores.
pub fn heavy<T: Send>(py: Python<'_>, work: impl FnOnce() -> PyResult<T> + Send) -> PyResult<T> {
    let pool = pool(py)?;
    py.detach(|| caught(|| pool.install(work)))
}

/// Work of seconds on all cores. Ctrl-C sets the flag that the work gets, and becomes the exception when the work has
/// ended.
pub fn long<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&AtomicBool) -> PyResult<T> + Send,
) -> PyResult<T> {
    let pool = pool(py)?;
    let stop = &AtomicBool::new(false);
    py.detach(|| {
        std::thread::scope(|scope| {
            let (done, is_done) = mpsc::channel::<()>();
            let worker = scope.spawn(move || {
                // Dropped when the work has ended, in whatever way.
                let _done = done;
                caught(|| pool.install(|| work(stop)))
            });
            let mut interrupt = None;
            while is_done.recv_timeout(SIGNALS) == Err(RecvTimeoutError::Timeout) {
                if interrupt.is_none() {
                    interrupt = signals().err();
                    stop.store(interrupt.is_some(), Ordering::Relaxed);
                }
            }
            let made = worker.join().unwrap_or_else(|panic| Err(panicked(&*panic)));
            interrupt.map_or(made, Err)
        })
    })
}

/// The exception of a signal that has come, such as Ctrl-C.
#[expect(
    clippy::redundant_closure_for_method_calls,
    reason = "the method itself holds for one lifetime alone"
)]
pub fn signals() -> PyResult<()> {
    Python::attach(|py| py.check_signals())
}

/// The backend of this name, if it is there.
pub fn backend(name: &str) -> PyResult<(Backend, Device)> {
    let backend: Backend = name.parse().map_err(refusal)?;
    let device = Device::open(backend).map_err(refusal)?;
    Ok((backend, device))
}

/// The names of the devices that compute here, each with the name of its hardware.
#[pyfunction]
pub fn devices(py: Python<'_>) -> PyResult<Vec<(&'static str, String)>> {
    quick(py, || {
        let there = |backend: Backend| {
            Device::open(backend).ok().map(|device| (backend.name(), device.name().to_owned()))
        };
        Ok(Backend::ALL.into_iter().filter(|b| *b != Backend::Auto).filter_map(there).collect())
    })
}

/// Panics, so that a test sees what becomes of a panic.
#[pyfunction]
#[pyo3(name = "_panic_for_tests")]
#[expect(clippy::panic, reason = "it is for this")]
pub fn panic_for_tests(py: Python<'_>, on: &str) -> PyResult<()> {
    match on {
        "quick" => quick(py, || panic!("as asked")),
        "heavy" => heavy(py, || panic!("as asked")),
        _ => long(py, |_| panic!("as asked")),
    }
}
