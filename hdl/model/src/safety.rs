//! Switches the LEDs off without the firmware: interlock, over-range, duty, watchdog.
//!
//! # Invariant
//! The first fault is latched
//! (`golden::safety::the_first_fault_is_the_one_latched_and_one_clock_has_an_order`), and no LED is
//! lit until the fault is cleared
//! (`golden::safety::no_light_with_a_fault_latched_an_open_interlock_or_no_run`).

use crate::settings::Settings;
use nirspi_wire::register::{DUTY_WINDOW, FaultCode};

/// The fault latch and its counters.
#[derive(Debug, Clone)]
pub(crate) struct Safety {
    fault: FaultCode,
    interlock_closed: bool,
    /// Clocks since the last access to the host port.
    silent: u32,
    /// Light spent in this duty window, in half-arrays lit for a clock.
    spent: u32,
}

/// Facts of one clock of a run.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Clock {
    /// Half-arrays lit.
    pub(crate) half_arrays: u32,
    /// Over-range samples of the frame or burst so far.
    pub(crate) over_range: u32,
}

impl Safety {
    /// State after reset: interlock open, no fault.
    pub(crate) fn new() -> Self {
        Self { fault: FaultCode::None, interlock_closed: false, silent: 0, spent: 0 }
    }

    pub(crate) fn fault(&self) -> FaultCode {
        self.fault
    }

    pub(crate) fn clear(&mut self) {
        self.fault = FaultCode::None;
    }

    pub(crate) fn interlock_closed(&self) -> bool {
        self.interlock_closed
    }

    /// Whether LEDs may be lit.
    pub(crate) fn permits(&self) -> bool {
        self.fault == FaultCode::None && self.interlock_closed
    }

    /// Follows the interlock input; true if the change trips.
    pub(crate) fn set_interlock(&mut self, closed: bool, running: bool) -> bool {
        self.interlock_closed = closed;
        let trips = running && !closed;
        if trips {
            self.fault = FaultCode::Interlock;
        }
        trips
    }

    /// Restarts the watchdog on an access to the host port.
    pub(crate) fn feed(&mut self) {
        self.silent = 0;
    }

    /// Enters clock `now`, in a run or at rest. Duty windows follow the clock alone, so no start or
    /// stop renews the light budget.
    #[inline]
    pub(crate) fn enter(&mut self, now: u64) {
        if now.is_multiple_of(DUTY_WINDOW.into()) {
            self.spent = 0;
        }
    }

    /// Ends a clock of a run; true if the clock trips.
    #[inline]
    pub(crate) fn step(&mut self, settings: &Settings, clock: Clock) -> bool {
        self.silent += 1;
        self.spent += clock.half_arrays;
        let over_range =
            settings.over_range_trip != 0 && clock.over_range >= settings.over_range_trip;
        let duty = self.spent > settings.duty_limit;
        let watchdog = self.silent >= settings.watchdog;
        if over_range || duty || watchdog {
            self.fault = if over_range {
                FaultCode::OverRange
            } else if duty {
                FaultCode::Duty
            } else {
                FaultCode::Watchdog
            };
        }
        over_range || duty || watchdog
    }
}
