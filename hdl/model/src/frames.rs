//! The two banks of 48-bit accumulators, and which of them the host has.
//!
//! The one law: a bank is either being summed into or delivered, never both; so no frame mixes two.

use crate::format;
use crate::settings::Settings;
use nirspi_wire::{
    FrameFlags, PATTERNS,
    fpga::{Header, SUM_MODULUS, Sums},
};

/// Where the sum of a slot belongs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slot {
    /// Place of the pattern in the order.
    pub(crate) index: u16,
    pub(crate) complement: bool,
    /// Overwrites instead of adding: clearing a bank would take a clock a word.
    pub(crate) first_sweep: bool,
}

/// What the window knows of a frame that it has completed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Summary {
    /// Over-range samples.
    pub(crate) over_range: u32,
    /// Clock of the first slot.
    pub(crate) shown_at: u64,
}

/// A frame in the host's hands.
#[derive(Debug, Clone)]
struct Delivered {
    header: Header,
    /// Serialised when first asked for.
    bytes: Option<Vec<u8>>,
}

/// Both banks and the counters of the run.
#[derive(Debug, Clone)]
pub(crate) struct Frames {
    banks: [Vec<Sums>; 2],
    /// The bank being summed into; the other is the delivered one, if any is.
    filling: usize,
    /// A sum of the frame being made has wrapped.
    overflow: bool,
    delivered: Option<Delivered>,
    made: u32,
    lost: u32,
    /// A frame was lost since the last one delivered.
    after_loss: bool,
}

impl Frames {
    pub(crate) fn new() -> Self {
        let bank = || vec![Sums::default(); PATTERNS.into()];
        Self {
            banks: [bank(), bank()],
            filling: 0,
            overflow: false,
            delivered: None,
            made: 0,
            lost: 0,
            after_loss: false,
        }
    }

    /// Begins a run: forgets everything of earlier ones.
    pub(crate) fn restart(&mut self) {
        self.overflow = false;
        self.delivered = None;
        self.made = 0;
        self.lost = 0;
        self.after_loss = false;
    }

    /// Frames completed in this run, lost ones too.
    pub(crate) fn made(&self) -> u32 {
        self.made
    }

    /// Frames of this run that were lost.
    pub(crate) fn lost(&self) -> u32 {
        self.lost
    }

    /// Whether the host has a frame.
    pub(crate) fn ready(&self) -> bool {
        self.delivered.is_some()
    }

    /// Takes the host's frame back.
    pub(crate) fn release(&mut self) {
        self.delivered = None;
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

    /// Delivers the frame just completed, or loses it if the host still has the one before.
    pub(crate) fn complete(&mut self, settings: &Settings, summary: Summary) {
        let sequence = self.made;
        self.made = self.made.wrapping_add(1);
        let overflow = std::mem::take(&mut self.overflow);
        if self.delivered.is_some() {
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
        self.delivered = Some(Delivered { header, bytes: None });
        self.filling = 1 - self.filling;
    }

    /// The host's frame as it crosses the host port.
    pub(crate) fn bytes(&mut self) -> Option<&[u8]> {
        let bank = &self.banks[1 - self.filling];
        let Delivered { header, bytes } = self.delivered.as_mut()?;
        Some(bytes.get_or_insert_with(|| format::frame(header, bank)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registers::Registers;
    use nirspi_wire::fpga::FpgaFrame;

    /// 2^48 counts are 19 hours of full-scale samples: too many to tick, so slot sums are fed directly.
    #[test]
    fn a_sum_wraps_at_48_bits_and_only_its_own_frame_says_so() {
        let settings = Settings::copy(&Registers::new()).unwrap();
        let slot = |first_sweep| Slot { index: 7, complement: false, first_sweep };
        let summary = Summary { over_range: 0, shown_at: 0 };
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
        frames.complete(&settings, Summary { over_range: 0, shown_at: 0 });
        let frame = FpgaFrame::parse(frames.bytes().unwrap()).unwrap();
        assert_eq!(frame.header.flags, FrameFlags::OVERFLOW);
    }
}
