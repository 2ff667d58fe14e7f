//! The RTL of the gateware, read from its Veryl sources and simulated at its pins. For tests only.
//!
//! This crate does not know what the RTL should do: the golden model knows, and the tests compare the two.
#![expect(clippy::unwrap_used, reason = "a failed unwrap here fails the test that uses it")]

pub mod pins;
pub mod project;
mod trace;
