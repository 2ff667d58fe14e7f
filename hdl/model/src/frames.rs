//! The three banks of 48-bit accumulators: one bank sums the current frame, one holds the frame
//! delivered to the host, and one the frame that waits behind the delivered frame.
//!
//! # Invariant
//! A frame never mixes with another frame: it is delivered whole or lost whole
//! (`golden::runs::a_slow_host_loses_whole_frames_and_every_loss_is_counted_once`). Frames are delivered in
//! the order in which they were made (`golden::runs::a_frame_that_waits_is_delivered_at_the_release`).

use crate::format;
use crate::packet::{Stamp, packet};
use crate::settings::Settings;
use nirspi_wire::{
    FrameFlags, PATTERNS,
    fpga::{Header, SUM_MODULUS, Sums},
    register::WAITING_FRAMES,
    samples::Width,
};
use std::collections::VecDeque;

/// The banks of the frames that wait, and the one that is being filled.
const BANKS: usize = WAITING_FRAMES + 1;

/// Which sum a slot adds to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slot {
    /// Place of the pattern in the order.
    pub(crate) index: u16,
    pub(crate) complement: bool,
    /// Overwrite the sum instead of adding to it: clearing a bank would take a clock for each word.
    pub(crate) first_sweep: bool,
}

/// Counts that the window keeps of a completed frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Summary {
    /// Over-range samples.
    pub(crate) over_range: u32,
    /// Sum of its samples, modulo 2^64.
    pub(crate) total: u64,
    /// Clock of the first slot.
    pub(crate) shown_at: u64,
}

/// A frame that is delivered or waits to be delivered.
#[derive(Debug, Clone)]
struct Complete {
    bank: usize,
    header: Header,
    /// Sum of its samples, modulo 2^64.
    total: u64,
    /// What the packet carries beside the frame, if the frame is sent as one, and the width of its samples.
    packet: Option<(Stamp, Width)>,
    /// The frame's bytes, serialised at the first request.
    bytes: Option<Vec<u8>>,
}

/// The banks and the counters of the run.
#[derive(Debug, Clone)]
pub(crate) struct Frames {
    banks: [Vec<Sums>; BANKS],
    /// The bank being summed into.
    filling: usize,
    /// A sum of the current frame has wrapped.
    overflow: bool,
    /// Frames in banks of their own, oldest first. The first one is delivered, the other waits behind it.
    waiting: VecDeque<Complete>,
    made: u32,
    lost: u32,
    /// A frame was lost after the last one that found a bank.
    after_loss: bool,
    /// As of the start of the run.
    stamp: Stamp,
    /// Frames of the run leave by the parallel port.
    parallel: bool,
}

impl Frames {
    pub(crate) fn new() -> Self {
        let bank = || vec![Sums::default(); PATTERNS.into()];
        Self {
            banks: std::array::from_fn(|_| bank()),
            filling: 0,
            overflow: false,
            waiting: VecDeque::new(),
            made: 0,
            lost: 0,
            after_loss: false,
            stamp: Stamp::default(),
            parallel: false,
        }
    }

    /// Begins a run and forgets all earlier runs.
    pub(crate) fn restart(&mut self, stamp: Stamp, parallel: bool) {
        self.stamp = stamp;
        self.parallel = parallel;
        self.overflow = false;
        self.waiting.clear();
        self.made = 0;
        self.lost = 0;
        self.after_loss = false;
    }

    /// Frames completed in this run, including lost frames.
    pub(crate) fn made(&self) -> u32 {
        self.made
    }

    /// Frames of this run that were lost.
    pub(crate) fn lost(&self) -> u32 {
        self.lost
    }

    /// Whether the host port can read a frame.
    pub(crate) fn ready(&self) -> bool {
        !self.parallel && !self.waiting.is_empty()
    }

    /// Sum of the samples and number of over-range samples of the delivered frame; 0 without one.
    pub(crate) fn measures(&self) -> (u64, u32) {
        self.waiting.front().map_or((0, 0), |frame| (frame.total, frame.header.over_range))
    }

    /// Takes the delivered frame back, unless it is the parallel port's. The frame that waits behind it is delivered.
    pub(crate) fn release(&mut self) {
        if !self.parallel {
            self.waiting.pop_front();
        }
    }

    /// The packet that the parallel port sends next or is sending.
    pub(crate) fn outgoing(&mut self) -> Option<&[u8]> {
        if self.parallel { self.oldest() } else { None }
    }

    /// The parallel port has sent its packet and takes the frame back.
    pub(crate) fn sent(&mut self) {
        if self.parallel {
            self.waiting.pop_front();
        }
    }

    /// Adds the sum of one slot.
    pub(crate) fn add(&mut self, slot: Slot, sum: u32) {
        let sums = &mut self.banks[self.filling][usize::from(slot.index)];
        let half = if slot.complement { &mut sums.negative } else { &mut sums.positive };
        let before = if slot.first_sweep { 0 } else { *half };
        let after = before + u64::from(sum);
        self.overflow |= after >= SUM_MODULUS;
        *half = after % SUM_MODULUS;
    }

    /// Delivers the completed frame, now or at a release, or loses the frame if so many wait for the host that
    /// no bank is left.
    pub(crate) fn complete(&mut self, settings: &Settings, summary: Summary) {
        let sequence = self.made;
        self.made = self.made.wrapping_add(1);
        let overflow = std::mem::take(&mut self.overflow);
        if self.waiting.len() == WAITING_FRAMES {
            self.lost = self.lost.wrapping_add(1);
            self.after_loss = true;
            return;
        }
        let flags = [
            (summary.over_range > 0, FrameFlags::OVER_RANGE),
            (overflow, FrameFlags::OVERFLOW),
            (std::mem::take(&mut self.after_loss), FrameFlags::AFTER_LOSS),
            (settings.test_source, FrameFlags::TEST_SOURCE),
            (settings.differential, FrameFlags::DIFFERENTIAL),
        ]
        .into_iter()
        .filter(|(set, _)| *set)
        .fold(FrameFlags::default(), |flags, (_, flag)| flags.with(flag));
        let header = Header {
            patterns: settings.patterns,
            flags,
            sequence,
            sweeps: settings.sweeps,
            over_range: summary.over_range,
            lost: self.lost,
            clock: summary.shown_at,
        };
        let packet = settings.packets.then_some((self.stamp, settings.width));
        let (bank, total) = (self.filling, summary.total);
        self.waiting.push_back(Complete { bank, header, total, packet, bytes: None });
        // Banks are filled in turn, and frames come and go in one order, so the next bank is free.
        self.filling = (bank + 1) % BANKS;
    }

    /// The host's frame as it crosses the host port.
    pub(crate) fn bytes(&mut self) -> Option<&[u8]> {
        if self.parallel { None } else { self.oldest() }
    }

    /// The oldest frame that waits, as bytes.
    fn oldest(&mut self) -> Option<&[u8]> {
        let Complete { bank, header, packet: form, bytes, .. } = self.waiting.front_mut()?;
        let bank = &self.banks[*bank];
        Some(bytes.get_or_insert_with(|| match form {
            Some((stamp, width)) => packet(header, bank, stamp, *width),
            None => format::frame(header, bank),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registers::Registers;
    use nirspi_wire::fpga::FpgaFrame;

    /// 2^48 counts are 19 hours of full-scale samples, too many to tick, so the test feeds slot
    /// sums directly.
    #[test]
    fn a_sum_wraps_at_48_bits_and_only_its_own_frame_says_so() {
        let settings = Settings::copy(&Registers::new()).unwrap();
        let slot = |first_sweep| Slot { index: 7, complement: false, first_sweep };
        let summary = Summary { over_range: 0, total: 0, shown_at: 0 };
        let mut frames = Frames::new();

        frames.add(slot(true), u32::MAX);
        for _ in 1..=1 << 16 {
            frames.add(slot(false), u32::MAX);
        }
        frames.complete(&settings, summary);
        let frame = FpgaFrame::parse(frames.bytes().unwrap()).unwrap();
        let exact = u64::from(u32::MAX) * ((1 << 16) + 1);
        assert!(exact >= SUM_MODULUS);
        assert_eq!(frame.sums().nth(7).unwrap().positive, exact - SUM_MODULUS);
        assert_eq!(frame.header.flags, FrameFlags::OVERFLOW);

        frames.release();
        frames.add(slot(true), 5);
        frames.complete(&settings, summary);
        let frame = FpgaFrame::parse(frames.bytes().unwrap()).unwrap();
        assert_eq!(frame.sums().nth(7).unwrap().positive, 5);
        assert_eq!(frame.header.flags, FrameFlags::default());
    }

    #[test]
    fn the_largest_sum_short_of_the_modulus_is_no_overflow() {
        let settings = Settings::copy(&Registers::new()).unwrap();
        let mut frames = Frames::new();
        let slot = |first_sweep| Slot { index: 0, complement: true, first_sweep };
        frames.add(slot(true), u32::MAX);
        for _ in 1..1 << 16 {
            frames.add(slot(false), u32::MAX);
        }
        frames.add(slot(false), (1 << 16) - 1);
        assert_eq!(frames.banks[0][0].negative, SUM_MODULUS - 1);
        assert!(!frames.overflow);
        frames.add(slot(false), 1);
        assert_eq!(frames.banks[0][0].negative, 0);
        assert!(frames.overflow);
        frames.complete(&settings, Summary { over_range: 0, total: 0, shown_at: 0 });
        let frame = FpgaFrame::parse(frames.bytes().unwrap()).unwrap();
        assert_eq!(frame.header.flags, FrameFlags::OVERFLOW);
    }
}
