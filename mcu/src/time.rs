//! Device time.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_goes_backwards_has_let_no_time_pass() {
        assert_eq!(Micros(3).since(Micros(5)), Micros(0));
    }
}
