//! The bundles of `types.veryl` as ports pack them, and the position of a clock in a run.
//!
//! The position is computed by division, so it is independent of the RTL's counters.

use crate::bench::Field;
use crate::scenario::Dice;
use nirspi_wire::register::Register;

/// Settings of a run, as the host wrote them.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    pub raw: bool,
    pub order_table: bool,
    pub order_sequency: bool,
    pub differential: bool,
    pub alternating: bool,
    pub test_source: bool,
    pub unlit: bool,
    pub packets: bool,
    pub narrow: bool,
    pub patterns: u64,
    pub dwell: u64,
    pub blank: u64,
    pub latency: u64,
    pub sweeps: u64,
    /// 0: until halted.
    pub frames: u64,
    pub raw_length: u64,
    pub watchdog: u64,
    pub duty_limit: u64,
    /// 0: never.
    pub over_range_trip: u64,
}

impl Default for Settings {
    fn default() -> Self {
        let reset = |register: Register| u64::from(register.reset());
        Self {
            raw: false,
            order_table: false,
            order_sequency: false,
            differential: false,
            alternating: false,
            test_source: false,
            unlit: false,
            packets: false,
            narrow: false,
            patterns: reset(Register::Patterns),
            dwell: reset(Register::Dwell),
            blank: reset(Register::Blank),
            latency: reset(Register::Latency),
            sweeps: reset(Register::Sweeps),
            frames: reset(Register::Frames),
            raw_length: reset(Register::RawLength),
            watchdog: reset(Register::Watchdog),
            duty_limit: reset(Register::DutyLimit),
            over_range_trip: reset(Register::OverRangeTrip),
        }
    }
}

/// Bits of the fields of `types::Settings`.
pub const SETTINGS: [usize; 28] =
    [1, 1, 1, 1, 1, 1, 1, 1, 1, 11, 10, 1, 16, 1, 16, 1, 6, 32, 32, 1, 32, 1, 1, 12, 27, 21, 1, 32];
/// Bits of the fields of `types::Stamp`.
pub const STAMP: [usize; 3] = [16, 64, 64];
/// Bits of the fields of `types::Place`.
pub const PLACE: [usize; 11] = [1, 1, 1, 1, 10, 1, 1, 1, 1, 1, 1];
/// Bits of the fields of `types::Header`.
pub const HEADER: [usize; 6] = [16, 32, 32, 32, 64, 64];

impl Settings {
    /// Random settings of a run of some hundred clocks at most.
    pub fn random(dice: &mut Dice) -> Self {
        let dwell = if dice.once_in(3) { 1 } else { dice.range(1, 7) };
        let differential = dice.once_in(2);
        Self {
            differential,
            alternating: differential && dice.once_in(2),
            patterns: dice.range(1, 6),
            dwell,
            blank: if dice.once_in(3) { 0 } else { dice.range(0, dwell - 1) },
            latency: if dice.once_in(4) { dice.pick(&[0, 1, 63]) } else { dice.range(0, 63) },
            sweeps: dice.range(1, 3),
            frames: dice.range(0, 3),
            ..Self::default()
        }
    }

    /// The settings as the fields of `types::Settings`.
    pub fn fields(&self) -> Vec<Field> {
        let values = [
            self.raw.into(),
            self.order_table.into(),
            self.order_sequency.into(),
            self.differential.into(),
            self.alternating.into(),
            self.test_source.into(),
            self.unlit.into(),
            self.packets.into(),
            self.narrow.into(),
            self.patterns,
            self.patterns - 1,
            (self.patterns == 1).into(),
            self.dwell - 1,
            (self.dwell == 1).into(),
            self.blank,
            (self.blank == 0).into(),
            self.latency,
            self.sweeps,
            self.sweeps - 1,
            (self.sweeps == 1).into(),
            self.frames.wrapping_sub(1) & 0xFFFF_FFFF,
            (self.frames == 1).into(),
            (self.frames == 0 || self.raw).into(),
            self.raw_length - 1,
            self.watchdog - 1,
            self.duty_limit,
            (self.over_range_trip != 0).into(),
            self.over_range_trip,
        ];
        values.into_iter().zip(SETTINGS).collect()
    }

    /// Number of slots of a pattern.
    pub fn halves(&self) -> u64 {
        1 + u64::from(self.differential)
    }

    pub fn frame_clocks(&self) -> u64 {
        self.dwell * self.halves() * self.patterns * self.sweeps
    }
}

/// Position of a clock in a run, as `types::Place`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Place {
    pub slot_first: bool,
    pub slot_last: bool,
    pub counts: bool,
    pub index: u64,
    pub complement: bool,
    pub inverted: bool,
    pub sweep_first: bool,
    pub frame_first: bool,
    pub frame_last: bool,
    pub run_last: bool,
}

impl Place {
    /// Position of clock `t`; `None` after the end of the run.
    pub fn of(settings: &Settings, t: u64) -> Option<Self> {
        let (frame, clock) = (t / settings.frame_clocks(), t % settings.frame_clocks());
        let endless = settings.frames == 0 || settings.raw;
        if !endless && frame >= settings.frames {
            return None;
        }
        let (slot, of_slot) = (clock / settings.dwell, clock % settings.dwell);
        let pattern = slot / settings.halves();
        let sweep = frame * settings.sweeps + pattern / settings.patterns;
        let is_swapped = settings.alternating && sweep % 2 == 1;
        let frame_last = clock == settings.frame_clocks() - 1;
        Some(Self {
            slot_first: of_slot == 0,
            slot_last: of_slot == settings.dwell - 1,
            counts: of_slot >= settings.blank,
            index: pattern % settings.patterns,
            complement: settings.differential && (slot % 2 == 1) != is_swapped,
            inverted: settings.alternating && sweep % 4 >= 2,
            sweep_first: pattern / settings.patterns == 0,
            frame_first: clock == 0,
            frame_last,
            run_last: frame_last && !endless && frame == settings.frames - 1,
        })
    }

    /// Position as a port gives it; `None` where the port says inactive.
    ///
    /// # Panics
    /// If the port sets any field of a position outside a run.
    pub fn from_fields(fields: &[u64]) -> Option<Self> {
        let is = |field: usize| fields[field] != 0;
        if !is(0) {
            let marks = [1, 2, 3, 8, 9, 10].map(is);
            assert!(!marks.contains(&true), "marks outside of a run: {fields:?}");
            return None;
        }
        Some(Self {
            slot_first: is(1),
            slot_last: is(2),
            counts: is(3),
            index: fields[4],
            complement: is(5),
            inverted: is(6),
            sweep_first: is(7),
            frame_first: is(8),
            frame_last: is(9),
            run_last: is(10),
        })
    }

    /// The fields for a position; all 0 outside a run.
    pub fn fields(place: Option<Self>) -> Vec<Field> {
        let values = place.map_or([0; 11], |place| {
            [
                1,
                place.slot_first.into(),
                place.slot_last.into(),
                place.counts.into(),
                place.index,
                place.complement.into(),
                place.inverted.into(),
                place.sweep_first.into(),
                place.frame_first.into(),
                place.frame_last.into(),
                place.run_last.into(),
            ]
        });
        values.into_iter().zip(PLACE).collect()
    }
}
