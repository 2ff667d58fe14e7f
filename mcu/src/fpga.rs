//! Operations on the FPGA by the names of its registers.
//!
//! Settings are read back after every write. Only the values read back count as written.
//!
//! # Invariant
//! A setting that does not arrive is an error
//! (`tests::commands::settings_that_do_not_arrive_leave_nothing_configured`,
//! `tests::commands::one_entry_of_the_order_that_does_not_arrive_is_noticed`).

use crate::configure::Setup;
use crate::{BusError, FpgaBus, Limits, Micros};
use nirspi_wire::register::{
    DAMAGED, Design, FaultCode, IDENTITY, NO_CLOCK, ORDER_TABLE, Register, clocks, control,
    has_this_map, status,
};
use nirspi_wire::samples::Words;
use nirspi_wire::{Fault, Version};

pub(crate) fn read(bus: &mut impl FpgaBus, register: Register) -> Result<u32, BusError> {
    bus.read(register.address())
}

pub(crate) fn write(
    bus: &mut impl FpgaBus,
    register: Register,
    value: u32,
) -> Result<(), BusError> {
    bus.write(register.address(), value)
}

pub(crate) fn control(bus: &mut impl FpgaBus, bits: u32) -> Result<(), BusError> {
    write(bus, Register::Control, bits)
}

/// Gives the frame buffer back to the FPGA.
pub(crate) fn release(bus: &mut impl FpgaBus) -> Result<(), BusError> {
    control(bus, control::RELEASE)
}

/// Fault of an FPGA that does not answer at all.
const SILENT: Fault = Fault::FpgaAbsent { identity: 0 };

/// Fault of an FPGA whose gateware this firmware does not know.
const FOREIGN: Fault = Fault::FpgaAbsent { identity: IDENTITY };

/// Fault of an FPGA whose ADC has no clock, or one of another frequency.
pub(crate) const WRONG_CLOCK: Fault = Fault::FpgaAbsent { identity: NO_CLOCK };

/// Fault of an FPGA from which everything comes damaged.
pub(crate) const UNREADABLE: Fault = Fault::FpgaAbsent { identity: DAMAGED };

/// The fault of an access that failed. Accesses to gateware of another version fail as if they were
/// damaged, because that gateware checks none.
///
/// Never inlined, so that the many places where an access can fail share the code.
#[cold]
#[inline(never)]
pub(crate) fn failed(error: BusError, bus: &mut impl FpgaBus) -> Fault {
    if error != BusError::Damaged {
        return SILENT;
    }
    match (read(bus, Register::Identity), read(bus, Register::Version)) {
        (Ok(IDENTITY), Ok(version)) if !has_this_map(version) => FOREIGN,
        (Ok(identity), _) if identity != IDENTITY => Fault::FpgaAbsent { identity },
        _ => UNREADABLE,
    }
}

/// Number of looks at the FPGA before a wrong answer is a fault. The check of the host port lets one
/// damaged answer in 65 536 pass, and that one must not end a run.
const LOOKS: u8 = 3;

/// Checks that the FPGA answers with its identity.
pub(crate) fn identify(bus: &mut impl FpgaBus) -> Result<(), Fault> {
    match read(bus, Register::Identity) {
        Ok(IDENTITY) => Ok(()),
        Ok(identity) => Err(Fault::FpgaAbsent { identity }),
        Err(error) => Err(failed(error, bus)),
    }
}

/// What the FPGA is built for, if this firmware knows its gateware.
pub(crate) fn design(bus: &mut impl FpgaBus) -> Result<Design, Fault> {
    identify(bus)?;
    let version = read(bus, Register::Version).map_err(|error| failed(error, bus))?;
    let design = read(bus, Register::Design).map_err(|error| failed(error, bus))?;
    Design::from_register(design).filter(|_| has_this_map(version)).ok_or(FOREIGN)
}

/// Status of an FPGA that answers and has no fault latched. A fault is one that every look has shown.
pub(crate) fn health(bus: &mut impl FpgaBus) -> Result<u32, Fault> {
    let mut found = look(bus)?;
    for _ in 1..LOOKS {
        if found.is_ok() {
            break;
        }
        found = look(bus)?;
    }
    found
}

/// Checks that the ADC's clock has the frequency for which every time of the FPGA is meant. A clock that is too slow (a PLL
/// that coasts without its input still ticks) stretches the FPGA's watchdog and the light of each pattern. A fault is one
/// that every look has shown.
pub(crate) fn check_clock(bus: &mut impl FpgaBus) -> Result<(), Fault> {
    for _ in 0..LOOKS {
        let word = read(bus, Register::Clocks).map_err(|error| failed(error, bus))?;
        if clocks::fit(word) {
            return Ok(());
        }
    }
    Err(WRONG_CLOCK)
}

/// One look at identity, status and fault. The outer error is a transfer that did not complete.
fn look(bus: &mut impl FpgaBus) -> Result<Result<u32, Fault>, Fault> {
    let mut word = |register| read(bus, register).map_err(|error| failed(error, bus));
    let identity = word(Register::Identity)?;
    if identity != IDENTITY {
        return Ok(Err(Fault::FpgaAbsent { identity }));
    }
    let status = word(Register::Status)?;
    if status == NO_CLOCK {
        return Ok(Err(WRONG_CLOCK));
    }
    if status & status::FAULT == 0 {
        return Ok(Ok(status));
    }
    let code = word(Register::Fault)?;
    Ok(Err(match FaultCode::from_register(code) {
        Some(FaultCode::Watchdog) => Fault::FpgaWatchdog,
        Some(FaultCode::Duty) => Fault::Duty,
        Some(FaultCode::OverRange) => Fault::OverRange,
        Some(FaultCode::Interlock) => Fault::Interlock,
        // A fault code that this firmware does not know comes from other gateware.
        Some(FaultCode::None) | None => FOREIGN,
    }))
}

/// Version of the gateware; 0.0.0 if no gateware answers.
pub(crate) fn version(bus: &mut impl FpgaBus) -> Version {
    match (identify(bus), read(bus, Register::Version)) {
        (Ok(()), Ok(word)) => Version::of_register(word),
        _ => Version(0, 0, 0),
    }
}

/// Says what the packets of the next run carry beside their frames: the number of the run, and the device time now, which
/// belongs to the FPGA's clock of the last read.
pub(crate) fn stamp(bus: &mut impl FpgaBus, run: u16, time: Micros) -> Result<(), BusError> {
    write(bus, Register::Run, run.into())?;
    write(bus, Register::TimeLow, time.0 as u32)?;
    write(bus, Register::TimeHigh, (time.0 >> 32) as u32)?;
    read(bus, Register::ClockLow).map(drop)
}

/// The value read back is not the value written.
#[derive(Debug)]
pub(crate) struct NotTaken;

impl From<BusError> for NotTaken {
    fn from(_: BusError) -> Self {
        Self
    }
}

/// Stops a run, and checks that the LEDs are off.
pub(crate) fn go_dark(bus: &mut impl FpgaBus) -> Result<(), NotTaken> {
    control(bus, control::STOP)?;
    let status = read(bus, Register::Status)?;
    // Without the ADC's clock the FPGA holds the LEDs off by itself.
    let dark = status == NO_CLOCK || status & (status::RUNNING | status::LEDS_ON) == 0;
    if dark { Ok(()) } else { Err(NotTaken) }
}

/// Stops a run and clears the latched fault. The error is the fault that still forbids a start.
pub(crate) fn acknowledge(bus: &mut impl FpgaBus) -> Result<(), Fault> {
    design(bus)?;
    control(bus, control::STOP | control::CLEAR_FAULT).map_err(|error| failed(error, bus))?;
    if health(bus)? & status::INTERLOCK_CLOSED == 0 {
        return Err(Fault::Interlock);
    }
    Ok(())
}

fn settings(setup: &Setup, limits: &Limits) -> [(Register, u32); 9] {
    [
        (Register::Mode, setup.mode),
        (Register::Patterns, u32::from(setup.patterns)),
        (Register::Dwell, u32::from(setup.dwell)),
        (Register::Blank, u32::from(setup.blank)),
        (Register::Latency, u32::from(setup.latency)),
        (Register::Sweeps, setup.sweeps),
        (Register::OverRangeTrip, setup.over_range_trip),
        (Register::Watchdog, limits.watchdog_clocks),
        (Register::DutyLimit, limits.duty_budget()),
    ]
}

/// Writes all settings of a run but its length, and reads them back.
pub(crate) fn set(bus: &mut impl FpgaBus, setup: &Setup, limits: &Limits) -> Result<(), NotTaken> {
    for (register, value) in settings(setup, limits) {
        write(bus, register, value)?;
    }
    verify(bus, setup, limits)
}

/// Checks that the FPGA still has its settings; a reset FPGA has lost them.
pub(crate) fn verify(
    bus: &mut impl FpgaBus,
    setup: &Setup,
    limits: &Limits,
) -> Result<(), NotTaken> {
    for (register, value) in settings(setup, limits) {
        if read(bus, register)? != value {
            return Err(NotTaken);
        }
    }
    Ok(())
}

/// Writes the order table and reads it back: one wrong entry would scramble images without a trace.
pub(crate) fn set_table(bus: &mut impl FpgaBus, table: &Words<'_>) -> Result<(), NotTaken> {
    for (address, entry) in (ORDER_TABLE..).zip(table.iter()) {
        bus.write(address, u32::from(entry))?;
    }
    for (address, entry) in (ORDER_TABLE..).zip(table.iter()) {
        if bus.read(address)? != u32::from(entry) {
            return Err(NotTaken);
        }
    }
    Ok(())
}

/// Starts a run (`control::START`) or raw burst (`control::START_RAW`), and reads how the FPGA
/// responded.
pub(crate) fn start(bus: &mut impl FpgaBus, command: u32) -> Result<Started, Fault> {
    control(bus, command).map_err(|error| failed(error, bus))?;
    let status = health(bus)?;
    if status & status::RUNNING != 0 {
        Ok(Started::Running)
    } else if status & status::CONFIG_ERROR != 0 {
        Err(Fault::FpgaConfiguration)
    } else if status & status::INTERLOCK_CLOSED == 0 {
        Err(Fault::Interlock)
    } else {
        Ok(Started::OverAlready)
    }
}

/// State of the FPGA when its status is read after a start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Started {
    Running,
    /// The FPGA is not running and has no fault: the run is over already, because a few frames take
    /// less time than a register read.
    OverAlready,
}
