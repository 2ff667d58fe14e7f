//! What the camera's Nucleo boards do alike, without a HAL: gateware that is remembered over a
//! restart, the end after a crash, the way into the chip's boot loader.
//!
//! The one law: nothing here knows a pin or a register of one chip; what it needs of them is an argument.
#![no_std]

pub mod crash;
pub mod gateware;
pub mod port;
pub mod restart;
