//! What the files of this folder that `tests/loom` checks take from `std::sync`. There, a module of
//! this name has the same types from the model checker `loom`.

pub use std::sync::atomic::{AtomicU64, Ordering};
pub use std::sync::{Condvar, Mutex};
