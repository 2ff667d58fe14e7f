//! Tests of the golden model against the register map.
//!
//! Expected values come from `oracle`, which computes them in closed form, or from numbers in the
//! test. No expected value comes from the model.
#![expect(clippy::unwrap_used, reason = "a failed unwrap in a helper fails its test")]

mod bench;
mod measurement;
mod oracle;
mod packets;
mod raw;
mod registers;
mod runs;
mod safety;
