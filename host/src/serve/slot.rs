//! Holds the newest frames for the imaging thread.
//!
//! # Invariant
//! The camera's thread never waits to put frames in. Every received frame is counted once: as
//! shown, passed over, failed or waiting
//! (`tests::every_frame_is_shown_passed_over_failed_or_waiting`).

use super::lock;
use crate::account::LossCounters;
use crate::calibration::{FlatField, Settling};
use crate::clock::Instant;
use crate::integrate::Integrated;
use crate::setup::MeasurementSetup;
use nirspi_nets::DepthMaps;
use serde::Serialize;
use std::sync::{Arc, Condvar, Mutex};
#[cfg(any(test, feature = "serve"))]
use std::time::Duration;

/// One run's setup and the camera's response: everything needed to interpret its frames.
#[derive(Debug)]
pub struct RunSetup {
    /// The measurement's setup.
    pub setup: MeasurementSetup,
    /// The camera's response, if known.
    pub settling: Option<Settling>,
    /// The flat field of its LEDs, if known.
    pub flat_field: Option<FlatField>,
}

/// A depth map in the camera's image.
#[derive(Debug)]
pub struct DepthImage {
    /// The map for the networks.
    pub map: DepthMaps,
    /// (32, 32) distances in metres.
    pub pixels_m: Vec<f32>,
}

/// The newest frames, and the newest depth map.
#[derive(Debug, Clone)]
pub struct Look {
    /// The sum of the frames.
    pub sum: Integrated,
    /// How the frames were measured.
    pub run: Arc<RunSetup>,
    /// The newest depth map.
    pub depth: Option<Arc<DepthImage>>,
    /// When the newest frame came out of the link.
    pub arrived: Instant,
    /// Number of the newest frame among those received, from 1 on.
    pub newest: u64,
}

/// The account of all frames of all runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Ledger {
    /// Counts of the frames that the camera made.
    pub frames: LossCounters,
    /// Counts of the frames received.
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

#[derive(Debug, Default)]
struct Inner {
    next: Option<Look>,
    ledger: Ledger,
    /// Whether pages should learn of something else than a frame.
    news: bool,
}

/// A slot for one [`Look`].
#[derive(Debug, Default)]
pub struct Slot {
    inner: Mutex<Inner>,
    filled: Condvar,
}

impl Slot {
    /// Puts in the look of a received frame. A look that was not taken counts as passed over.
    pub fn offer(&self, look: Look, frames: LossCounters) {
        let mut inner = lock(&self.inner);
        inner.ledger.frames = frames;
        if inner.next.replace(look).is_some() {
            inner.ledger.images.passed_over += 1;
        } else {
            inner.ledger.images.waiting += 1;
        }
        self.filled.notify_one();
    }

    /// Updates the account of losses without a received frame.
    pub fn account(&self, frames: LossCounters) {
        lock(&self.inner).ledger.frames = frames;
    }

    /// Wakes the imaging thread without a frame, so that pages learn of a new state at once.
    pub fn wake(&self) {
        lock(&self.inner).news = true;
        self.filled.notify_one();
    }

    /// Takes the newest look, if there is one within `patience` and before [`wake`](Self::wake).
    /// The caller must then call [`done`](Self::done) or [`leave`](Self::leave).
    #[cfg(any(test, feature = "serve"))]
    pub fn take(&self, patience: Duration) -> Option<Look> {
        let inner = lock(&self.inner);
        let idle = |inner: &mut Inner| inner.next.is_none() && !inner.news;
        let waited = self.filled.wait_timeout_while(inner, patience, idle);
        let mut inner = waited.unwrap_or_else(std::sync::PoisonError::into_inner).0;
        inner.news = false;
        inner.next.take()
    }

    /// Waits for [`wake`](Self::wake) alone, and leaves the newest look in the slot.
    #[cfg(any(test, feature = "serve"))]
    pub fn await_news(&self, patience: Duration) {
        let waited =
            self.filled.wait_timeout_while(lock(&self.inner), patience, |inner| !inner.news);
        waited.unwrap_or_else(std::sync::PoisonError::into_inner).0.news = false;
    }

    /// Takes the newest look, if there is one now. The caller must then call [`done`](Self::done) or
    /// [`leave`](Self::leave).
    pub fn take_now(&self) -> Option<Look> {
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
    use nirspi_recon::Order;

    fn look(number: u64) -> (Look, LossCounters) {
        let setup = MeasurementSetup::new(&Order::Natural, 1.0).unwrap();
        let sum = Integrated::new(&setup);
        let run = Arc::new(RunSetup { setup, settling: None, flat_field: None });
        let frames = LossCounters { received: number, lost: 2, ..LossCounters::default() };
        (Look { sum, run, depth: None, arrived: Instant::now(), newest: number }, frames)
    }

    #[test]
    fn news_wake_a_resting_thread_and_leave_the_look_in_the_slot() {
        let slot = Slot::default();
        let (first, frames) = look(1);
        slot.offer(first, frames);
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
            slot.offer(look, frames);
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
            let Ledger { frames, images } = slot.ledger();
            let counted = images.shown + images.passed_over + images.failed + images.waiting;
            assert_eq!((frames.received, frames.lost), (number, 2));
            assert_eq!(counted, number, "{images:?}");
        }
        let images = slot.ledger().images;
        assert_eq!((images.shown, images.failed, images.waiting), (8, 4, 1));
        assert!(slot.take(Duration::ZERO).is_some() && slot.take(Duration::ZERO).is_none());
    }
}
