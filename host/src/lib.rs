#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! Data flows one way: bytes -> frames -> measurements -> image -> picture.
//!
//! `nirspi-files`, `nirspi-feed`, `nirspi-camera`, `nirspi-record` and `nirspi-picture` are here under one
//! name: [`files`] with [`provenance`]; `feed`; [`session`] and all that a camera says; [`capture`],
//! [`recording`] and [`replay`]; `picture`. Their front pages list their modules. This crate adds, each line using only the lines above
//! it:
//!
//! * [`heartbeat`] gives signs of life of long work, [`stage_times`] measures it, [`about`] says what a build
//!   contains, [`depth_image`] is what a camera's depth sensor sees in its image,
//! * [`scene`] is what a camera looks at,
//! * [`source`] reads measurements from a file, a recording or a capture, `nirspi-recon` reconstructs
//!   images, [`imaging`] scales, enhances and judges them and gives warnings,
//! * `patterns` writes patterns for a projector,
//! * [`reconstruct`] makes an image or many of what was read, [`export`] writes a recording for other
//!   programs, `inspect` says what is in a file and how to read it.
//!
//! Without its features (`default-features = false`) the library captures, records, calibrates and
//! reads measurements, without typefaces or networks. The feature `pictures` adds typefaces, `enhance` these
//! and the networks, `gpu` adds the kernels for GPUs. The virtual camera is the crate `nirspi-virtual`, the live page
//! `nirspi-serve`, updates of a camera `nirspi-update`, how good the camera is `nirspi-eval`.

pub use nirspi_camera::{
    account, calibration, check, events, exposure, fpga, frame_time, info, integrate, link,
    response, selftest, session, setup, signal, tally, versions,
};
#[cfg(not(target_family = "wasm"))]
pub use nirspi_feed as feed;
pub use nirspi_files as files;
pub use nirspi_files::{boards, causes, clock, identity, provenance};
#[cfg(not(target_family = "wasm"))]
pub use nirspi_record::{address, devices, udev};
pub use nirspi_record::{capture, recording, replay};
#[cfg(feature = "pictures")]
pub use pictures as picture;

pub mod about;
pub mod depth_image;
#[cfg(not(target_family = "wasm"))]
pub mod export;
pub mod heartbeat;
pub mod imaging;
#[cfg(not(target_family = "wasm"))]
pub mod inspect;
pub mod moving;
pub mod order_table;
#[cfg(all(feature = "pictures", not(target_family = "wasm")))]
pub mod patterns;
#[cfg(not(target_family = "wasm"))]
pub mod problem;
#[cfg(all(feature = "enhance", not(target_family = "wasm")))]
pub mod reconstruct;
#[cfg(feature = "pictures")]
pub mod scene;
pub mod settings;
#[cfg(not(target_family = "wasm"))]
pub mod source;
pub mod stage_times;

#[cfg(test)]
mod testing;
