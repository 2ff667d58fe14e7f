//! The place where the newest frames wait for whoever makes images of them.
//!
//! The one law: whoever puts something in never waits, and every frame received is shown, passed over, failed or waiting:
//! counted, as losses are.

use super::lock;
use crate::account::LossCounters;
use crate::calibration::{FlatField, Settling};
use crate::integrate::Integrated;
use crate::setup::MeasurementSetup;
use nirspi_nets::DepthMaps;
use serde::Serialize;
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

/// One run's setup and what is known of the camera's response: all that its frames need to be understood.
#[derive(Debug)]
pub struct RunSetup {
    /// What was measured.
    pub setup: MeasurementSetup,
    /// The camera's response, where it is known.
    pub settling: Option<Settling>,
    /// How much its LEDs differ, where that is known.
    pub flat_field: Option<FlatField>,
}

/// The newest frames and what was seen beside them.
#[derive(Debug, Clone)]
pub struct Look {
    /// Their sum.
    pub sum: Integrated,
    /// How they were measured.
    pub run: Arc<RunSetup>,
    /// The newest depth map.
    pub depth: Option<Arc<DepthMaps>>,
}

/// What became of all frames of all runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Ledger {
    /// Of those that the camera made.
    pub frames: LossCounters,
    /// Of those received.
    pub images: ImageCounters,
}

/// What became of the frames received. An image is that of the newest frame, and of some before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct ImageCounters {
    /// Were the newest of an image.
    pub shown: u64,
    /// A newer one came before there was time for them.
    pub passed_over: u64,
    /// Gave no image.
    pub failed: u64,
    /// Are being made into one, or will be next.
    pub waiting: u64,
}

#[derive(Debug, Default)]
struct Inner {
    next: Option<Look>,
    ledger: Ledger,
}

/// Room for one [`Look`].
#[derive(Debug, Default)]
pub struct Slot {
    inner: Mutex<Inner>,
    filled: Condvar,
}

impl Slot {
    /// A frame was received: this is the look of it. One that nobody took is passed over.
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

    /// The account has changed without a frame received.
    pub fn account(&self, frames: LossCounters) {
        lock(&self.inner).ledger.frames = frames;
    }

    /// The newest look, if there is one within `patience`. [`done`](Self::done) follows.
    pub fn take(&self, patience: Duration) -> Option<Look> {
        let inner = lock(&self.inner);
        let waited = self.filled.wait_timeout_while(inner, patience, |inner| inner.next.is_none());
        waited.unwrap_or_else(std::sync::PoisonError::into_inner).0.next.take()
    }

    /// What was taken has become an image, or failed to.
    pub fn done(&self, shown: bool) {
        let images = &mut lock(&self.inner).ledger.images;
        images.waiting -= 1;
        if shown {
            images.shown += 1;
        } else {
            images.failed += 1;
        }
    }

    /// The account now.
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
        (Look { sum, run, depth: None }, frames)
    }

    #[test]
    fn every_frame_is_shown_passed_over_failed_or_waiting() {
        let slot = Slot::default();
        for number in 1..=100u64 {
            let (look, frames) = look(number);
            slot.offer(look, frames);
            if number % 7 == 0 {
                assert!(slot.take(Duration::ZERO).is_some());
                // One more comes while the image is made.
                if number % 2 == 0 {
                    assert_eq!(slot.ledger().images.waiting, 1);
                }
                slot.done(number % 3 != 0);
            }
            let Ledger { frames, images } = slot.ledger();
            let counted = images.shown + images.passed_over + images.failed + images.waiting;
            assert_eq!((frames.received, frames.lost), (number, 2));
            assert_eq!(counted, number, "{images:?}");
        }
        let images = slot.ledger().images;
        assert_eq!((images.shown, images.failed, images.waiting), (10, 4, 1));
        assert!(slot.take(Duration::ZERO).is_some() && slot.take(Duration::ZERO).is_none());
    }
}
