#![doc = include_str!("../README.md")]
//!
//! * [`message`]: commands of the host, replies and stream of the device,
//! * [`version`]: versions of the protocol, and the rules by which it grows,
//! * [`packet`]: how a message becomes bytes on a link: postcard, CRC-32, COBS, a zero byte,
//! * [`samples`]: the integrated ADC samples of a frame,
//! * [`register`]: the register map of the FPGA, its fault codes and bits,
//! * [`fpga`]: the layout of a frame as the FPGA's host port delivers it,
//! * [`ready`]: the layout of a packet that the FPGA makes of a frame,
//! * [`host_port`]: the format of accesses on the host port,
//! * [`tunnel`]: the same accesses over a serial line to a simulator,
//! * [`walsh`]: which sign of which Hadamard row an LED shows,
//! * [`usb`]: identity on the bus.
//!
//! `no_std`, no allocation, no feature flags.
//!
//! # Invariant
//! Firmware, gateware model, host and tests take these numbers from this crate. A number is
//! repeated only where this crate cannot be used, and a test compares the two:
//!
//! | second place | test |
//! |---|---|
//! | `hdl/rtl/register_map.veryl`, generated from here | `hdl/sim/tests/rtl/stale.rs` |
//! | `nirspi_optics::instrument` | `nirspi`: `the_optics_have_the_instruments_numbers` |
#![no_std]

#[cfg(test)]
extern crate std;

pub mod fpga;
pub mod host_port;
pub mod message;
pub mod packet;
pub mod ready;
pub mod register;
pub mod samples;
pub mod tunnel;
pub mod usb;
pub mod version;
pub mod walsh;

mod crc32;
mod display;
mod stuffing;

pub use crc32::{Crc32, crc32};
pub use message::{
    Answer, Capabilities, Command, ConfigField, ConfigProblem, Configuration, CrashReport, Depth,
    DeviceMessage, Event, EventKind, Fault, Frame, FrameFlags, GatewareChunk, Identity,
    PatternOrder, Raw, RebootInto, Refusal, Reply, Request, RunLength, SampleSource,
    SelfTestReport, Signal, State, Status, Version,
};
pub use packet::{Deframed, Deframer, PacketError, encode, open};
pub use samples::Samples;

/// LEDs along one edge of the array (paper, section 2.A).
pub const SIDE: u8 = 32;

/// Hadamard patterns of a full sweep, `SIDE * SIDE`.
pub const PATTERNS: u16 = SIDE as u16 * SIDE as u16;

/// Wavelength of the LEDs (paper, section 2.A).
pub const WAVELENGTH_NM: u16 = 1550;

/// ADC sample rate and FPGA sequencer clock (paper, section 2.D).
pub const ADC_HZ: u32 = 125_000_000;

/// Fastest pattern rate (paper, section 2.D).
pub const PATTERN_HZ: u32 = 25_000_000;

/// ADC samples in one pattern at the fastest rate: `F = F_ADC / F_patterns` (Eq. 4).
pub const CLOCKS_PER_PATTERN: u16 = (ADC_HZ / PATTERN_HZ) as u16;

/// Resolution of the ADC.
pub const ADC_BITS: u8 = 14;

/// Largest ADC code.
pub const ADC_MAX: u16 = (1 << ADC_BITS) - 1;
