//! Signs of life of a long piece of work, at a regular pace.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Calls a function at a regular pace until it is dropped.
///
/// # Invariant
/// The function is not called again once the heartbeat is dropped
/// (`tests::a_heartbeat_beats_at_its_pace_and_ends_with_its_owner`).
#[derive(Debug)]
pub struct Heartbeat {
    /// Dropped to end the thread.
    alive: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Heartbeat {
    /// Calls `beat` once every `period`, with the time since the start.
    ///
    /// If the system cannot start a thread, the work goes on without signs of life.
    pub fn every(period: Duration, mut beat: impl FnMut(Duration) + Send + 'static) -> Self {
        let (alive, ended) = channel::<()>();
        let work = move || {
            let start = Instant::now();
            while let Err(RecvTimeoutError::Timeout) = ended.recv_timeout(period) {
                beat(start.elapsed());
            }
        };
        let thread = std::thread::Builder::new().name("heartbeat".to_owned()).spawn(work).ok();
        Self { alive: Some(alive), thread }
    }
}

impl Drop for Heartbeat {
    fn drop(&mut self) {
        self.alive = None;
        if let Some(thread) = self.thread.take() {
            // A beat that panicked ends its thread and nothing else.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};

    #[test]
    fn a_heartbeat_beats_at_its_pace_and_ends_with_its_owner() {
        let beats = Arc::new(AtomicU32::new(0));
        let counted = Arc::clone(&beats);
        let period = Duration::from_millis(20);
        let heart = Heartbeat::every(period, move |since| {
            let now = counted.fetch_add(1, Ordering::Relaxed) + 1;
            assert!(since >= period * now);
        });
        let started = Instant::now();
        while beats.load(Ordering::Relaxed) < 3 {
            assert!(started.elapsed() < Duration::from_secs(20), "no beat");
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(started.elapsed() >= 3 * period);
        drop(heart);
        let last = beats.load(Ordering::Relaxed);
        std::thread::sleep(5 * period);
        assert_eq!(beats.load(Ordering::Relaxed), last);
    }
}
