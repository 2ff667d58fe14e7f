//! What the files of this folder that `tests/loom` checks take from `std`. There, a module of this name has the same types
//! from the model checker `loom`.

pub(super) use std::sync::{Arc, Condvar, Mutex, MutexGuard};
pub(super) use std::thread::{Builder as ThreadBuilder, JoinHandle};
