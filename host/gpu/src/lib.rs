#![doc = include_str!("../README.md")]
//!
//! # Modules
//!
//! | module | contents |
//! |---|---|
//! | [`probe`] | finds GPUs |
//! | [`cache`] | keeps compiled CUDA kernels between runs |
//! | `engine` | [`Buffer`]s, and what any engine does: upload, read, say its limits |
//! | `error` | [`GpuError`]: why a device cannot compute |
//! | [`limits`] | the limits of a device |
//! | [`pursuit`] | orthogonal matching pursuit of many frames, for `nirspi-recon` |
//! | [`network`] | convolutional networks, for `nirspi-nets` |
//! | [`agreement`] | agreement of images with their readings, for `nirspi-nets` |
//! | `kernels` | [`open`] gives all of these kernels on one device |
//! | `source` | with the feature `source`: the CUDA source of every kernel, without a GPU |
//! | `card` | with the feature `source`: the kinds of GPUs for which source is written |
//!
//! This crate alone uses CubeCL, for two reasons. Generic code of CubeCL's runtimes is compiled
//! once, where each crate that launches a kernel would compile its own copy. And all launches, with
//! their `unsafe` code, are in three files.
//!
//! # Invariant
//! A kernel does not check its indices. Each function that launches one checks the lengths of the
//! buffers first, and panics if the caller gave other lengths than it promises. No test gives wrong
//! lengths; the tests of OMP and of the networks on a GPU (`.ci/run gpu`) run every kernel.

pub mod agreement;
pub mod cache;
#[cfg(feature = "source")]
pub mod card;
mod engine;
mod error;
mod kernels;
pub mod limits;
pub mod network;
pub mod probe;
pub mod pursuit;
#[cfg(feature = "source")]
pub mod source;

pub use engine::{Buffer, Engine, Numbers};
pub use error::GpuError;
pub use kernels::{Kernels, open};
pub use probe::Gpu;
