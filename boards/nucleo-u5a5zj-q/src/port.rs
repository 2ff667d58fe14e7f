//! The fastest clocks for the FPGA's host port.

use nirspi_wire::host_port::{
    DUMMY_CYCLES, PACKET_SCK_MAX_HZ, PACKET_SCK_MIN_HZ, READ_PACKET, SCK_DIVIDER,
};

/// Slowest clock of the FPGA's host port: the FPGA's own oscillator, 15 % below nominal
/// (docs/log/gateware.md, Clocks and resets).
const HOST_CLOCK_MIN_HZ: u32 = 87_800_000;

/// Fastest `sck` of accesses that the FPGA samples, in Hz.
pub const SCK_MAX_HZ: u32 = HOST_CLOCK_MIN_HZ / SCK_DIVIDER as u32;

/// Prescaler of an OCTOSPI with this kernel clock, for an access with this opcode. The
/// peripheral divides by one more than its prescaler.
#[must_use]
pub const fn prescaler(kernel_hz: u32, opcode: u8) -> u8 {
    let fastest = if opcode == READ_PACKET { PACKET_SCK_MAX_HZ } else { SCK_MAX_HZ };
    let divider = kernel_hz.div_ceil(fastest);
    assert!(0 < divider && divider <= 256);
    assert!(opcode != READ_PACKET || kernel_hz / divider >= PACKET_SCK_MIN_HZ);
    (divider - 1) as u8
}

// The `_8` in `fpga.rs` means eight dummy cycles.
const _: () = assert!(DUMMY_CYCLES == 8);
