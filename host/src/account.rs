//! Every frame that the camera made is received, lost, corrupt or late: counted, never estimated.
//!
//! The one law: `received + lost + corrupt + late` is the number of frames made, as far as the account has
//! come ([`LossAccount::accounted`]); once the camera has said how many it made, of all of them.
//!
//! A damaged packet does not say which frame it was. It is charged when the gap shows: of a gap of `g` frames
//! with `d` damaged packets in it, `min(g, d)` are corrupt and the rest lost.

use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::ops::Range;

/// Gaps remembered for frames that come late after all. Older ones are forgotten: a frame from before them
/// counts as repeated.
const GAPS_REMEMBERED: usize = 1024;

/// What a frame was to the account.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrival {
    /// In order, or the first after a gap.
    Received,
    /// Fills a gap that had been charged already.
    Late,
    /// Was here before: no frame of its own.
    Repeated,
}

/// The four counters, and what explains them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct LossCounters {
    /// Intact and in order.
    pub received: u64,
    /// Never came: a gap in the sequence.
    pub lost: u64,
    /// Came damaged.
    pub corrupt: u64,
    /// Came intact, but after a newer one.
    pub late: u64,
}

impl LossCounters {
    /// Frames accounted for.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.received + self.lost + self.corrupt + self.late
    }

    /// Whether every frame was received.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.received == self.total()
    }
}

/// The account of two runs as one.
impl std::ops::Add for LossCounters {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            received: self.received + other.received,
            lost: self.lost + other.lost,
            corrupt: self.corrupt + other.corrupt,
            late: self.late + other.late,
        }
    }
}

impl std::fmt::Display for LossCounters {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { received, lost, corrupt, late } = self;
        write!(f, "{received} received, {lost} lost, {corrupt} corrupt, {late} late")
    }
}

/// Accounts for the frames of one run.
#[derive(Debug, Clone, Default)]
pub struct LossAccount {
    counters: LossCounters,
    /// Number of the next frame in order; the wire carries its lower 32 bits.
    expected: u64,
    /// Damaged packets not yet charged to a gap.
    damaged: u64,
    /// Gaps charged, oldest first.
    gaps: VecDeque<Range<u64>>,
    repeated: u64,
    damaged_packets: u64,
}

impl LossAccount {
    /// An account of a run that is about to start.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The full number of a frame from its lower 32 bits: the one closest to the next in order.
    fn unwrap_sequence(&self, sequence: u32) -> Option<u64> {
        let ahead = sequence.wrapping_sub(self.expected as u32) as i32;
        self.expected.checked_add_signed(i64::from(ahead))
    }

    /// An intact frame came, with this sequence number on the wire.
    pub fn frame(&mut self, sequence: u32) -> Arrival {
        let Some(sequence) = self.unwrap_sequence(sequence) else {
            self.repeated += 1;
            return Arrival::Repeated;
        };
        if sequence >= self.expected {
            self.charge_gap(sequence);
            self.expected = sequence + 1;
            self.counters.received += 1;
            return Arrival::Received;
        }
        let Some(at) = self.gaps.iter().position(|gap| gap.contains(&sequence)) else {
            self.repeated += 1;
            return Arrival::Repeated;
        };
        let gap = self.gaps[at].clone();
        self.gaps.remove(at);
        for part in [sequence + 1..gap.end, gap.start..sequence] {
            if !part.is_empty() {
                self.gaps.insert(at, part);
            }
        }
        // It was charged as lost, unless the whole gap was put down to damage.
        if self.counters.lost > 0 {
            self.counters.lost -= 1;
        } else {
            self.counters.corrupt -= 1;
        }
        self.counters.late += 1;
        Arrival::Late
    }

    /// A damaged packet came.
    pub fn damaged(&mut self) {
        self.damaged += 1;
        self.damaged_packets += 1;
    }

    /// The camera says how many frames it has made.
    pub fn made(&mut self, frames: u32) {
        match self.unwrap_sequence(frames) {
            Some(frames) if frames > self.expected => {
                self.charge_gap(frames);
                self.expected = frames;
            }
            _ => {}
        }
    }

    fn charge_gap(&mut self, next: u64) {
        let gap = self.expected..next;
        let length = next - self.expected;
        let corrupt = length.min(std::mem::take(&mut self.damaged));
        self.counters.corrupt += corrupt;
        self.counters.lost += length - corrupt;
        if !gap.is_empty() {
            self.gaps.push_back(gap);
            if self.gaps.len() > GAPS_REMEMBERED {
                self.gaps.pop_front();
            }
        }
    }

    /// The four counters now.
    #[must_use]
    pub fn counters(&self) -> LossCounters {
        self.counters
    }

    /// Frames accounted for: sequence numbers 0 to this less one.
    #[must_use]
    pub fn accounted(&self) -> u64 {
        self.expected
    }

    /// Frames that came twice.
    #[must_use]
    pub fn repeated(&self) -> u64 {
        self.repeated
    }

    /// Damaged packets in all, whether they were frames or not.
    #[must_use]
    pub fn damaged_packets(&self) -> u64 {
        self.damaged_packets
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[derive(Debug, Clone, Copy, PartialEq)]
    enum Fate {
        Arrives,
        Lost,
        Damaged,
        /// Arrives after the next frame that arrives.
        Delayed,
        Doubled,
    }

    proptest! {
        #[test]
        fn every_frame_made_is_counted_exactly_once(
            fates in prop::collection::vec(prop_oneof![
                5 => Just(Fate::Arrives), 1 => Just(Fate::Lost), 1 => Just(Fate::Damaged),
                1 => Just(Fate::Delayed), 1 => Just(Fate::Doubled),
            ], 0..200)
        ) {
            let mut account = LossAccount::new();
            let mut delayed: Option<u32> = None;
            let mut late = 0;
            for (sequence, fate) in (0u32..).zip(&fates) {
                match fate {
                    Fate::Lost => {}
                    Fate::Damaged => account.damaged(),
                    Fate::Delayed if delayed.is_none() => delayed = Some(sequence),
                    _ => {
                        prop_assert_eq!(account.frame(sequence), Arrival::Received);
                        if *fate == Fate::Doubled {
                            prop_assert_eq!(account.frame(sequence), Arrival::Repeated);
                        }
                        if let Some(earlier) = delayed.take() {
                            prop_assert_eq!(account.frame(earlier), Arrival::Late);
                            late += 1;
                        }
                    }
                }
                prop_assert_eq!(account.counters().total(), account.accounted());
            }
            account.made(fates.len() as u32);
            let counters = account.counters();
            prop_assert_eq!(counters.total(), fates.len() as u64);
            prop_assert_eq!(counters.late, late);
            let count = |fate| fates.iter().filter(|&&f| f == fate).count() as u64;
            // A late frame is taken out of the lost ones while there are any.
            prop_assert_eq!(counters.lost + counters.corrupt,
                count(Fate::Lost) + count(Fate::Damaged) + u64::from(delayed.is_some()));
        }
    }

    #[test]
    fn a_dropped_frame_is_counted_once() {
        let mut account = LossAccount::new();
        account.frame(0);
        account.frame(2);
        account.made(3);
        let expected = LossCounters { received: 2, lost: 1, corrupt: 0, late: 0 };
        assert_eq!(account.counters(), expected);
    }

    #[test]
    fn two_days_of_frames_wrap_the_sequence_and_lose_nothing() {
        let mut account = LossAccount { expected: u64::from(u32::MAX) - 1, ..LossAccount::new() };
        for sequence in [u32::MAX - 1, u32::MAX, 0, 2] {
            assert_eq!(account.frame(sequence), Arrival::Received);
        }
        assert_eq!(account.frame(1), Arrival::Late);
        assert_eq!(account.counters(), LossCounters { received: 4, late: 1, ..Default::default() });
    }

    #[test]
    fn a_damaged_frame_is_corrupt_and_not_lost() {
        let mut account = LossAccount::new();
        account.frame(0);
        account.damaged();
        account.frame(2);
        let expected = LossCounters { received: 2, lost: 0, corrupt: 1, late: 0 };
        assert_eq!(account.counters(), expected);
    }

    #[test]
    fn frames_missing_at_the_end_show_once_the_camera_says_how_many_it_made() {
        let mut account = LossAccount::new();
        account.frame(0);
        account.made(4);
        assert_eq!(account.counters().lost, 3);
        account.made(4);
        assert_eq!(account.counters().total(), 4);
    }
}
