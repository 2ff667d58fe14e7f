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
mod connections;
mod guard;
mod http;
mod imaging;
mod light;
mod page;
mod server;
pub mod settings;
mod slot;
mod stage;
mod state;
mod token;

pub use camera::{CameraSource, Connect, Connected};
pub use imaging::{Imaging, ImagingError};
pub use server::{BindError, Server};
pub use slot::{ImageCounters, Ledger};
pub use stage::StagedScene;
pub use token::{Token, TokenError};

use crate::capture::CaptureError;
use camera_log::CameraLog;
use light::LightSwitch;
use settings::{Offer, Settings};
use slot::Slot;
use stage::Stage;
use state::Published;
use std::io;
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
    /// The values that settings can have.
    offer: Offer,
    stage: Stage,
    light: LightSwitch,
    over: AtomicBool,
    viewers: AtomicUsize,
}

impl Shared {
    fn new(camera: CameraLog, offer: Offer, settings: Settings, stage: Stage) -> Self {
        Self {
            slot: Slot::default(),
            camera: Mutex::new(camera),
            settings: Mutex::new(settings),
            offer,
            stage,
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

/// Serves `camera` to the browsers that connect to `server`, until `stop` is set. Returns the
/// account of all frames.
///
/// # Errors
/// [`ServeError`], after the camera is stopped.
pub fn serve(
    server: Server,
    mut camera: CameraSource,
    connected: Connected,
    imaging: Imaging,
    settings: Settings,
    stop: &AtomicBool,
) -> Result<Ledger, ServeError> {
    let log = CameraLog::new(&camera.address, connected.session.identity());
    let records = camera.record_to.is_some();
    let offer = Offer { records, base: Some(camera.setup.clone()), ..imaging.offer() };
    let stage = Stage::of(camera.scene.take());
    let shared = Arc::new(Shared::new(log, offer, settings, stage));
    let (publish, published) = watch::channel(Arc::new(Published::default()));
    let measuring = {
        let shared = Arc::clone(&shared);
        spawn("camera", move || camera::run(&shared, camera, connected))?
    };
    let making = {
        let shared = Arc::clone(&shared);
        spawn("imaging", move || imaging::run(&shared, imaging, &publish))?
    };
    let is_over =
        || stop.load(Ordering::Relaxed) || measuring.is_finished() || making.is_finished();
    let served = http::run(server, Arc::clone(&shared), published, is_over);
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
