//! The camera's firmware but for its peripherals: one loop and one host link, the same on every board.
//!
//! ```text
//! USB or UART task <-> [link] <-> [run]: nirspi_mcu::Camera <-> PortBus <-> FPGA port of the board
//! ```
//!
//! A board makes its peripherals, implements [`FpgaPort`], [`Board`] and perhaps [`DepthSensor`], splits a
//! [`Link`](link::Link), gives its two outer ends to the task that serves the host, and awaits [`run`].
//!
//! The one law: what runs in an interrupt is the board's, and short; everything here runs in thread mode and is
//! suspended only where it says `await`.
#![no_std]

#[cfg(test)]
extern crate std;

pub mod crash;
pub mod link;

mod ports;
mod run;

#[cfg(test)]
mod tests;

pub use ports::{Board, DEPTH_SIDE, DepthMap, DepthSensor, FpgaPort};
pub use run::{DepthMailbox, Device, board_info, measure_depth, run};
