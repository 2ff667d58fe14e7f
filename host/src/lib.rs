#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! Data flows one way: bytes -> frames -> measurements -> image -> picture.
//!
//! * [`link`] moves bytes, [`session`] exchanges commands with a camera, [`account`] counts every
//!   frame,
//! * [`devices`] lists cameras, [`mod@info`] asks one of them who it is,
//! * [`about`] says what a build contains, [`versions`] checks whether camera and program fit
//!   together, [`events`] words a camera's reports,
//! * [`fpga`] says in words what an FPGA answers, [`gateware`] loads a camera's FPGA, [`update`] brings a camera to the versions of a release,
//! * [`calibration`] measures, keeps and chooses latency and settling, [`selftest`] checks a
//!   camera,
//! * [`capture`] runs a measurement, [`recording`] stores it, [`export`] writes it for other
//!   programs, [`replay`] plays it back as a camera,
//! * [`frame_time`] gives the frames of a camera times by this computer's clock,
//! * [`tally`] and [`integrate`] make measurements of frames; `nirspi-recon` reconstructs an image
//!   from measurements,
//! * [`source`] reads measurements from a file, a recording or a capture,
//! * [`reconstruct`] makes an image or many of what was read,
//! * [`files`], [`picture`] and [`scene`] read and write what users see, [`resolution`] measures
//!   the finest detail, [`legibility`] reads characters,
//! * [`imaging`] scales, enhances and judges images, and gives warnings,
//! * [`serve`] shows a camera live on a web page,
//! * [`provenance`] says where readings come from and what made a file of them,
//! * [`causes`] prints an error with its causes, [`clock`] says the time, [`heartbeat`] gives signs of life of long work, [`stage_times`]
//!   measures it,
//! * [`training`] makes pairs for training networks, with the virtual camera,
//! * [`udev`] gives users access to cameras on USB; [`boards`] lists the boards with firmware; with
//!   the feature `flash`, `flash` programs the boards,
//! * [`example`] makes example measurements, [`safety_case`] says what eye and skin receive and what each fault leaves lit,
//! * [`virtual_camera`] is a camera without hardware: optics simulator, gateware model, real
//!   firmware logic.
//!
//! Without its features (`default-features = false`) the library captures, records, calibrates and
//! reads measurements, without web server, typefaces, optics or networks. The features `enhance`,
//! `pictures`, `virtual-camera`, `live`, `serve` and `training` add the other parts; `gpu` adds the kernels
//! for GPUs.

#![cfg_attr(
    target_family = "wasm",
    allow(dead_code, unused_imports, reason = "a browser has no files, and nothing to export to")
)]

pub mod about;
pub mod account;
pub mod boards;
pub mod calibration;
pub mod capture;
pub mod causes;
pub mod clock;
#[cfg(any(feature = "live", feature = "virtual-camera"))]
mod depth_image;
#[cfg(not(target_family = "wasm"))]
pub mod devices;
pub mod events;
#[cfg(all(feature = "virtual-camera", not(target_family = "wasm")))]
pub mod example;
#[cfg(not(target_family = "wasm"))]
pub mod export;
pub mod exposure;
pub mod files;
#[cfg(feature = "flash")]
pub mod flash;
pub mod fpga;
pub mod frame_time;
pub mod gateware;
pub mod heartbeat;
pub mod imaging;
pub mod info;
pub mod integrate;
#[cfg(feature = "training")]
pub mod legibility;
pub mod link;
#[cfg(feature = "pictures")]
pub mod picture;
pub mod provenance;
#[cfg(not(target_family = "wasm"))]
pub mod reconstruct;
pub mod recording;
pub mod replay;
pub mod resolution;
#[cfg(feature = "virtual-camera")]
pub mod safety_case;
#[cfg(feature = "pictures")]
pub mod scene;
pub mod selftest;
#[cfg(feature = "live")]
pub mod serve;
pub mod session;
pub mod setup;
pub mod signal;
#[cfg(not(target_family = "wasm"))]
pub mod source;
pub mod stage_times;
pub mod tally;
#[cfg(feature = "training")]
pub mod training;
pub mod udev;
pub mod update;
pub mod versions;
#[cfg(feature = "virtual-camera")]
pub mod virtual_camera;
#[cfg(feature = "virtual-camera")]
pub mod weather;
