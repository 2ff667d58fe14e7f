//! How fast the FPGA's host port may be clocked.

use nirspi_wire::host_port::{DUMMY_CYCLES, SCK_DIVIDER};

/// Slowest clock of the FPGA's host port: its own oscillator, 15 % below nominal (docs/gateware.md, Clocks and resets).
const HOST_CLOCK_MIN_HZ: u32 = 87_800_000;

/// Fastest `sck`.
pub const SCK_MAX_HZ: u32 = HOST_CLOCK_MIN_HZ / SCK_DIVIDER as u32;

/// For an OCTOSPI or XSPI with this kernel clock: it divides by one more.
#[must_use]
pub const fn prescaler(kernel_hz: u32) -> u8 {
    let divider = kernel_hz.div_ceil(SCK_MAX_HZ);
    assert!(0 < divider && divider <= 256);
    (divider - 1) as u8
}

// What `_8` means in the boards' drivers.
const _: () = assert!(DUMMY_CYCLES == 8);
