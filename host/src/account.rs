//! Accounts for frames: every frame that the camera made is counted as received, lost, corrupt or
//! late, and never estimated.
//!
//! # Invariant
//! `received + lost + corrupt + late` is the number of frames made up to the newest frame
//! ([`LossAccount::accounted`]) (`tests::every_frame_made_is_counted_exactly_once`). After the
//! camera has reported how many frames it made, the sum is the number of all frames
//! (`tests::frames_missing_at_the_end_show_once_the_camera_says_how_many_it_made`).
//!
//! A damaged packet does not show which frame it was. The damage is counted when the gap shows: of
//! a gap of `g` frames with `d` damaged packets in it, `min(g, d)` are corrupt and the rest are
//! lost.

use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::ops::Range;

/// Number of gaps kept for late frames. Older gaps are discarded: a late frame of a discarded gap
/// counts as repeated.
const GAPS_REMEMBERED: usize = 1024;

/// How a frame arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrival {
    /// In order, or the first after a gap.
    Received,
    /// Fills a gap that was already counted.
    Late,
    /// Arrived before, and does not count again.
    Repeated,
}

/// The four counters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct LossCounters {
    /// Intact and in order.
    pub received: u64,
    /// Frames that never arrived: a gap in the sequence.
    pub lost: u64,
    /// Frames that arrived damaged.
    pub corrupt: u64,
    /// Frames that arrived intact, but after a newer frame.
    pub late: u64,
}

impl LossCounters {
    /// Number of frames in the account.
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

/// The sum of the accounts of two runs.
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
    /// Number of the next frame in order. The wire carries its lower 32 bits.
    expected: u64,
    /// Damaged packets that do not belong to a gap yet.
    damaged: u64,
    /// Counted gaps, oldest first.
    gaps: VecDeque<Range<u64>>,
    repeated: u64,
    damaged_packets: u64,
}

impl LossAccount {
    /// The account of a run before its start.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The full number of a frame from its lower 32 bits: the number closest to the next in order.
    fn unwrap_sequence(&self, sequence: u32) -> Option<u64> {
        let ahead = sequence.wrapping_sub(self.expected as u32) as i32;
        self.expected.checked_add_signed(i64::from(ahead))
    }

    /// Counts an intact frame with this sequence number on the wire.
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
        // The frame counts as lost so far, unless the whole gap counts as corrupt.
        if self.counters.lost > 0 {
            self.counters.lost -= 1;
        } else {
            self.counters.corrupt -= 1;
        }
        self.counters.late += 1;
        Arrival::Late
    }

    /// Counts a damaged packet.
    pub fn damaged(&mut self) {
        self.damaged += 1;
        self.damaged_packets += 1;
    }

    /// Records how many frames the camera reports to have made.
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

    /// The current counters.
    #[must_use]
    pub fn counters(&self) -> LossCounters {
        self.counters
    }

    /// Number of frames in the account: sequence numbers from 0 to one less than this number.
    #[must_use]
    pub fn accounted(&self) -> u64 {
        self.expected
    }

    /// Frames that arrived twice.
    #[must_use]
    pub fn repeated(&self) -> u64 {
        self.repeated
    }

    /// Number of damaged packets, of frames or not.
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
            // A late frame is subtracted from the lost frames, if there are any.
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
