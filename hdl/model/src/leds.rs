//! Drives the LED lines from the sequencer's slot.
//!
//! # Invariant
//! Lines change only at the first clock of a slot, and are all 0 after the last slot
//! (`golden::measurement::every_line_and_every_sum_is_the_oracles`).

use crate::order::OrderTable;
use crate::sequencer::{Ended, Sequencer};
use crate::settings::Settings;
use nirspi_wire::{SIDE, walsh};

/// Pins of the LED array.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Lines {
    /// Bit `r` is the line of row `r`.
    pub rows: u32,
    /// Bit `c` is the line of column `c`.
    pub columns: u32,
    /// Level of the enable line. At 0 all LEDs are off.
    pub enable: bool,
}

impl Lines {
    /// Whether the LED at this row and column is lit.
    #[must_use]
    pub const fn lit(&self, row: u8, column: u8) -> bool {
        self.enable && walsh::lit(self.rows, self.columns, row, column)
    }
}

/// The 32 Walsh functions as words of sign lines: the contents of a ROM.
static WALSH: [u32; SIDE as usize] = {
    let mut words = [0; SIDE as usize];
    let mut k = 0;
    while k < SIDE {
        words[k as usize] = walsh::lines(k);
        k += 1;
    }
    words
};

/// Half-arrays that a pattern lights. All Walsh functions except the first are balanced.
fn half_arrays(pattern: u16, complement: bool) -> u32 {
    match (pattern, complement) {
        (0, false) => 2,
        (0, true) => 0,
        _ => 1,
    }
}

/// The LED lines and their sequencer.
#[derive(Debug, Clone)]
pub(crate) struct Leds {
    sequencer: Sequencer,
    lines: Lines,
    half_arrays: u32,
    /// The last slot is over.
    over: bool,
}

impl Leds {
    /// Shows the first slot.
    pub(crate) fn start(settings: &Settings, table: &OrderTable) -> Self {
        let mut leds = Self {
            sequencer: Sequencer::default(),
            lines: Lines::default(),
            half_arrays: 0,
            over: false,
        };
        leds.show(settings, table);
        leds
    }

    /// The lines during this clock.
    pub(crate) fn lines(&self) -> Lines {
        self.lines
    }

    /// Half-arrays lit during this clock.
    #[inline]
    pub(crate) fn half_arrays(&self) -> u32 {
        self.half_arrays
    }

    /// Moves to the next clock.
    #[inline]
    pub(crate) fn step(&mut self, settings: &Settings, table: &OrderTable) {
        if self.over {
            return;
        }
        match self.sequencer.step(settings) {
            Ended::Clock => {}
            Ended::Slot | Ended::Frame => self.show(settings, table),
            Ended::Run => {
                self.lines = Lines::default();
                self.half_arrays = 0;
                self.over = true;
            }
        }
    }

    fn show(&mut self, settings: &Settings, table: &OrderTable) {
        let pattern = table.pattern(settings.order, self.sequencer.index());
        let complement = self.sequencer.complement();
        let side = u16::from(SIDE);
        let inverted = self.sequencer.inverted();
        let signs = |k: u16, inverts: bool| {
            let lines = WALSH[usize::from(k)];
            if inverts { !lines } else { lines }
        };
        self.lines = Lines {
            rows: signs(pattern / side, complement != inverted),
            columns: signs(pattern % side, inverted),
            enable: !settings.unlit,
        };
        self.half_arrays = if settings.unlit { 0 } else { half_arrays(pattern, complement) };
    }
}
