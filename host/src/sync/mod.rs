//! Several cameras at one host with a common time base: the host's clock.
//!
//! * [`HostClock`] is the host's clock, which all cameras of a program share,
//! * [`Clock`] fits offset and drift of one camera's clock,
//! * [`Merge`] brings frames of several cameras into the order of common time as they come,
//! * [`Cameras`] is both, for a program that reads several cameras,
//! * [`recordings()`] does the same for recordings that were made side by side, and writes a table of
//!   all frames.
//!
//! ```
//! use nirspi::sync::Cameras;
//! use std::time::Duration;
//!
//! // Two cameras with frames of 0.5 ms. A camera that is silent for 100 ms is not waited for.
//! let mut cameras = Cameras::new(&[500_000.0, 500_000.0], Duration::from_millis(100));
//! // In the observer of a capture: the frame, and the time at which its bytes arrived.
//! cameras.arrived(0, 1, 70_000, 1_000_000_000, "left");
//! cameras.arrived(1, 1, 20_000, 1_000_400_000, "right");
//! let first = cameras.next(1_000_500_000).unwrap();
//! assert_eq!((first.camera, first.item), (0, "left"));
//! assert!(cameras.next(1_000_500_000).is_none());         // a frame of camera 0 may come before
//! ```

mod cameras;
mod clock;
mod host;
mod merge;
#[cfg(not(target_family = "wasm"))]
mod recordings;

pub use cameras::{Cameras, Timed};
pub use clock::{Clock, Fit, Heard, WINDOW_US};
pub use host::HostClock;
pub use merge::{Merge, Merged};
#[cfg(not(target_family = "wasm"))]
pub use recordings::{CameraClock, Pair, SyncError, Synced, recordings};
