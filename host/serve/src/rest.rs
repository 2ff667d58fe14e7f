//! Rests of the threads that receive.

use super::Shared;
use std::time::{Duration, Instant};

/// Time between two attempts to reconnect.
pub const RETRY: Duration = Duration::from_secs(1);
/// Time between two checks whether to stop.
pub const TICK: Duration = Duration::from_millis(50);

/// Waits for `time`, or until the server stops.
pub fn rest(shared: &Shared, time: Duration) {
    let started = Instant::now();
    while !shared.is_over() && started.elapsed() < time {
        std::thread::sleep(TICK);
    }
}
