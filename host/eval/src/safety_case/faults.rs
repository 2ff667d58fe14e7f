//! Single faults of a camera, one by one: what stays lit, what ends the light, and how soon.
//!
//! Each row rests on tests or proofs that are named; a test of `docs/log/safety.md` sees that they
//! exist. The electronics of the array are computed and were never built, so their barriers are
//! named as an addition and no time rests on them.

use nirspi_mcu::{BOARD_WATCHDOG_US, CLOCK_CHECK, Limits, TEMPERATURE_PERIOD_US};
use nirspi_wire::ADC_HZ;
use nirspi_wire::message::HOST_SILENCE_US;
use nirspi_wire::register::{DUTY_LIMIT_MAX, DUTY_WINDOW};
use serde::{Serialize, Serializer};
use std::fmt::{self, Display};

/// Which LEDs are lit on average over a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Lit {
    /// None.
    None,
    /// One.
    One,
    /// Half, as in every sweep of patterns and complements.
    Half,
    /// The most that firmware and gateware allow, which an order file may ask for.
    Brightest,
    /// All.
    All,
    /// The brightest order file, with all of the supply's voltage behind the converter at the LEDs.
    Overdriven,
}

/// How much more current an LED of the array gets at 12 V than at 2.5 V: 1.08 V fall off at the LED, the rest at its
/// resistor of 27 ohm (`boards/electronics/supply.cir`). Light grows no faster than the current.
const OVERDRIVE: f64 = (12.0 - 1.08) / (2.5 - 1.08);

impl Lit {
    /// Share of the array.
    #[must_use]
    pub fn share(self) -> f64 {
        match self {
            Self::None => 0.0,
            Self::One => 1.0 / nirspi_optics::LEDS as f64,
            Self::Half => 0.5,
            Self::Brightest => f64::from(DUTY_LIMIT_MAX) / (2.0 * f64::from(DUTY_WINDOW)),
            Self::All => 1.0,
            Self::Overdriven => OVERDRIVE * Self::Brightest.share(),
        }
    }
}

impl Display for Lit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::None => "none",
            Self::One => "one",
            Self::Half => "half",
            Self::Brightest => "62.5 %",
            Self::All => "all",
            Self::Overdriven => "62.5 %, at up to 7.7 times the current",
        })
    }
}

/// The longest time from a fault to darkness.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DarkAfter {
    /// The fault itself leaves no light.
    AtOnce,
    /// After this many microseconds at most.
    Microseconds(u64),
    /// Nothing in the camera ends the light.
    Never,
}

impl DarkAfter {
    /// In seconds; `None` if nothing ends the light.
    #[must_use]
    pub fn seconds(self) -> Option<f64> {
        match self {
            Self::AtOnce => Some(1e-6),
            Self::Microseconds(us) => Some(us as f64 / 1e6),
            Self::Never => None,
        }
    }
}

impl Display for DarkAfter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::AtOnce => f.write_str("at once"),
            Self::Microseconds(us @ ..1_000) => write!(f, "{us} µs"),
            Self::Microseconds(us @ ..1_000_000) => write!(f, "{:.0} ms", us as f64 / 1e3),
            Self::Microseconds(us) => write!(f, "{} s", us as f64 / 1e6),
            Self::Never => f.write_str("**not at all**"),
        }
    }
}

impl Serialize for DarkAfter {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.seconds().serialize(serializer)
    }
}

/// A single fault.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SingleFault {
    /// What fails.
    pub fault: &'static str,
    /// What is lit until the light ends.
    pub lit: Lit,
    /// What ends the light, or what a builder can add where nothing does.
    pub ended_by: &'static str,
    /// Time until the light ends, in seconds; `null` if nothing ends it.
    #[serde(rename = "dark_after_s")]
    pub dark_after: DarkAfter,
    /// Names of tests and proofs that show it.
    pub shown_by: &'static [&'static str],
}

const fn fault(
    fault: &'static str,
    lit: Lit,
    ended_by: &'static str,
    dark_after: DarkAfter,
    shown_by: &'static [&'static str],
) -> SingleFault {
    SingleFault { fault, lit, ended_by, dark_after, shown_by }
}

/// The gateware's guard of the ADC's clock: 36 clocks of the slowest host clock are 0.41 us.
const CLOCK_GUARD: DarkAfter = DarkAfter::Microseconds(1);
/// The duty limit counts light in windows. All LEDs exceed it within two, whenever in a window they
/// go on.
const DUTY: DarkAfter = DarkAfter::Microseconds(2 * DUTY_WINDOW as u64 * 1_000_000 / ADC_HZ as u64);
/// A dead FPGA or bus is seen by the next check of a run.
const CHECK: DarkAfter = DarkAfter::Microseconds(Limits::REFERENCE.running_check.0);
const FPGA_WATCHDOG: DarkAfter =
    DarkAfter::Microseconds(Limits::REFERENCE.watchdog_clocks as u64 * 1_000_000 / ADC_HZ as u64);
const BOARD_WATCHDOG: DarkAfter = DarkAfter::Microseconds(BOARD_WATCHDOG_US as u64);
const HOST_SILENCE: DarkAfter = DarkAfter::Microseconds(HOST_SILENCE_US);
/// The next reading shows a broken sensor.
const TEMPERATURE: DarkAfter = DarkAfter::Microseconds(TEMPERATURE_PERIOD_US);

/// The next look at the frequency of the ADC's clock, and the poll that makes it.
const ADC_CLOCK: DarkAfter =
    DarkAfter::Microseconds(CLOCK_CHECK.0 + Limits::REFERENCE.running_check.0);

/// Every single fault that the safety case treats, from the FPGA to the array. Lit is what the brightest order file lights,
/// unless the fault itself says more.
pub const FAULTS: &[SingleFault] = &[
    fault(
        "the ADC's clock stops, and the sequencer with it",
        Lit::Brightest,
        "the FPGA's clock guard pulls its LED enable low",
        CLOCK_GUARD,
        &["clock_guard_proof", "shell_proof", "an_adc_clock_that_is_lost_and_comes_back"],
    ),
    fault(
        "the ADC's clock has another frequency, and stretches the FPGA's watchdog and its patterns",
        Lit::Brightest,
        "the firmware judges the frequency and pulls its LED enable low",
        ADC_CLOCK,
        &["an_adc_clock_of_another_frequency"],
    ),
    fault(
        "the microcontroller's crystal stops",
        Lit::None,
        "the chip goes over to its own oscillator, and the crash handler pulls the LED enable low first",
        DarkAfter::AtOnce,
        &["a_crystal_that_stops_while_lit_is_dark_at_once_and_the_next_host_is_told_of_it"],
    ),
    fault(
        "the FPGA's own oscillator stops, and the host port with it",
        Lit::Brightest,
        "the firmware finds no FPGA and pulls its LED enable low",
        CHECK,
        &["a_dead_bus_is_an_absent_fpga_and_is_told_again_to_stop_on_every_poll"],
    ),
    fault(
        "the supply of the microcontroller sags or fails",
        Lit::None,
        "its brown-out reset or voltage detector: the LED enable is low in reset",
        DarkAfter::AtOnce,
        &[
            "a_brown_out_while_lit_is_dark_at_once_and_the_next_host_is_told_of_it_once",
            "a_supply_that_sags_while_lit_is_dark_at_once_and_stays_dark",
        ],
    ),
    fault(
        "the FPGA loses its supply or configuration",
        Lit::None,
        "pull-downs hold its LED enable low; the firmware finds no FPGA and pulls its own low",
        DarkAfter::AtOnce,
        &["a_dead_bus_is_an_absent_fpga_and_is_told_again_to_stop_on_every_poll"],
    ),
    fault(
        "the sequencer stops in a pattern that lights every LED",
        Lit::All,
        "the gateware's duty limit ends the run; no frame comes, and the firmware's fault pulls its own LED enable low after \
         eight frames' time (and the array's one-shot after 10 ms)",
        DUTY,
        &[
            "pattern_0_alone_trips_the_duty_limit_once_its_light_exceeds_the_budget",
            "a_run_that_makes_no_frames",
        ],
    ),
    fault(
        "the order table is damaged, and every slot lights every LED",
        Lit::All,
        "the gateware's duty limit ends the run",
        DUTY,
        &["pattern_0_alone_trips_the_duty_limit_once_its_light_exceeds_the_budget"],
    ),
    fault(
        "the FPGA's LED enable is stuck high",
        Lit::All,
        "before the first light after power-up the firmware's own test, within milliseconds; then nothing within a session: \
         lines at rest light every LED until the session ends or a fault comes, with which the firmware's enable falls (and \
         the array's one-shot ends it after 10 ms). `nirspi camera selftest` finds it, and forbids light",
        DarkAfter::Never,
        &[],
    ),
    fault(
        "wrong or foreign gateware",
        Lit::None,
        "the firmware reads identity, version and design, and allows no light",
        DarkAfter::AtOnce,
        &[
            "gateware_of_another_version_or_design_is_refused_before_light",
            "an_fpga_of_another_identity",
        ],
    ),
    fault(
        "the firmware hangs",
        Lit::Brightest,
        "the FPGA's watchdog ends the run; the board's watchdog restarts the firmware",
        FPGA_WATCHDOG,
        &["the_gateware_goes_dark_when_the_firmware_hangs", "dark_when_host_silent"],
    ),
    fault(
        "the firmware hangs while it still reads the FPGA",
        Lit::Brightest,
        "the board's watchdog restarts the firmware, whose LED enable is low after a reset",
        BOARD_WATCHDOG,
        &["a_watchdog_runs_before_anything_waits", "the_cameras_loop_alone_feeds_the_watchdog"],
    ),
    fault(
        "the firmware panics, faults or overflows its stack",
        Lit::None,
        "the crash handler pulls the LED enable low first",
        DarkAfter::AtOnce,
        &[
            "the_crash_handler_turns_off_the_pin_that_enables_the_leds",
            "firmware_that_crashes_starts_again_and_tells_the_next_host_once",
        ],
    ),
    fault(
        "the microcontroller's LED enable is stuck high",
        Lit::Brightest,
        "the FPGA's enable falls with every end of a run, at the latest when the host falls silent; the test before the first \
         light and `nirspi camera selftest` find it, and forbid light",
        HOST_SILENCE,
        &[
            "a_silent_host",
            "each_fault_that_the_fpga_latches",
            "a_stuck_enable_is_a_fault_that_no_configuration_acknowledges",
            "a_stuck_enable_refuses_the_first_light",
        ],
    ),
    fault(
        "the bus between microcontroller and FPGA is cut",
        Lit::Brightest,
        "the firmware finds no FPGA and pulls its LED enable low",
        CHECK,
        &["a_dead_bus_is_an_absent_fpga_and_is_told_again_to_stop_on_every_poll"],
    ),
    fault(
        "the bus loses a write that stops a run",
        Lit::None,
        "the firmware's LED enable is low until the FPGA has confirmed the stop",
        DarkAfter::AtOnce,
        &[
            "a_stop_that_is_lost_on_the_bus_is_repeated",
            "every_reachable_state_keeps_the_laws_of_light",
        ],
    ),
    fault(
        "the temperature sensor is shorted or open",
        Lit::Brightest,
        "the reading is not plausible: the firmware's fault pulls its LED enable low",
        TEMPERATURE,
        &["a_sensor_that_reads_what_cannot_be", "a_sensor_that_does_not_answer"],
    ),
    fault(
        "the temperature sensor reads a wrong but plausible value",
        Lit::Brightest,
        "nothing: the LEDs may get too hot; their light is as designed. Add a thermal fuse in the LED supply",
        DarkAfter::Never,
        &[],
    ),
    fault(
        "the interlock's switch is stuck closed",
        Lit::Brightest,
        "nothing sees an open enclosure. Add a second switch in series",
        DarkAfter::Never,
        &[],
    ),
    fault(
        "the host's program ends, or USB is unplugged",
        Lit::None,
        "the end of the session switches the LEDs off",
        DarkAfter::AtOnce,
        &[
            "a_host_that_unplugs_leaves_darkness",
            "a_host_that_is_gone_leaves_no_light_and_no_acknowledged_fault",
        ],
    ),
    fault(
        "the host is silent and stays connected",
        Lit::Brightest,
        "the firmware's fault switches the LEDs off",
        HOST_SILENCE,
        &["a_silent_host"],
    ),
    fault(
        "the host reads nothing and goes on to send",
        Lit::Brightest,
        "the firmware ends the session",
        HOST_SILENCE,
        &["a_transfer_may_wait_as_long_as_a_silent_host"],
    ),
    fault(
        "the array's AND gate is stuck high",
        Lit::All,
        "nothing but the interlock, which cuts the supply: lines at rest light every LED. `nirspi camera selftest` finds it while \
         the supply is on",
        DarkAfter::Never,
        &[],
    ),
    fault(
        "one LED's transistor is shorted",
        Lit::One,
        "nothing but the interlock, which cuts the supply",
        DarkAfter::Never,
        &[],
    ),
    fault(
        "the array's converter is shorted, or its feedback is open: 12 V at the LEDs in place of 2.5 V",
        Lit::Overdriven,
        "nothing but the interlock, which cuts the supply, or LEDs that break. Add a fuse and a clamp behind the converter",
        DarkAfter::Never,
        &[],
    ),
    fault(
        "lines or supply of the array are shorted so that every LED is lit",
        Lit::All,
        "nothing but the interlock, which cuts the supply. Add a fuse for half of the array's current",
        DarkAfter::Never,
        &[],
    ),
];
