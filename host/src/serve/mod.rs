//! The live web page of a camera.
//!
//! ```text
//! camera's thread ──> slot ──> imaging thread ──> watch channel ──> browser, browser, ...
//!  every frame      newest      newest image       newest moment      at its own pace
//! ```
//!
//! Data flows from the camera's thread through the imaging thread to the browsers. Each stage keeps
//! only the newest item and counts what it drops, so a slow consumer never blocks the stage before:
//! the camera does not wait for networks, the networks do not wait for a browser, and a browser
//! does not wait for another browser. Pages change settings by one small message
//! ([`settings::Change`]). Two threads compute; all of HTTP runs asynchronously on a third thread.

mod camera;
mod camera_log;
mod guard;
mod http;
mod imaging;
mod light;
mod page;
pub mod settings;
mod slot;
mod state;

pub use camera::{CameraSource, Connect, Connected};
pub use imaging::Imaging;
pub use slot::{ImageCounters, Ledger};

use crate::capture::CaptureError;
use camera_log::CameraLog;
use light::LightSwitch;
use nirspi_recon::reconstruct::Method;
use settings::Settings;
use slot::Slot;
use state::Published;
use std::io;
use std::net::TcpListener;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use thiserror::Error;
use tokio::sync::watch;

/// Why serving ended without a request of the user.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ServeError {
    /// The camera could not measure.
    #[error(transparent)]
    Camera(#[from] CaptureError),
    /// The network failed.
    #[error("the web server failed")]
    Network(#[from] io::Error),
    /// A thread panicked because of a bug in this program.
    #[error("the {0} thread died")]
    Thread(&'static str),
}

/// An error of the functions that the caller passes to [`serve`].
pub type ForeignError = Box<dyn std::error::Error + Send + Sync>;

/// The data that the threads share.
struct Shared {
    slot: Slot,
    camera: Mutex<CameraLog>,
    settings: Mutex<Settings>,
    /// Names of the methods that settings can choose.
    methods: Vec<&'static str>,
    /// What each of these methods does; empty for a method that is not built in.
    about: Vec<&'static str>,
    light: LightSwitch,
    over: AtomicBool,
    viewers: AtomicUsize,
}

impl Shared {
    fn new(camera: CameraLog, methods: Vec<&'static str>, settings: Settings) -> Self {
        Self {
            slot: Slot::default(),
            camera: Mutex::new(camera),
            settings: Mutex::new(settings),
            about: methods.iter().map(|name| name.parse().map_or("", Method::about)).collect(),
            methods,
            light: LightSwitch::on(),
            over: AtomicBool::new(false),
            viewers: AtomicUsize::new(0),
        }
    }

    fn is_over(&self) -> bool {
        self.over.load(Ordering::Relaxed)
    }

    fn viewers(&self) -> usize {
        self.viewers.load(Ordering::Relaxed)
    }
}

/// Locks a mutex, also if a thread panicked while holding the lock: counters and settings are valid
/// at any moment.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Serves `camera` to the browsers that connect to `listener`, until `stop` is set. Returns the
/// account of all frames.
///
/// # Errors
/// [`ServeError`], after the camera is stopped.
pub fn serve(
    listener: TcpListener,
    camera: CameraSource,
    connected: Connected,
    imaging: Imaging,
    settings: Settings,
    stop: &AtomicBool,
) -> Result<Ledger, ServeError> {
    let log = CameraLog::new(&camera.address, connected.session.identity());
    let methods = imaging.methods.iter().map(|(name, _)| *name).collect();
    let shared = Arc::new(Shared::new(log, methods, settings));
    let (publish, published) = watch::channel(Arc::new(Published::default()));
    let measuring = {
        let shared = Arc::clone(&shared);
        spawn("camera", move || camera::run(&shared, camera, connected))?
    };
    let making = {
        let shared = Arc::clone(&shared);
        spawn("imaging", move || imaging::run(&shared, &imaging, &publish))?
    };
    let is_over =
        || stop.load(Ordering::Relaxed) || measuring.is_finished() || making.is_finished();
    let served = http::run(listener, Arc::clone(&shared), published, is_over);
    shared.over.store(true, Ordering::Relaxed);
    // The camera is stopped even if the other threads failed.
    let measured = measuring.join().map_err(|_| ServeError::Thread("camera"))?;
    making.join().map_err(|_| ServeError::Thread("imaging"))?;
    measured?;
    served?;
    Ok(shared.slot.ledger())
}

fn spawn<T: Send + 'static>(
    name: &str,
    work: impl FnOnce() -> T + Send + 'static,
) -> io::Result<JoinHandle<T>> {
    std::thread::Builder::new().name(name.to_owned()).spawn(work)
}

#[cfg(test)]
mod tests;
