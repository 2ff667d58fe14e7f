//! The expected sums in closed form: loops over slots, without state.

use crate::bench::Bench;
use nirspi_hdl_model::{AdcSample, Lines};
use nirspi_wire::{
    FrameFlags,
    fpga::{Header, Sums},
    register::{ORDER_TABLE, Register, TEST_SEED, mode, test_sample},
};
use proptest::prelude::*;

#[derive(Debug, Clone)]
pub enum Order {
    Natural,
    Sequency,
    Table(Vec<u16>),
}

/// A measurement setup.
#[derive(Debug, Clone)]
pub struct Setup {
    pub order: Order,
    pub patterns: u16,
    pub differential: bool,
    pub alternating: bool,
    pub test_source: bool,
    pub dwell: u16,
    pub blank: u16,
    pub latency: u8,
    pub sweeps: u32,
    pub frames: u32,
}

/// A frame, as read or as expected.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Measured {
    pub header: Header,
    pub sums: Vec<Sums>,
}

impl Setup {
    /// Writes all settings without starting; over-range samples never trip.
    pub fn apply(&self, bench: &mut Bench) {
        let mut bits = 0;
        if let Order::Table(table) = &self.order {
            for (i, &pattern) in table.iter().enumerate() {
                assert!(bench.0.write(ORDER_TABLE + i as u16, pattern.into()));
            }
            // The table bit must win over the sequency bit.
            bits |= mode::ORDER_TABLE | mode::ORDER_SEQUENCY;
        }
        if matches!(self.order, Order::Sequency) {
            bits |= mode::ORDER_SEQUENCY;
        }
        if self.differential {
            bits |= mode::DIFFERENTIAL;
        }
        if self.alternating {
            bits |= mode::ALTERNATING;
        }
        if self.test_source {
            bits |= mode::TEST_SOURCE;
        }
        bench.set(Register::Mode, bits);
        bench.set(Register::Patterns, self.patterns.into());
        bench.set(Register::Dwell, self.dwell.into());
        bench.set(Register::Blank, self.blank.into());
        bench.set(Register::Latency, self.latency.into());
        bench.set(Register::Sweeps, self.sweeps);
        bench.set(Register::Frames, self.frames);
        bench.set(Register::OverRangeTrip, 0);
    }

    /// The pattern shown k-th. Sequency order is bit-reversed Gray code; `wire` tests its sign
    /// changes.
    pub fn pattern(&self, k: u16) -> u16 {
        match &self.order {
            Order::Natural => k,
            Order::Sequency => {
                (0..10).filter(|bit| (k ^ (k >> 1)) >> bit & 1 == 1).map(|bit| 512 >> bit).sum()
            }
            Order::Table(table) => table[usize::from(k)],
        }
    }

    fn slots_per_sweep(&self) -> u64 {
        u64::from(self.patterns) * if self.differential { 2 } else { 1 }
    }

    pub fn clocks_per_frame(&self) -> u64 {
        u64::from(self.sweeps) * self.slots_per_sweep() * u64::from(self.dwell)
    }

    /// Clocks of the whole run in which the LEDs are lit.
    pub fn lit_clocks(&self) -> u64 {
        u64::from(self.frames) * self.clocks_per_frame()
    }

    /// Clock of the run after which frame `f` is complete.
    pub fn complete_after(&self, f: u32) -> u64 {
        u64::from(f + 1) * self.clocks_per_frame() + u64::from(self.latency)
    }

    /// Whether a slot of a differential sweep shows a complement; the run's sweeps count from 0.
    fn complement(&self, sweep: u64, slot: u64) -> bool {
        let first = self.alternating && sweep % 2 == 1;
        slot % 2 == u64::from(!first)
    }

    /// The lines at clock `t` of the run.
    pub fn lines(&self, t: u64) -> Lines {
        if t >= self.lit_clocks() {
            return Lines::default();
        }
        let slots = t / u64::from(self.dwell);
        let (sweep, slot) = (slots / self.slots_per_sweep(), slots % self.slots_per_sweep());
        let (k, complement, inverted) = if self.differential {
            let second_pair = self.alternating && sweep % 4 >= 2;
            (slot / 2, self.complement(sweep, slot), second_pair)
        } else {
            (slot, false, false)
        };
        let pattern = u32::from(self.pattern(k as u16));
        let sign_lines = |half: u32, inverted: bool| {
            (0..32).map(|i| (((half & i).count_ones() % 2) ^ u32::from(inverted)) << i).sum()
        };
        Lines {
            rows: sign_lines(pattern >> 5, complement != inverted),
            columns: sign_lines(pattern & 31, inverted),
            enable: true,
        }
    }

    /// Frame `f` of a run begun at clock `start`; `samples(t)` is the ADC's sample of the run's clock `t`.
    pub fn frame(&self, f: u32, start: u64, samples: &impl Fn(u64) -> AdcSample) -> Measured {
        let sample = |t: u64| {
            if !self.test_source {
                return samples(t);
            }
            let code = (0..t % ((1 << 14) - 1)).fold(TEST_SEED, |state, _| test_sample(state));
            AdcSample { code, over_range: false }
        };
        let mut sums = vec![Sums::default(); self.patterns.into()];
        let mut over_range = 0;
        let first_slot = u64::from(f) * self.clocks_per_frame();
        for sweep in 0..u64::from(self.sweeps) {
            for slot in 0..self.slots_per_sweep() {
                let shown =
                    first_slot + (sweep * self.slots_per_sweep() + slot) * u64::from(self.dwell);
                for clock in 0..self.dwell {
                    let sample = sample(shown + u64::from(clock) + u64::from(self.latency));
                    over_range += u32::from(sample.over_range);
                    if clock < self.blank {
                        continue;
                    }
                    if !self.differential {
                        sums[slot as usize].positive += u64::from(sample.code);
                    } else if self.complement(u64::from(f) * u64::from(self.sweeps) + sweep, slot) {
                        sums[slot as usize / 2].negative += u64::from(sample.code);
                    } else {
                        sums[slot as usize / 2].positive += u64::from(sample.code);
                    }
                }
            }
        }
        let mut flags = FrameFlags::default();
        if over_range > 0 {
            flags = flags.with(FrameFlags::OVER_RANGE);
        }
        if self.test_source {
            flags = flags.with(FrameFlags::TEST_SOURCE);
        }
        if self.differential {
            flags = flags.with(FrameFlags::DIFFERENTIAL);
        }
        let header = Header {
            patterns: self.patterns,
            flags,
            sequence: f,
            sweeps: self.sweeps,
            over_range,
            lost: 0,
            clock: start + first_slot,
        };
        Measured { header, sums }
    }
}

fn order() -> impl Strategy<Value = Order> {
    let all: Vec<u16> = (0..1024).collect();
    prop_oneof![
        Just(Order::Natural),
        Just(Order::Sequency),
        Just(all).prop_shuffle().prop_map(Order::Table),
        prop::collection::vec(0u16..1024, 1024).prop_map(Order::Table),
    ]
}

/// Small setups of every kind, a few thousand clocks long.
pub fn setup() -> impl Strategy<Value = Setup> {
    let size = prop_oneof![
        9 => (1u16..24, 1u16..10, 1u32..4, 1u32..4),
        1 => (1020u16..=1024, 1u16..3, Just(1u32), 1u32..3),
    ];
    (order(), size, any::<[bool; 2]>(), prop::bool::weighted(0.1), any::<u16>(), 0u8..64).prop_map(
        |(order, (patterns, dwell, sweeps, frames), pairs, test_source, blank, latency)| {
            let [differential, alternating] = pairs;
            Setup {
                order,
                patterns,
                differential,
                alternating,
                test_source,
                dwell,
                blank: blank % dwell,
                latency,
                sweeps,
                frames,
            }
        },
    )
}
