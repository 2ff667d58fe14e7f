//! Generates `register_map.veryl` from `mcu/wire`.
//!
//! # Invariant
//! `register_map.veryl` is always the one generated from `mcu/wire`
//! (`stale::the_register_map_and_the_emitted_systemverilog_are_fresh`).

use nirspi_wire::{
    FrameFlags, PATTERNS, fpga, host_port,
    register::{self, Design, FaultCode, Register, clocks, control, mode, sampling, status},
    samples::NARROW,
};
use std::fmt::Write;

/// The constant's name: `OverRangeTrip` becomes `OVER_RANGE_TRIP`.
fn constant(name: &str) -> String {
    let mut out = String::new();
    for (i, c) in name.chars().enumerate() {
        if i > 0 && c.is_uppercase() {
            out.push('_');
        }
        out.push(c.to_ascii_uppercase());
    }
    out
}

/// The text of the package.
pub fn package() -> String {
    let mut constants: Vec<(String, u32)> = Vec::new();
    for &register in Register::ALL {
        let name = constant(&format!("{register:?}"));
        constants.push((format!("ADDRESS_{name}"), register.address().into()));
        constants.push((format!("RESET_{name}"), register.reset()));
    }
    for (name, value) in [
        ("ORDER_TABLE", register::ORDER_TABLE.into()),
        ("PATTERNS", PATTERNS.into()),
        ("RAW_SAMPLES_MAX", register::RAW_SAMPLES_MAX.into()),
        ("WATCHDOG_MAX", register::WATCHDOG_MAX),
        ("DUTY_WINDOW", register::DUTY_WINDOW),
        ("DUTY_LIMIT_MAX", register::DUTY_LIMIT_MAX),
        ("LATENCY_MAX", register::LATENCY_MAX.into()),
        ("TEST_SEED", register::TEST_SEED.into()),
        ("NO_CLOCK", register::NO_CLOCK),
        ("CLOCKS_WINDOW", clocks::WINDOW),
        ("CLOCKS_LOCKED", clocks::LOCKED),
        ("CLOCKS_ALIVE", clocks::ALIVE),
        ("CLOCKS_READY", clocks::READY),
        ("SAMPLING_DONE", sampling::DONE),
        ("SAMPLING_STEPS", sampling::STEPS),
        ("SAMPLING_SAMPLES", sampling::SAMPLES),
        ("SAMPLING_CHECKERBOARD", sampling::CHECKERBOARD.into()),
        ("SAMPLING_BEFORE_0", sampling::BEFORE[0]),
        ("SAMPLING_BEFORE_1", sampling::BEFORE[1]),
        ("SAMPLING_AFTER_0", sampling::AFTER[0]),
        ("SAMPLING_AFTER_1", sampling::AFTER[1]),
        ("DESIGN_CAMERA", Design::Camera as u32),
        ("DESIGN_BRING_UP", Design::BringUp as u32),
        ("LOOPBACK_COUNTS", register::LOOPBACK_COUNTS.into()),
        ("LOOPBACK_DARK", register::LOOPBACK_DARK.into()),
        ("CONTROL_STOP", control::STOP),
        ("CONTROL_CLEAR_FAULT", control::CLEAR_FAULT),
        ("CONTROL_RELEASE", control::RELEASE),
        ("CONTROL_START", control::START),
        ("CONTROL_START_RAW", control::START_RAW),
        ("STATUS_RUNNING", status::RUNNING),
        ("STATUS_FRAME_READY", status::FRAME_READY),
        ("STATUS_RAW_READY", status::RAW_READY),
        ("STATUS_LEDS_ON", status::LEDS_ON),
        ("STATUS_FAULT", status::FAULT),
        ("STATUS_INTERLOCK_CLOSED", status::INTERLOCK_CLOSED),
        ("STATUS_CONFIG_ERROR", status::CONFIG_ERROR),
        ("STATUS_WRITE_REFUSED", status::WRITE_REFUSED),
        ("MODE_DIFFERENTIAL", mode::DIFFERENTIAL),
        ("MODE_ORDER_SEQUENCY", mode::ORDER_SEQUENCY),
        ("MODE_ORDER_TABLE", mode::ORDER_TABLE),
        ("MODE_TEST_SOURCE", mode::TEST_SOURCE),
        ("MODE_PACKETS", mode::PACKETS),
        ("MODE_NARROW", mode::NARROW),
        ("MODE_PARALLEL", mode::PARALLEL),
        ("MODE_ALTERNATING", mode::ALTERNATING),
        ("MODE_UNLIT", mode::UNLIT),
        ("MODE_DEFINED", mode::DEFINED),
        ("FAULT_WATCHDOG", FaultCode::Watchdog as u32),
        ("FAULT_DUTY", FaultCode::Duty as u32),
        ("FAULT_OVER_RANGE", FaultCode::OverRange as u32),
        ("FAULT_INTERLOCK", FaultCode::Interlock as u32),
        ("FLAG_OVER_RANGE", FrameFlags::OVER_RANGE.0.into()),
        ("FLAG_OVERFLOW", FrameFlags::OVERFLOW.0.into()),
        ("FLAG_AFTER_LOSS", FrameFlags::AFTER_LOSS.0.into()),
        ("FLAG_TEST_SOURCE", FrameFlags::TEST_SOURCE.0.into()),
        ("FLAG_DIFFERENTIAL", FrameFlags::DIFFERENTIAL.0.into()),
        ("SAMPLES_NARROW", NARROW.into()),
        ("FRAME_MAGIC", u32::from_le_bytes(fpga::MAGIC)),
        ("HOST_WRITE", host_port::WRITE_REGISTER.into()),
        ("HOST_READ", host_port::READ_REGISTER.into()),
        ("HOST_FRAME", host_port::READ_FRAME.into()),
        ("HOST_PACKET", host_port::READ_PACKET.into()),
        ("HOST_RAW", host_port::READ_RAW.into()),
        ("HOST_QUAD", host_port::QUAD.into()),
        ("HOST_DUMMY_CYCLES", host_port::DUMMY_CYCLES.into()),
        ("HOST_CHECK_POLYNOMIAL", host_port::CHECK_POLYNOMIAL.into()),
        ("HOST_CHECK_SEED", host_port::CHECK_SEED.into()),
    ] {
        constants.push((name.into(), value));
    }
    let mut text = String::from(
        "/// Addresses, bits, codes and limits, from `mcu/wire`. Written by `hdl/sim/tests/rtl/map.rs`: do not edit.\n\
         pub package register_map {\n",
    );
    let width = constants.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    for (name, value) in constants {
        let _ = writeln!(text, "    const {name:width$}: logic<32> = 32'h{value:08X};");
    }
    text.push_str("}\n");
    text
}
