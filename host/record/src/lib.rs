#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! * [`recording`] stores a measurement, [`replay`] plays it back as a camera, [`capture`] runs a
//!   measurement and chooses its calibration,
//! * [`address`] opens the camera at an address, [`devices`] lists cameras, [`udev`] gives users access to
//!   cameras on USB.

#[cfg(not(target_family = "wasm"))]
pub mod address;
pub mod capture;
#[cfg(not(target_family = "wasm"))]
pub mod devices;
pub mod recording;
pub mod replay;
#[cfg(not(target_family = "wasm"))]
pub mod udev;
