//! The fastest clock for the FPGA's host port.

use nirspi_wire::host_port::{DUMMY_CYCLES, SCK_DIVIDER};

/// Slowest clock of the FPGA's host port: the FPGA's own oscillator, 15 % below nominal
/// (docs/gateware.md, Clocks and resets).
const HOST_CLOCK_MIN_HZ: u32 = 87_800_000;

/// Fastest `sck`, in Hz.
pub const SCK_MAX_HZ: u32 = HOST_CLOCK_MIN_HZ / SCK_DIVIDER as u32;

/// Prescaler of an OCTOSPI or XSPI with this kernel clock. The peripheral divides by one more than
/// its prescaler.
#[must_use]
pub const fn prescaler(kernel_hz: u32) -> u8 {
    let divider = kernel_hz.div_ceil(SCK_MAX_HZ);
    assert!(0 < divider && divider <= 256);
    (divider - 1) as u8
}

// The `_8` in the boards' drivers means eight dummy cycles.
const _: () = assert!(DUMMY_CYCLES == 8);
