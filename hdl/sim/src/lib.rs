//! The RTL of the gateware, read from its Veryl sources and simulated at its pins. This crate is
//! for tests only.
//!
//! This crate only runs the RTL. The tests compare the RTL with the golden model.
#![expect(clippy::unwrap_used, reason = "a failed unwrap here fails the test that uses it")]

pub mod pins;
pub mod project;
mod trace;
