//! Device time, and the relation of the FPGA's clock to device time.
//!
//! This crate reads no clock: time is an argument of every call that needs it.

use nirspi_wire::ADC_HZ;

/// Microseconds since power-up, monotonic. A length of time is the difference of two moments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Micros(pub u64);

impl Micros {
    /// Time that has passed since `earlier`; zero if the caller's clock went backwards.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Self {
        Self(self.0.saturating_sub(earlier.0))
    }
}

/// FPGA clocks in a microsecond.
pub const CLOCKS_PER_MICRO: u64 = ADC_HZ as u64 / 1_000_000;

/// One moment in both times: the FPGA's clock read at a known device time.
///
/// An anchor is taken at the start of each run. Within a run the FPGA's oscillator alone times the
/// frames, so differences between frames are exact. The offset to device time is known to the
/// length of one register read, and drifts by the difference of the two oscillators until the next
/// run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Anchor {
    pub clock: u64,
    pub time: Micros,
}

impl Anchor {
    /// Device time of an FPGA clock.
    pub fn time_of(self, clock: u64) -> Micros {
        let ahead = clock.saturating_sub(self.clock) / CLOCKS_PER_MICRO;
        let behind = self.clock.saturating_sub(clock) / CLOCKS_PER_MICRO;
        Micros(self.time.0.saturating_add(ahead).saturating_sub(behind))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_fpga_clock_is_eight_nanoseconds_on_either_side_of_the_anchor() {
        let anchor = Anchor { clock: 1_000_000, time: Micros(5_000) };
        assert_eq!(anchor.time_of(1_000_000), Micros(5_000));
        assert_eq!(anchor.time_of(1_000_000 + 125 * 7), Micros(5_007));
        assert_eq!(anchor.time_of(1_000_000 - 125 * 7), Micros(4_993));
        assert_eq!(anchor.time_of(u64::MAX).0, 5_000 + (u64::MAX - 1_000_000) / 125);
        assert_eq!(Anchor { clock: u64::MAX, time: Micros(0) }.time_of(0), Micros(0));
    }

    #[test]
    fn a_clock_that_goes_backwards_has_let_no_time_pass() {
        assert_eq!(Micros(3).since(Micros(5)), Micros(0));
    }
}
