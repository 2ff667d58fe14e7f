//! nirspi: an open near-infrared single-pixel camera.
//!
//! Data flows one way: bytes -> frames -> measurements -> image -> picture.
//!
//! * [`link`] moves bytes, [`session`] talks to a camera, [`account`] counts what became of every frame,
//! * [`calibrate`] measures latency and settling, [`selftest`] checks a camera, [`capture`] runs a measurement,
//!   [`recording`] keeps it,
//! * [`tally`] and [`integrate`] turn frames into measurements; `nirspi-recon` turns those into an image,
//! * [`files`], [`picture`] and [`scene`] are what people see and hand over,
//! * [`virtual_camera`] is a camera without silicon: optics simulator, gateware model, real firmware logic.

pub mod account;
pub mod calibrate;
pub mod capture;
pub mod files;
pub mod integrate;
pub mod link;
pub mod picture;
pub mod recording;
pub mod scene;
pub mod selftest;
pub mod session;
pub mod setup;
pub mod tally;
pub mod virtual_camera;
