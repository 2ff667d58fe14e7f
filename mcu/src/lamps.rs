//! Three lamps on the board, because the light of the LEDs is invisible: what the camera is doing, for
//! somebody who stands beside it.
//!
//! The lamps only inform: the camera works in the same way on a board without them. `safety`, `machine` and the FPGA
//! keep the LEDs off.

use crate::Micros;
use nirspi_wire::Fault;

/// Half of a blink, and the time for which a flash is on, and then off.
const BEAT_US: u64 = 250_000;
/// How long a short flash is on, which counts a restart.
const SHORT_US: u64 = 50_000;
/// More restarts show as this number.
pub const RESTARTS_SHOWN: u8 = 10;
/// Beats without a flash after the flashes of a fault, so that a person can count them.
const PAUSE_BEATS: u64 = 5;

/// Which lamps are lit at one moment. By default every lamp is off, as before the first turn of the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Lamps {
    /// Blinks twice a second while the camera waits for a host, and stays on while a session is open. A lamp
    /// that does neither shows that the firmware does not run.
    pub ready: bool,
    /// On while the FPGA may light LEDs: in a run, a raw burst, a test frame, and until the FPGA has confirmed that
    /// the LEDs are off.
    pub light: bool,
    /// Flashes as often as [`flashes`] says for the standing fault, pauses, and flashes again. Without a fault: short
    /// flashes, as many as restarts since power-up that no host asked for, at most [`RESTARTS_SHOWN`].
    pub fault: bool,
}

impl Lamps {
    pub(crate) fn at(
        now: Micros,
        has_session: bool,
        light: bool,
        fault: Option<Fault>,
        restarts: u8,
    ) -> Self {
        let beat = now.0 / BEAT_US;
        let (number, lasts_us) = match fault {
            Some(fault) => (flashes(fault), BEAT_US),
            None => (restarts.min(RESTARTS_SHOWN), SHORT_US),
        };
        Self {
            ready: has_session || beat.is_multiple_of(2),
            light,
            // Mostly there is nothing to flash, and no division to make.
            fault: number > 0 && {
                let beats = u64::from(number).saturating_mul(2);
                let within = beat.checked_rem(beats.saturating_add(PAUSE_BEATS)).unwrap_or(0);
                within < beats && within.is_multiple_of(2) && now.0 % BEAT_US < lasts_us
            },
        }
    }
}

/// Number of flashes of the fault lamp before each pause.
#[must_use]
pub const fn flashes(fault: Fault) -> u8 {
    match fault {
        Fault::Interlock => 1,
        Fault::OverTemperature { .. } => 2,
        Fault::TemperatureSensor => 3,
        Fault::Duty => 4,
        Fault::OverRange => 5,
        Fault::FpgaAbsent { .. } => 6,
        Fault::FpgaConfiguration => 7,
        Fault::FpgaStalled => 8,
        Fault::FpgaWatchdog => 9,
        Fault::HostSilent => 10,
        Fault::BoardEnableStuck => 11,
        Fault::FpgaEnableStuck => 12,
    }
}
