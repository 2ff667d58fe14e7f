//! The ECP5's configuration port on SPI1, and the gateware that is stored on this board.

use embassy_stm32::gpio::{Input, Output, OutputOpenDrain};
use embassy_stm32::mode::Blocking;
use embassy_stm32::spi::mode::Master;
use embassy_stm32::spi::{Config, Spi};
use embassy_stm32::time::Hertz;
use nirspi_mcu::BusError;
use nirspi_mcu::ecp5::SlaveSpi;

/// Longest bitstream that a host may load, as `board.toml` says. `hdl/build.py` compares the bitstream with it.
pub const STAGING_BYTES: usize = match usize::from_str_radix(env!("STAGING_BYTES"), 10) {
    Ok(bytes) => bytes,
    Err(_) => panic!("staging_bytes in board.toml is a whole number"),
};

/// Bank 2, where `probe-rs download --binary-format bin --base-address 0x08200000` puts a
/// bitstream.
const GATEWARE: (usize, usize) = (0x0820_0000, 2 << 20);

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

/// The bitstream in bank 2, if there is one.
pub fn stored() -> Option<&'static [u8]> {
    let (address, length) = GATEWARE;
    #[expect(unsafe_code, reason = "flash memory beyond the firmware")]
    // SAFETY: all of bank 2 is readable memory, and this firmware never writes it (memory.x).
    let region = unsafe { core::slice::from_raw_parts(address as *const u8, length) };
    // The search for the end of a bitstream goes through all of an empty bank, for 45 ms.
    if region.starts_with(&[0xFF; 16]) {
        return None;
    }
    nirspi_mcu::staging::stored(region)
}
