#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! Each line uses the lines above it, and no two modules use each other:
//!
//! * [`link`] moves bytes, [`session`] exchanges commands with a camera, [`events`] words its reports,
//!   [`versions`] checks whether camera and program fit together, [`fpga`] says in words what an FPGA
//!   answers, [`signal`] what the meter of the light reads, [`mod@info`] asks a camera who it is,
//! * [`setup`] is what a camera shows and sums, [`exposure`] how long it looks, [`response`] how it
//!   answers a step of light,
//! * [`account`] counts every frame, [`integrate`] and [`tally`] make measurements of frames,
//!   [`frame_time`] gives the frames of a camera times by this computer's clock,
//! * [`calibration`] measures and keeps latency, settling and flat field, [`selftest`] makes each
//!   [`check`] of a camera.

pub mod account;
pub mod calibration;
pub mod check;
pub mod events;
pub mod exposure;
pub mod fpga;
pub mod frame_time;
pub mod info;
pub mod integrate;
pub mod link;
pub mod response;
pub mod sag;
pub mod selftest;
pub mod session;
pub mod setup;
pub mod signal;
pub mod tally;
pub mod versions;
