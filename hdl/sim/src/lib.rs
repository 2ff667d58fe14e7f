//! The RTL of the gateware, read from its Veryl sources and simulated at its pins. For tests only.
//!
//! The one law: nothing here knows what the RTL should do; the golden model does, and tests compare.
#![cfg(feature = "veryl")]
#![expect(clippy::unwrap_used, reason = "a failed unwrap here fails the test that uses it")]

pub mod pins;
pub mod project;
mod trace;
