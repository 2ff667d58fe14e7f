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
//! * [`address`] opens the camera at an address, [`devices`] lists cameras, [`udev`] gives users access to
//!   cameras on USB,
//! * [`picture`] draws, [`scene`] is what a camera looks at, [`depth_image`] what its depth sensor sees in
//!   its image,
//! * [`source`] reads measurements from a file, a recording or a capture, `nirspi-recon` reconstructs
//!   images, [`imaging`] scales, enhances and judges them and gives warnings, [`reconstruct`] makes an
//!   image or many of what was read.
//!
//! Without its features (`default-features = false`) the library captures, records, calibrates and
//! reads measurements, without typefaces or networks. The features `enhance` and `pictures` add these;
//! `gpu` adds the kernels for GPUs. The virtual camera is the crate `nirspi-virtual`, the live page
//! `nirspi-serve`, updates of a camera `nirspi-update`, how good the camera is `nirspi-eval`.

pub use nirspi_camera::{
    account, calibration, check, events, exposure, fpga, frame_time, info, integrate, link,
    response, selftest, session, setup, signal, tally, versions,
};
pub use nirspi_files as files;
pub use nirspi_files::{boards, causes, clock, identity, provenance};
#[cfg(not(target_family = "wasm"))]
pub use nirspi_record::{address, devices};
pub use nirspi_record::{capture, recording, replay};

pub mod about;
pub mod depth_image;
#[cfg(not(target_family = "wasm"))]
pub mod export;
pub mod heartbeat;
pub mod imaging;
#[cfg(feature = "pictures")]
pub mod picture;
#[cfg(not(target_family = "wasm"))]
pub mod reconstruct;
#[cfg(feature = "pictures")]
pub mod scene;
#[cfg(not(target_family = "wasm"))]
pub mod source;
pub mod stage_times;
pub mod udev;

#[cfg(test)]
mod testing;
