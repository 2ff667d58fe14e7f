//! The golden model against what the register map promises.
//!
//! The one law: expectations come from `oracle`, which computes in closed form, or from numbers in the
//! test itself; never from the model.
#![expect(clippy::unwrap_used, reason = "a failed unwrap in a helper fails its test")]

mod bench;
mod measurement;
mod oracle;
mod raw;
mod registers;
mod runs;
mod safety;
