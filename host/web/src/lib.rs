//! The virtual camera, or a real one on USB, and its live page for a browser: the functions that `page/worker.js` calls.
//!
//! This crate computes nothing: [`Turns`](nirspi_serve::Turns) does. Bytes go in and out through
//! one buffer, whose place and length the page asks for, so no generator of bindings is needed.

#![cfg(target_family = "wasm")]

mod exports;
mod page;
mod usb;
