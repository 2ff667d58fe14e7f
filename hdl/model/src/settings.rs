//! The copy of the settings that a run uses.
//!
//! # Invariant
//! A copy exists only if every setting is in its range
//! (`golden::runs::every_setting_is_checked_at_a_start_and_only_there`), so no other block checks
//! settings.

use crate::order::Order;
use crate::registers::Registers;
use nirspi_wire::{
    PATTERNS,
    register::{DUTY_LIMIT_MAX, LATENCY_MAX, RAW_SAMPLES_MAX, Register, WATCHDOG_MAX, mode},
    samples::Width,
};
use std::ops::RangeInclusive;

/// Settings of one run, all in range.
#[derive(Debug, Clone)]
pub(crate) struct Settings {
    pub(crate) order: Order,
    pub(crate) differential: bool,
    /// Every second sweep shows complements first, every second pair of sweeps inverts all lines. Only
    /// with `differential`.
    pub(crate) alternating: bool,
    pub(crate) test_source: bool,
    /// Lines are shown without light.
    pub(crate) unlit: bool,
    /// Frames are sent as packets.
    pub(crate) packets: bool,
    /// Bits of a sample of a packet.
    pub(crate) width: Width,
    /// The packets leave by the parallel port.
    pub(crate) parallel: bool,
    pub(crate) patterns: u16,
    /// In clocks.
    pub(crate) dwell: u16,
    /// In clocks, below `dwell`.
    pub(crate) blank: u16,
    /// In clocks.
    pub(crate) latency: u8,
    pub(crate) sweeps: u32,
    /// Frames of the run; 0: until stopped.
    pub(crate) frames: u32,
    pub(crate) raw_length: u16,
    /// In clocks.
    pub(crate) watchdog: u32,
    /// In half-arrays lit for a clock.
    pub(crate) duty_limit: u32,
    /// Over-range samples of a frame that trip; 0: never.
    pub(crate) over_range_trip: u32,
}

impl Settings {
    /// Copies the registers; `None` if one is out of range.
    pub(crate) fn copy(registers: &Registers) -> Option<Self> {
        let bits = registers.get(Register::Mode);
        let has = |bit| bits & bit != 0;
        if has(!mode::DEFINED) || has(mode::PARALLEL) && !has(mode::PACKETS) {
            return None;
        }
        let within = |register, range: RangeInclusive<u32>| {
            Some(registers.get(register)).filter(|value| range.contains(value))
        };
        let dwell = within(Register::Dwell, 1..=u16::MAX.into())?;
        Some(Self {
            order: if bits & mode::ORDER_TABLE != 0 {
                Order::Table
            } else if bits & mode::ORDER_SEQUENCY != 0 {
                Order::Sequency
            } else {
                Order::Natural
            },
            differential: bits & mode::DIFFERENTIAL != 0,
            alternating: bits & mode::ALTERNATING != 0 && bits & mode::DIFFERENTIAL != 0,
            test_source: bits & mode::TEST_SOURCE != 0,
            unlit: bits & mode::UNLIT != 0,
            packets: bits & mode::PACKETS != 0,
            width: if bits & mode::NARROW == 0 { Width::Bits32 } else { Width::Bits24 },
            parallel: bits & mode::PARALLEL != 0,
            patterns: within(Register::Patterns, 1..=PATTERNS.into())? as u16,
            dwell: dwell as u16,
            blank: within(Register::Blank, 0..=dwell - 1)? as u16,
            latency: within(Register::Latency, 0..=LATENCY_MAX.into())? as u8,
            sweeps: within(Register::Sweeps, 1..=u32::MAX)?,
            frames: registers.get(Register::Frames),
            raw_length: within(Register::RawLength, 1..=RAW_SAMPLES_MAX.into())? as u16,
            watchdog: within(Register::Watchdog, 1..=WATCHDOG_MAX)?,
            duty_limit: within(Register::DutyLimit, 0..=DUTY_LIMIT_MAX)?,
            over_range_trip: registers.get(Register::OverRangeTrip),
        })
    }
}
