//! Holds the newest frames for the imaging thread.
//!
//! # Invariant
//! The camera's thread never waits to put frames in. Every received frame is counted once: as
//! shown, passed over, failed or waiting
//! (`tests::every_frame_is_shown_passed_over_failed_or_waiting`). No order of the threads loses a
//! frame's wake-up or counts a frame twice (`tests/loom`, which checks this file).

use super::lock;
use super::sync::{Condvar, Mutex};
use nirspi::account::LossCounters;
use serde::Serialize;
#[cfg(not(target_family = "wasm"))]
use std::sync::PoisonError;
#[cfg(not(target_family = "wasm"))]
use std::time::Duration;

/// The account of frames and images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Ledger {
    /// Counts of the frames that the camera made in all runs.
    pub frames: LossCounters,
    /// Counts of the frames that the camera made in the newest run.
    pub run_frames: LossCounters,
    /// Counts of the frames received in all runs.
    pub images: ImageCounters,
}

/// The account of the received frames. An image belongs to its newest frame and may sum earlier
/// frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct ImageCounters {
    /// Frames that were the newest of an image.
    pub shown: u64,
    /// Frames replaced by a newer one before they made an image.
    pub passed_over: u64,
    /// Frames that gave no image.
    pub failed: u64,
    /// Frames in the image being made, or next in the slot.
    pub waiting: u64,
}

impl Ledger {
    fn count(&mut self, earlier: LossCounters, run: LossCounters) {
        (self.frames, self.run_frames) = (earlier + run, run);
    }
}

#[derive(Debug)]
struct Inner<T> {
    next: Option<T>,
    ledger: Ledger,
    /// Whether pages should learn of something else than a frame.
    news: bool,
}

/// A slot for the look of one frame.
#[derive(Debug)]
pub struct Slot<T> {
    inner: Mutex<Inner<T>>,
    filled: Condvar,
}

impl<T> Default for Slot<T> {
    fn default() -> Self {
        let inner = Inner { next: None, ledger: Ledger::default(), news: false };
        Self { inner: Mutex::new(inner), filled: Condvar::default() }
    }
}

impl<T> Slot<T> {
    /// Puts in the look of a received frame of a run after `earlier` runs. A look that was not taken
    /// counts as passed over.
    pub fn offer(&self, look: T, earlier: LossCounters, run: LossCounters) {
        let mut inner = lock(&self.inner);
        inner.ledger.count(earlier, run);
        if inner.next.replace(look).is_some() {
            inner.ledger.images.passed_over += 1;
        } else {
            inner.ledger.images.waiting += 1;
        }
        self.filled.notify_one();
    }

    /// Updates the account of losses of a run after `earlier` runs, without a received frame.
    pub fn account(&self, earlier: LossCounters, run: LossCounters) {
        lock(&self.inner).ledger.count(earlier, run);
    }

    /// Wakes the imaging thread without a frame, so that pages learn of a new state at once.
    pub fn wake(&self) {
        lock(&self.inner).news = true;
        self.filled.notify_one();
    }

    /// Takes the newest look, if there is one within `patience` and before [`wake`](Self::wake).
    /// The caller must then call [`done`](Self::done) or [`leave`](Self::leave).
    #[cfg(not(target_family = "wasm"))]
    pub fn take(&self, patience: Duration) -> Option<T> {
        let inner = lock(&self.inner);
        let idle = |inner: &mut Inner<T>| inner.next.is_none() && !inner.news;
        let waited = self.filled.wait_timeout_while(inner, patience, idle);
        let mut inner = waited.unwrap_or_else(PoisonError::into_inner).0;
        inner.news = false;
        inner.next.take()
    }

    /// Waits for [`wake`](Self::wake) alone, and leaves the newest look in the slot.
    #[cfg(not(target_family = "wasm"))]
    pub fn await_news(&self, patience: Duration) {
        let waited =
            self.filled.wait_timeout_while(lock(&self.inner), patience, |inner| !inner.news);
        waited.unwrap_or_else(PoisonError::into_inner).0.news = false;
    }

    /// Takes the newest look, if there is one now. The caller must then call [`done`](Self::done) or
    /// [`leave`](Self::leave).
    pub fn take_now(&self) -> Option<T> {
        let mut inner = lock(&self.inner);
        inner.news = false;
        inner.next.take()
    }

    /// Records that the taken look became an image, or failed.
    pub fn done(&self, shown: bool) {
        let images = &mut lock(&self.inner).ledger.images;
        images.waiting -= 1;
        if shown {
            images.shown += 1;
        } else {
            images.failed += 1;
        }
    }

    /// Records that the taken look makes no image: a later one shows its frames.
    pub fn leave(&self) {
        let images = &mut lock(&self.inner).ledger.images;
        images.waiting -= 1;
        images.passed_over += 1;
    }

    /// The current account.
    pub fn ledger(&self) -> Ledger {
        lock(&self.inner).ledger
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    /// Ten frames of an earlier run, one of them lost.
    const EARLIER: LossCounters = LossCounters { received: 9, lost: 1, corrupt: 0, late: 0 };

    /// A look that is the number of its frame.
    fn look(number: u64) -> (u64, LossCounters) {
        let frames = LossCounters { received: number, lost: 2, ..LossCounters::default() };
        (number, frames)
    }

    #[test]
    fn news_wake_a_resting_thread_and_leave_the_look_in_the_slot() {
        let slot = Slot::default();
        let (first, frames) = look(1);
        slot.offer(first, LossCounters::default(), frames);
        let began = Instant::now();
        slot.await_news(Duration::from_millis(50));
        assert!(began.elapsed() >= Duration::from_millis(50), "a frame is no news");
        slot.wake();
        slot.await_news(Duration::from_secs(60));
        assert!(began.elapsed() < Duration::from_secs(30));
        assert!(slot.take_now().is_some());
    }

    #[test]
    fn every_frame_is_shown_passed_over_failed_or_waiting() {
        let slot = Slot::default();
        for number in 1..=100u64 {
            let (look, frames) = look(number);
            slot.offer(look, EARLIER, frames);
            if number % 7 == 0 {
                assert!(slot.take(Duration::ZERO).is_some());
                // One more frame arrives while the image is made.
                if number % 2 == 0 {
                    assert_eq!(slot.ledger().images.waiting, 1);
                }
                match number % 5 {
                    0 => slot.leave(),
                    _ => slot.done(number % 3 != 0),
                }
            }
            let Ledger { frames, run_frames, images } = slot.ledger();
            let counted = images.shown + images.passed_over + images.failed + images.waiting;
            assert_eq!((run_frames.received, run_frames.lost), (number, 2));
            assert_eq!((frames.received, frames.lost), (number + 9, 3));
            assert_eq!(counted, number, "{images:?}");
        }
        let images = slot.ledger().images;
        assert_eq!((images.shown, images.failed, images.waiting), (8, 4, 1));
        assert!(slot.take(Duration::ZERO).is_some() && slot.take(Duration::ZERO).is_none());
    }
}
