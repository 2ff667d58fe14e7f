#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
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
//!
//! `docs/log/live-page.md` lists what each stage holds at most, and where a test says so. Each frame's
//! delay to each stage is measured (`delays.rs`). If the computer is too slow for the camera, the page
//! gives up images, then enhancement (`overload.rs`).

#[cfg(not(target_family = "wasm"))]
mod access;
#[cfg(not(target_family = "wasm"))]
mod base_path;
mod begin;
mod camera;
mod camera_log;
#[cfg(not(target_family = "wasm"))]
mod change_rate;
mod commands;
#[cfg(not(target_family = "wasm"))]
mod connections;
mod delays;
#[cfg(not(target_family = "wasm"))]
mod feed;
#[cfg(all(fuzzing, not(target_family = "wasm")))]
pub mod fuzzing;
#[cfg(not(target_family = "wasm"))]
mod guard;
#[cfg(not(target_family = "wasm"))]
mod http;
mod imaging;
mod light;
mod line;
mod look;
mod moving;
mod overload;
#[cfg(not(target_family = "wasm"))]
mod own;
#[cfg(not(target_family = "wasm"))]
mod page;
#[cfg(not(target_family = "wasm"))]
mod pages;
mod picture;
#[cfg(not(target_family = "wasm"))]
mod rest;
#[cfg(not(target_family = "wasm"))]
mod server;
pub mod settings;
mod simulated;
mod slot;
mod stage;
mod state;
mod sync;
#[cfg(not(target_family = "wasm"))]
mod threads;
#[cfg(not(target_family = "wasm"))]
mod token;
mod turns;

#[cfg(not(target_family = "wasm"))]
pub use access::{Access, HostName, HostNameError};
#[cfg(not(target_family = "wasm"))]
pub use base_path::{BasePath, BasePathError};
pub use begin::TurnsError;
pub use camera::{CameraSource, Connect, Connected};
#[cfg(not(target_family = "wasm"))]
pub use feed::FeedSource;
pub use imaging::{Imaging, ImagingError};
pub use line::Line;
#[cfg(not(target_family = "wasm"))]
pub use look::BenchError;
#[cfg(not(target_family = "wasm"))]
pub use server::{BindError, Server};
pub use slot::{ImageCounters, Ledger};
pub use stage::StagedScene;
#[cfg(not(target_family = "wasm"))]
pub use threads::{ServeError, Served, serve, serve_feed};
#[cfg(not(target_family = "wasm"))]
pub use token::{Token, TokenError};
pub use turns::Turns;

use camera_log::CameraLog;
use delays::{Delays, Passed};
use light::LightSwitch;
use look::Look;
use nirspi::clock::Instant;
use nirspi::events::Level;
use overload::{Load, Overload, Shed};
use settings::{Offer, Settings};
use slot::Slot;
use stage::Stage;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// An error of the functions that the caller passes to this module.
pub type ForeignError = Box<dyn std::error::Error + Send + Sync>;

/// The data that the threads share.
struct Shared {
    slot: Slot<Look>,
    camera: Mutex<CameraLog>,
    settings: Mutex<Settings>,
    /// The values that settings can have.
    offer: Offer,
    stage: Stage,
    light: LightSwitch,
    /// The line between firmware and host, if pages can damage its bytes.
    line: Option<Line>,
    /// How long frames take to each stage.
    delays: Mutex<Delays>,
    /// What the page gives up.
    overload: Mutex<Overload>,
    over: AtomicBool,
    viewers: AtomicUsize,
    /// The pages that ask for states.
    #[cfg(not(target_family = "wasm"))]
    pages: Mutex<pages::Pages>,
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
            delays: Mutex::new(Delays::new(Instant::now())),
            overload: Mutex::default(),
            over: AtomicBool::new(false),
            viewers: AtomicUsize::new(0),
            #[cfg(not(target_family = "wasm"))]
            pages: Mutex::default(),
        }
    }

    fn is_over(&self) -> bool {
        self.over.load(Ordering::Relaxed)
    }

    /// Number of pages, and of scripts that read the stream of states.
    fn viewers(&self) -> usize {
        #[cfg(not(target_family = "wasm"))]
        let pages = lock(&self.pages).count(tokio::time::Instant::now());
        #[cfg(target_family = "wasm")]
        let pages = 0;
        pages + self.viewers.load(Ordering::Relaxed)
    }

    /// A frame that arrived at this moment, or its image, has passed this stage now.
    fn passed(&self, stage: Passed, arrived: Instant) {
        lock(&self.delays).passed(stage, arrived, Instant::now());
    }

    /// Takes the load of the camera's thread. A change of what the page gives up becomes an event.
    fn loaded(&self, load: Load) {
        let change = lock(&self.overload).at(Instant::now(), load);
        if let Some(line) = change {
            let level = if self.shed().show_every == 1 { Level::Info } else { Level::Warning };
            lock(&self.camera).event(level, line);
        }
    }

    /// What the page gives up now.
    fn shed(&self) -> Shed {
        lock(&self.overload).shed()
    }
}

/// Locks a mutex, also if a thread panicked while holding the lock: counters and settings are valid
/// at any moment.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;
