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
//! Without threads and server, the same parts take turns ([`Turns`]).

mod camera;
mod camera_log;
mod commands;
#[cfg(feature = "serve")]
mod connections;
#[cfg(feature = "serve")]
mod guard;
#[cfg(feature = "serve")]
mod http;
mod imaging;
mod light;
mod line;
#[cfg(feature = "serve")]
mod page;
#[cfg(feature = "serve")]
mod server;
pub mod settings;
#[cfg(feature = "virtual-camera")]
mod simulated;
mod slot;
mod stage;
mod state;
#[cfg(feature = "serve")]
mod threads;
#[cfg(feature = "serve")]
mod token;
mod turns;

pub use camera::{CameraSource, Connect, Connected};
pub use imaging::{Imaging, ImagingError};
pub use line::Line;
#[cfg(feature = "serve")]
pub use server::{BindError, Server};
#[cfg(feature = "virtual-camera")]
pub use simulated::SimulatedError;
pub use slot::{ImageCounters, Ledger};
pub use stage::StagedScene;
#[cfg(feature = "serve")]
pub use threads::{ServeError, serve};
#[cfg(feature = "serve")]
pub use token::{Token, TokenError};
pub use turns::Turns;

use camera_log::CameraLog;
use light::LightSwitch;
use settings::{Offer, Settings};
use slot::Slot;
use stage::Stage;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// An error of the functions that the caller passes to this module.
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
    /// The line between firmware and host, if pages can damage its bytes.
    line: Option<Line>,
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
            line: None,
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

#[cfg(test)]
#[cfg(feature = "serve")]
mod tests;
