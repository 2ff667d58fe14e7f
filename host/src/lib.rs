#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! Data flows one way: bytes -> frames -> measurements -> image -> picture.
//!
//! Each line uses the lines above it, and no two modules use each other:
//!
//! * [`clock`] says the time, [`causes`] prints an error with its causes, [`heartbeat`] gives signs of
//!   life of long work, [`stage_times`] measures it, [`boards`] lists the boards with firmware, [`about`]
//!   says what a build contains,
//! * [`identity`] says who a camera is, [`provenance`] where readings come from and what made a file of
//!   them, [`files`] reads and writes what users see,
//! * [`link`] moves bytes, [`session`] exchanges commands with a camera, [`events`] words its reports,
//!   [`versions`] checks whether camera and program fit together, [`fpga`] says in words what an FPGA
//!   answers, [`mod@info`] asks a camera who it is,
//! * [`setup`] is what a camera shows and sums, [`exposure`] how long it looks, [`response`] how it
//!   answers a step of light,
//! * [`account`] counts every frame, [`integrate`] and [`tally`] make measurements of frames,
//!   [`frame_time`] gives the frames of a camera times by this computer's clock,
//! * [`calibration`] measures and keeps latency, settling and flat field, [`selftest`] makes each
//!   [`check`] of a camera,
//! * [`recording`] stores a measurement, [`replay`] plays it back as a camera, [`capture`] runs a
//!   measurement and chooses its calibration, [`export`] writes it for other programs,
//! * [`address`] opens the camera at an address, [`devices`] lists cameras, [`gateware`] loads a camera's
//!   FPGA, [`update`] brings a camera to the versions of a release, [`udev`] gives users access to cameras
//!   on USB; with the feature `flash`, `flash` programs the boards,
//! * [`picture`] draws, [`scene`] is what a camera looks at, [`resolution`] measures the finest detail,
//!   [`legibility`] reads characters,
//! * [`source`] reads measurements from a file, a recording or a capture, `nirspi-recon` reconstructs
//!   images, [`imaging`] scales, enhances and judges them and gives warnings, [`reconstruct`] makes an
//!   image or many of what was read,
//! * [`virtual_camera`] is a camera without hardware: optics simulator, gateware model, real firmware
//!   logic; [`example`] makes example measurements, [`training`] pairs for training networks,
//!   [`safety_case`] says what eye and skin receive and what each fault leaves lit.
//!
//! Without its features (`default-features = false`) the library captures, records, calibrates and
//! reads measurements, without typefaces, optics or networks. The features `enhance`, `pictures`,
//! `virtual-camera` and `training` add the other parts; `gpu` adds the kernels for GPUs. The live page is
//! the crate `nirspi-serve`.

#![cfg_attr(
    target_family = "wasm",
    allow(dead_code, unused_imports, reason = "a browser has no files, and nothing to export to")
)]

pub mod about;
pub mod account;
#[cfg(not(target_family = "wasm"))]
pub mod address;
pub mod boards;
pub mod calibration;
pub mod capture;
pub mod causes;
pub mod check;
pub mod clock;
#[cfg(feature = "virtual-camera")]
pub mod depth_image;
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
pub mod identity;
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
pub mod response;
#[cfg(feature = "virtual-camera")]
pub mod safety_case;
#[cfg(feature = "pictures")]
pub mod scene;
pub mod selftest;
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
