#![doc = include_str!("../README.md")]
//!
//! Each module has one idea. `camera` is what a board calls; `commands` (of the host) and `poll`
//! (safety rules, then one step) drive the `machine`, which holds the state. The parts of the
//! machine do not use the machine: `run` and `burst` (data), `selftest`, `enables` and `training`, which share `test_frame`,
//! `gateware`, `configure`
//! (checks), `safety` (sensors), `ring` (what the FPGA's parallel port has sent), `meter` (signal and noise), `fpga` (registers), `notices` (replies and events that wait for
//! the link), `packets` (a message into the link). `host_port` says which bytes a board transfers,
//! `patience` how long a transfer to the host may wait, `lamps` what the board shows to somebody beside it.
#![no_std]
#![deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)]
#![deny(clippy::arithmetic_side_effects)]
#![cfg_attr(
    test,
    allow(
        clippy::indexing_slicing,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::arithmetic_side_effects
    )
)]

#[cfg(test)]
extern crate std;

mod burst;
mod camera;
mod commands;
mod configure;
mod crash;
pub mod ecp5;
mod enables;
mod float;
mod fpga;
mod gateware;
mod host_port;
mod lamps;
mod limits;
mod machine;
mod merge;
mod meter;
mod notices;
pub mod ntc;
mod packets;
mod patience;
mod poll;
mod ports;
mod restarts;
mod ring;
mod run;
mod safety;
mod selftest;
pub mod staging;
mod test_frame;
mod time;
mod training;

#[cfg(test)]
mod tests;

pub use burst::RAW_PIECE_SAMPLES;
pub use camera::Camera;
pub use crash::{CRASH_WORDS, Crash};
pub use host_port::{HostPort, PortBus, Target, Wanted};
pub use lamps::{Lamps, RESTARTS_SHOWN, flashes};
pub use limits::{BOARD_WATCHDOG_US, CLOCK_CHECK, Limits, TEMPERATURE_PERIOD_US};
pub use merge::Merger;
pub use patience::{PATIENCE, Patience, Remedy};
pub use ports::{
    BoardInfo, BusError, FpgaBus, GatewareLoader, Inputs, LoadError, NAME_BYTES, NoLoader,
    PacketSink, Ports, Progress,
};
pub use restarts::{ResetCause, RestartWords, report, restart_words, restarts};
pub use ring::{Loan, Ring, RingMemory};
pub use time::{CLOCKS_PER_MICRO, Micros};
