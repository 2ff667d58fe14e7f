//! Limits that protect people, LEDs and the measurement.
//!
//! The board sets its limits when it is built; no command changes a limit.

use crate::time::Micros;
use nirspi_wire::message::HOST_SILENCE_US;
use nirspi_wire::{ADC_HZ, register};

/// The board's own watchdog restarts the firmware after this long without a feed. The FPGA's
/// watchdog has ended the run by then.
pub const BOARD_WATCHDOG_US: u32 = 500_000;

/// Time between two readings of the array's temperature. A thermistor is slow.
pub const TEMPERATURE_PERIOD_US: u64 = 10_000;

/// Time between two looks at the frequency of the ADC's clock while LEDs are lit: less than half of the FPGA's watchdog, whose
/// time is of that clock. A power of two, so that no poll divides.
pub const CLOCK_CHECK: Micros = Micros(1 << 16);

/// Limits of one board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Longest time without a valid command while LEDs are on.
    pub host_silence: Micros,
    /// Largest share of the array lit, in thousandths, over any of the FPGA's duty windows.
    pub duty_permille_max: u16,
    /// Temperature at and above which the LEDs go off.
    pub trip_centi_celsius: i16,
    /// Temperature at and below which the host can acknowledge an over-temperature.
    pub release_centi_celsius: i16,
    /// Readings below this mean a broken sensor.
    pub plausible_min_centi_celsius: i16,
    /// Readings above this mean a broken sensor.
    pub plausible_max_centi_celsius: i16,
    /// A run has stalled when no frame came for this many times a frame's duration and for at least
    /// `stall_min`.
    pub stall_frames: u32,
    /// Shortest time without a frame that counts as a stall; short frames need this minimum.
    pub stall_min: Micros,
    /// Time between two checks of the FPGA's identity, status and fault during a run.
    pub running_check: Micros,
    /// Time between two checks while the LEDs are off.
    pub resting_check: Micros,
    /// The FPGA ends a run after this many clocks of 8 ns without an access from the firmware; 1 to
    /// [`register::WATCHDOG_MAX`], and longer than `running_check`.
    pub watchdog_clocks: u32,
    /// The first light waits until each of the two LED enables has kept the array dark alone. Simulated cameras do not, so
    /// that the noise of a seed is that of the run alone.
    pub tries_enables: bool,
}

impl Default for Limits {
    /// [`Limits::REFERENCE`].
    fn default() -> Self {
        Self::REFERENCE
    }
}

impl Limits {
    /// For the reference board:
    ///
    /// | limit | value | because |
    /// |---|---|---|
    /// | host silence | 5 s | [`HOST_SILENCE_US`], which hosts count on; ours asks for `Status` every second |
    /// | duty | 625 per mille | what the gateware allows at most, [`register::DUTY_LIMIT_MAX`] |
    /// | trip, release | 60, 50 °C | below the 70 to 85 °C that InGaAsP LEDs are commonly rated for, as air, not junction |
    /// | plausible | -40 to 125 °C | range of common digital sensors; an open line reads far outside |
    /// | stall | 8 frames, at least 250 ms | longer than any pause of a board that is well, and than the watchdog |
    /// | checks | 1 ms, 100 ms | two reads each: under 1 % of the bus |
    /// | watchdog | 200 ms | the gateware's own reset value |
    pub const REFERENCE: Self = Self {
        host_silence: Micros(HOST_SILENCE_US),
        duty_permille_max: 625,
        trip_centi_celsius: 6_000,
        release_centi_celsius: 5_000,
        plausible_min_centi_celsius: -4_000,
        plausible_max_centi_celsius: 12_500,
        stall_frames: 8,
        stall_min: Micros(250_000),
        running_check: Micros(1_000),
        resting_check: Micros(100_000),
        watchdog_clocks: ADC_HZ / 5,
        tries_enables: true,
    };

    /// Those of the reference board, for a camera whose LEDs are simulated.
    pub const SIMULATED: Self = Self { tries_enables: false, ..Self::REFERENCE };

    /// Light that the FPGA allows in each window; the full array lit costs 2 a clock.
    pub(crate) fn duty_budget(&self) -> u32 {
        let full = 2 * u64::from(register::DUTY_WINDOW);
        let budget = full.saturating_mul(self.duty_permille_max.into()) / 1000;
        u32::try_from(budget).unwrap_or(u32::MAX).min(register::DUTY_LIMIT_MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_duty_is_the_most_that_the_gateware_takes() {
        assert_eq!(Limits::default().duty_budget(), register::DUTY_LIMIT_MAX);
        let half = Limits { duty_permille_max: 500, ..Limits::default() };
        assert_eq!(half.duty_budget(), register::DUTY_WINDOW);
    }
}
