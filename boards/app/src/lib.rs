//! The camera's firmware without its peripherals: one loop and one host link, the same on every
//! board.
//!
//! ```text
//! USB or UART task <-> [link] <-> [run]: nirspi_mcu::Camera <-> PortBus <-> FPGA port of the board
//! ```
//!
//! A board creates its peripherals, implements [`FpgaPort`], [`Board`] and optionally
//! [`DepthSensor`], splits a [`Link`](link::Link), gives the link's two outer ends to the task that
//! serves the host, and awaits [`run`].
//!
//! Interrupts belong to the board and are short. All code here runs in thread mode and is suspended
//! only at an `await`.
#![no_std]

#[cfg(any(test, feature = "bench"))]
extern crate std;

#[cfg(any(test, feature = "bench"))]
pub mod bench;
pub mod crash;
pub mod link;

mod ports;
mod run;

#[cfg(test)]
mod tests;

pub use ports::{Board, DEPTH_SIDE, DepthMap, DepthSensor, FpgaPort};
pub use run::{DepthMailbox, Device, board_info, measure_depth, run};
