//! Attributes samples to slots: latency, blanking, and the sum over a slot.
//!
//! # Invariant
//! The sample of clock `t` belongs to the slot shown at clock `t - Latency`, and to no other slot
//! (`golden::measurement::every_line_and_every_sum_is_the_oracles`).

use crate::frames::{Frames, Slot, Summary};
use crate::sequencer::{Ended, Sequencer};
use crate::settings::Settings;
use crate::source::AdcSample;

/// The sample side of a run.
#[derive(Debug, Clone)]
pub(crate) struct Window {
    /// Clocks until the light of the first slot arrives.
    wait: u8,
    sequencer: Sequencer,
    /// Sum of the slot: at most 65 535 samples of 14 bits, so 30 bits.
    slot_sum: u32,
    /// Over-range samples of the frame.
    over_range: u32,
    /// Sum of the frame's samples, modulo 2^64.
    total: u64,
    /// Clock at which the frame's first slot was shown.
    shown_at: u64,
}

impl Window {
    /// Begins a run whose first slot is shown at clock `now`.
    pub(crate) fn start(settings: &Settings, now: u64) -> Self {
        Self {
            wait: settings.latency,
            sequencer: Sequencer::default(),
            slot_sum: 0,
            over_range: 0,
            total: 0,
            shown_at: now,
        }
    }

    /// Takes the sample of this clock; returns the number of the frame's over-range samples so far.
    #[inline]
    pub(crate) fn take(&mut self, settings: &Settings, sample: AdcSample) -> u32 {
        if self.wait == 0 {
            self.over_range = self.over_range.saturating_add(sample.over_range.into());
            if self.sequencer.clock() >= settings.blank {
                self.slot_sum += u32::from(sample.code);
            }
        }
        self.over_range
    }

    /// Ends clock `now` and stores completed sums. True with the last clock of the run.
    #[inline]
    pub(crate) fn step(&mut self, settings: &Settings, frames: &mut Frames, now: u64) -> bool {
        if self.wait > 0 {
            self.wait -= 1;
            return false;
        }
        let slot = Slot {
            index: self.sequencer.index(),
            complement: self.sequencer.complement(),
            first_sweep: self.sequencer.first_sweep(),
        };
        let ended = self.sequencer.step(settings);
        if ended == Ended::Clock {
            return false;
        }
        let sum = std::mem::take(&mut self.slot_sum);
        self.total = self.total.wrapping_add(sum.into());
        frames.add(slot, sum);
        if ended == Ended::Slot {
            return false;
        }
        frames.complete(
            settings,
            Summary {
                over_range: std::mem::take(&mut self.over_range),
                total: std::mem::take(&mut self.total),
                shown_at: self.shown_at,
            },
        );
        self.shown_at = (now + 1).wrapping_sub(settings.latency.into());
        ended == Ended::Run
    }
}
