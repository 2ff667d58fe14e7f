//! The ECP5's configuration port on SPI1. This board stores no gateware, because its flash has room
//! only for the firmware.

use embassy_stm32::gpio::{Input, Output, OutputOpenDrain};
use embassy_stm32::mode::Blocking;
use embassy_stm32::spi::mode::Master;
use embassy_stm32::spi::{Config, Spi};
use embassy_stm32::time::Hertz;
use nirspi_mcu::BusError;
use nirspi_mcu::ecp5::SlaveSpi;

/// Longest bitstream that a host may load: the free memory. The project's bitstream has 447 914
/// bytes (`hdl/build.py`, seed 1) and does not fit: README.md, gateware.
pub const STAGING_BYTES: usize = 392 << 10;

/// Mode 0, most significant bit first. The chip accepts 60 MHz; loose wires need less.
pub fn config() -> Config {
    let mut config = Config::default();
    config.frequency = Hertz(10_000_000);
    config
}

/// The port.
pub struct ConfigurationPort {
    pub spi: Spi<'static, Blocking, Master>,
    pub cs_n: Output<'static>,
    pub program_n: OutputOpenDrain<'static>,
    pub done: Input<'static>,
}

impl SlaveSpi for ConfigurationPort {
    fn program(&mut self, low: bool) {
        self.program_n.set_level((!low).into());
    }

    fn done(&mut self) -> bool {
        self.done.is_high()
    }

    fn select(&mut self, selected: bool) {
        self.cs_n.set_level((!selected).into());
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), BusError> {
        self.spi.blocking_write(bytes).map_err(|_| BusError::Transfer)
    }

    fn read(&mut self, into: &mut [u8]) -> Result<(), BusError> {
        self.spi.blocking_read(into).map_err(|_| BusError::Transfer)
    }
}
