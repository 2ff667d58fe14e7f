//! Numbers of the instrument that the optics need.
//!
//! # Invariant
//! This crate does not depend on the wire protocol, so the numbers are both in this file and in
//! `nirspi-wire`. The test `the_optics_have_the_instruments_numbers` of `nirspi`
//! (`host/virtual/src/lib.rs`) checks that they are equal, and the compiler checks the number
//! of LEDs there.

/// LEDs along one side of the array (paper, section 2.A).
pub const SIDE: usize = 32;

/// LEDs in the array.
pub const LEDS: usize = SIDE * SIDE;

/// Wavelength of the LEDs, in nm (paper, section 2.A).
pub const WAVELENGTH_NM: f64 = 1550.0;

/// ADC clock period, in ns: 125 MS/s (paper, section 2.D).
pub const SAMPLE_NS: f64 = 8.0;

/// Largest ADC code: 14 bit (paper, section 2.D).
pub const FULL_SCALE_COUNTS: u16 = (1 << 14) - 1;

/// Longest ADC pipeline that can be set, in clocks.
pub const MAX_ADC_LATENCY_CLOCKS: u8 = 63;
