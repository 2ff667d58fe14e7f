//! The chain of counters: clock, complement, pattern, sweep, frame.
//!
//! The gateware has two such chains: one drives the LEDs, the other attributes samples `Latency`
//! clocks later.
//!
//! # Invariant
//! Both chains count alike, so a sample is summed in the slot whose light it measured
//! (`golden::measurement::every_line_and_every_sum_is_the_oracles`).

use crate::settings::Settings;

/// Position of a clock in a run.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sequencer {
    /// Clock of the slot.
    clock: u16,
    /// Whether the slot is the second one of its pattern.
    second: bool,
    /// Whether the sweep shows complements first.
    swapped: bool,
    /// Whether the sweep inverts all lines, which lights the same LEDs.
    inverted: bool,
    index: u16,
    sweep: u32,
    frame: u32,
}

/// The longest unit that ended with a clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ended {
    Clock,
    Slot,
    Frame,
    Run,
}

impl Sequencer {
    /// Clock of the slot, from 0.
    #[inline]
    pub(crate) fn clock(&self) -> u16 {
        self.clock
    }

    /// Whether the slot shows a complement.
    pub(crate) fn complement(&self) -> bool {
        self.second != self.swapped
    }

    /// Whether the slot inverts all lines.
    pub(crate) fn inverted(&self) -> bool {
        self.inverted
    }

    /// Place of the slot's pattern in the order.
    pub(crate) fn index(&self) -> u16 {
        self.index
    }

    /// Whether the sweep is the first of its frame.
    pub(crate) fn first_sweep(&self) -> bool {
        self.sweep == 0
    }

    /// Moves to the next clock.
    #[inline]
    pub(crate) fn step(&mut self, settings: &Settings) -> Ended {
        self.clock += 1;
        if self.clock < settings.dwell {
            return Ended::Clock;
        }
        self.clock = 0;
        if settings.differential && !self.second {
            self.second = true;
            return Ended::Slot;
        }
        self.second = false;
        self.index += 1;
        if self.index < settings.patterns {
            return Ended::Slot;
        }
        self.index = 0;
        self.inverted ^= self.swapped;
        self.swapped = settings.alternating && !self.swapped;
        self.sweep += 1;
        if self.sweep < settings.sweeps {
            return Ended::Slot;
        }
        self.sweep = 0;
        // The count wraps to 0 after 2^32 frames. Only a run without end is that long, and its end
        // is not checked.
        self.frame = self.frame.wrapping_add(1);
        if settings.frames == 0 || self.frame != settings.frames {
            Ended::Frame
        } else {
            Ended::Run
        }
    }
}
