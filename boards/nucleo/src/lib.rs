//! The common parts of the camera's Nucleo boards, without a HAL: remembering the gateware over a
//! restart, the end after a crash, entering the chip's boot loader.
//!
//! This crate contains no pin and no register of one chip. A board passes them as arguments.
#![no_std]

pub mod crash;
pub mod gateware;
pub mod memory;
pub mod port;
pub mod restart;

use nirspi_mcu::ntc::Thermistor;

/// The thermistor at the LED array, and the resistor in series with it. An array with another
/// thermistor needs other numbers here.
pub const THERMISTOR: Thermistor = Thermistor::REFERENCE;
