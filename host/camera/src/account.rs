//! Accounts for frames: every frame that the camera made is counted as received, lost, corrupt or
//! late, and never estimated.
//!
//! # Invariant
//! `received + lost + corrupt + late` is the number of frames made up to the newest frame
//! ([`LossAccount::accounted`]) (`tests::every_frame_made_is_counted_exactly_once`), from the first frame of
//! the account on ([`LossAccount::first`]). After the
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

/// A check that a packet failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Check {
    /// No delimiter within the longest packet.
    Length,
    /// The code of the packet's bytes.
    Cobs,
    /// The checksum.
    Crc,
    /// The setup of the measurement, which an intact frame contradicts.
    Setup,
}

impl Check {
    /// What is wrong with such a packet.
    #[must_use]
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Length => "longer than any packet",
            Self::Cobs => "broken COBS code",
            Self::Crc => "wrong CRC-32",
            Self::Setup => "another frame than the setup has",
        }
    }
}

/// How many packets failed each check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct FailedChecks {
    /// Number of packets without a delimiter within the longest packet.
    pub length: u64,
    /// Number of packets with a broken code.
    pub cobs: u64,
    /// Number of packets with a wrong checksum.
    pub crc: u64,
    /// Number of intact frames that contradict the setup.
    pub setup: u64,
}

impl FailedChecks {
    fn add(&mut self, check: Check) {
        *match check {
            Check::Length => &mut self.length,
            Check::Cobs => &mut self.cobs,
            Check::Crc => &mut self.crc,
            Check::Setup => &mut self.setup,
        } += 1;
    }

    /// Each check, and how many packets failed it.
    #[must_use]
    pub fn each(&self) -> [(Check, u64); 4] {
        let Self { length, cobs, crc, setup } = *self;
        [(Check::Length, length), (Check::Cobs, cobs), (Check::Crc, crc), (Check::Setup, setup)]
    }

    /// Number of damaged packets, of frames or not.
    #[must_use]
    pub fn packets(&self) -> u64 {
        self.each().iter().map(|(_, packets)| packets).sum()
    }

    /// The checks that no packet of `before` failed.
    pub fn first_after(self, before: Self) -> impl Iterator<Item = Check> {
        let both = self.each().into_iter().zip(before.each());
        both.filter(|((_, now), (_, before))| *now > 0 && *before == 0).map(|((check, _), _)| check)
    }
}

/// The failed checks of two runs.
impl std::ops::Add for FailedChecks {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            length: self.length + other.length,
            cobs: self.cobs + other.cobs,
            crc: self.crc + other.crc,
            setup: self.setup + other.setup,
        }
    }
}

impl std::fmt::Display for FailedChecks {
    /// The checks that packets failed, as `wrong CRC-32 in 2, broken COBS code in 1`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let failed = self.each().into_iter().filter(|(_, packets)| *packets > 0);
        let failed: Vec<String> =
            failed.map(|(check, packets)| format!("{} in {packets}", check.in_words())).collect();
        f.write_str(&failed.join(", "))
    }
}

/// Accounts for the frames of one run.
#[derive(Debug, Clone, Default)]
pub struct LossAccount {
    /// Number of the first frame in the account.
    first: u64,
    counters: LossCounters,
    /// Number of the next frame in order. The wire carries its lower 32 bits.
    expected: u64,
    /// Damaged packets that do not belong to a gap yet.
    damaged: u64,
    /// Counted gaps, oldest first.
    gaps: VecDeque<Range<u64>>,
    repeated: u64,
    failed: FailedChecks,
}

impl LossAccount {
    /// The account of a run before its start.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The account of the frames of a run from this number on. Earlier frames do not count.
    #[must_use]
    pub fn beginning_at(first: u64) -> Self {
        Self { first, expected: first, ..Self::default() }
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

    /// Counts a packet that failed this check.
    pub fn damaged(&mut self, check: Check) {
        self.damaged += 1;
        self.failed.add(check);
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

    /// Number of the first frame in the account: 0 for a whole run.
    #[must_use]
    pub fn first(&self) -> u64 {
        self.first
    }

    /// Number of the next frame in order. The account has the frames from the first one to the one
    /// before this number. For a whole run this is the number of frames in the account.
    #[must_use]
    pub fn accounted(&self) -> u64 {
        self.expected
    }

    /// Frames that arrived twice.
    #[must_use]
    pub fn repeated(&self) -> u64 {
        self.repeated
    }

    /// The checks that damaged packets failed.
    #[must_use]
    pub fn failed_checks(&self) -> FailedChecks {
        self.failed
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
                    Fate::Damaged => account.damaged(Check::Crc),
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

    /// The second half of a run, of which the first half is in another file.
    #[test]
    fn an_account_from_a_later_frame_on_counts_the_frames_after_it() {
        let mut account = LossAccount::beginning_at(5000);
        assert_eq!(
            (account.first(), account.accounted(), account.counters().total()),
            (5000, 5000, 0)
        );
        assert_eq!(account.frame(5001), Arrival::Received);
        assert_eq!(account.frame(4999), Arrival::Repeated);
        account.made(5003);
        let expected = LossCounters { received: 1, lost: 2, corrupt: 0, late: 0 };
        assert_eq!((account.counters(), account.accounted()), (expected, 5003));
        let mut long = LossAccount::beginning_at(u64::from(u32::MAX) + 2);
        assert_eq!(long.frame(1), Arrival::Received);
    }

    #[test]
    fn a_damaged_frame_is_corrupt_and_not_lost() {
        let mut account = LossAccount::new();
        account.frame(0);
        account.damaged(Check::Crc);
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
