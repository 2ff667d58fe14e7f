//! Three lamps on the board, because the light of the LEDs is invisible: what the camera is doing, for
//! somebody who stands beside it.
//!
//! The lamps only inform: the camera works in the same way on a board without them. `safety`, `machine` and the FPGA
//! keep the LEDs off.

use crate::Micros;
use nirspi_wire::Fault;

/// Half of a blink, and the time for which a flash is on, and then off.
const BEAT_US: u64 = 250_000;
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
    /// Flashes as often as [`flashes`] says for the standing fault, pauses, and flashes again.
    pub fault: bool,
}

impl Lamps {
    pub(crate) fn at(now: Micros, has_session: bool, light: bool, fault: Option<Fault>) -> Self {
        let beat = now.0 / BEAT_US;
        Self {
            ready: has_session || beat.is_multiple_of(2),
            light,
            fault: fault.is_some_and(|fault| {
                let beats = u64::from(flashes(fault)).saturating_mul(2);
                let within = beat.checked_rem(beats.saturating_add(PAUSE_BEATS)).unwrap_or(0);
                within < beats && within.is_multiple_of(2)
            }),
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
    }
}
