//! What a board lends the firmware: the FPGA, the link to the host, a bitstream loader, its sensors.
//!
//! The one law: no call waits. What is not done yet says so, and is asked again on a later poll.

use crate::Micros;
use heapless::String;
use nirspi_wire::{Capabilities, RebootInto, Version};

/// Why the FPGA could not be reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BusError {
    /// The transfer did not complete in time.
    Timeout,
    /// The bus peripheral reported an error.
    Transfer,
}

/// The FPGA's host port: registers of [`nirspi_wire::register`], frames of [`nirspi_wire::fpga`].
///
/// A register access is a few bytes and is done when the call returns. Every access, of registers or of
/// data, keeps the FPGA's watchdog from ending a run.
pub trait FpgaBus {
    /// Reads a register.
    ///
    /// # Errors
    /// [`BusError`]; an FPGA that is not there usually reads as all zeros or all ones instead.
    fn read(&mut self, address: u16) -> Result<u32, BusError>;

    /// Writes a register.
    ///
    /// # Errors
    /// [`BusError`].
    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError>;

    /// Level of the FPGA's line: a frame is ready. Falls with `CONTROL.RELEASE`.
    fn frame_ready(&mut self) -> bool;

    /// Whether a raw burst can be read.
    fn raw_ready(&mut self) -> bool;

    /// The whole frame that is ready; `None` while it is being transferred. The same bytes again until
    /// `CONTROL.RELEASE` is written.
    ///
    /// # Errors
    /// [`BusError`]; the frame is then given up and released.
    fn frame(&mut self) -> Result<Option<&[u8]>, BusError>;

    /// The whole raw burst that is ready, little-endian `u16` samples; `None` while it is being
    /// transferred. The same bytes again until the next start.
    ///
    /// # Errors
    /// [`BusError`]; the burst is then given up.
    fn raw(&mut self) -> Result<Option<&[u8]>, BusError>;

    /// The memory that frames are transferred into, for the self-test to overwrite; what was held there is given
    /// up. `None` where there is none of its own.
    fn memory(&mut self) -> Option<&mut [u8]> {
        None
    }
}

/// The link towards the host: whole packets or nothing.
pub trait PacketSink {
    /// Room for one packet of at most `length` bytes; `None`: the link is full, which is back-pressure and
    /// no error. Claimed room that is never committed is given back by the next claim.
    fn claim(&mut self, length: usize) -> Option<&mut [u8]>;

    /// Sends the first `length` bytes of the claimed room.
    fn commit(&mut self, length: usize);
}

/// Why a bitstream could not be loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoadError {
    /// This board cannot load gateware, or none of this length.
    Unsupported,
    /// FPGA or flash did not take it.
    Device,
}

/// Where a bitstream goes. A second `begin` forgets what an unfinished first one wrote.
pub trait GatewareLoader {
    /// Prepares for a bitstream of `total` bytes.
    ///
    /// # Errors
    /// [`LoadError`].
    fn begin(&mut self, total: u32) -> Result<(), LoadError>;

    /// Takes the next bytes.
    ///
    /// # Errors
    /// [`LoadError`].
    fn write(&mut self, data: &[u8]) -> Result<(), LoadError>;

    /// All bytes were written and their checksum is right: makes them count.
    ///
    /// # Errors
    /// [`LoadError`].
    fn finish(&mut self) -> Result<(), LoadError>;

    /// The FPGA does not answer: it does not run what was loaded last.
    fn forget(&mut self) {}

    /// Goes on with what `finish` began, for a millisecond at most; whether there is more to do. The camera is not
    /// to be polled until there is not: meanwhile there is no FPGA to talk to, and none that lights anything.
    fn step(&mut self, _now: Micros) -> bool {
        false
    }
}

/// The loader of a board that has none.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoLoader;

impl GatewareLoader for NoLoader {
    fn begin(&mut self, _total: u32) -> Result<(), LoadError> {
        Err(LoadError::Unsupported)
    }

    fn write(&mut self, _data: &[u8]) -> Result<(), LoadError> {
        Err(LoadError::Unsupported)
    }

    fn finish(&mut self) -> Result<(), LoadError> {
        Err(LoadError::Unsupported)
    }
}

/// All that a board lends for one call.
#[derive(Debug)]
pub struct Ports<'p, B, S, G> {
    /// The FPGA.
    pub bus: &'p mut B,
    /// The link towards the host.
    pub sink: &'p mut S,
    /// Where bitstreams go.
    pub loader: &'p mut G,
}

/// Sensors, sampled by the board for every call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Inputs {
    /// The enclosure's interlock.
    pub interlock_closed: bool,
    /// LED array, hundredths of a degree Celsius; `None`: the sensor does not answer.
    pub temperature_centi_celsius: Option<i16>,
}

/// Longest board name and serial number, in bytes.
pub const NAME_BYTES: usize = 32;

/// Who the device is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BoardInfo {
    /// Name of its folder under `boards/`, or `virtual`.
    pub board: String<NAME_BYTES>,
    /// Unique to the device.
    pub serial: String<NAME_BYTES>,
    /// Firmware version.
    pub firmware: Version,
    /// What the device can do.
    pub capabilities: Capabilities,
}

impl BoardInfo {
    /// Of both names the first [`NAME_BYTES`] bytes at most are kept, in whole characters.
    #[must_use]
    pub fn new(board: &str, serial: &str, firmware: Version) -> Self {
        let capabilities = Capabilities::default();
        Self { board: cut(board), serial: cut(serial), firmware, capabilities }
    }

    /// The same board, which can do this as well.
    #[must_use]
    pub fn can(self, capability: Capabilities) -> Self {
        Self { capabilities: self.capabilities.with(capability), ..self }
    }
}

fn cut(text: &str) -> String<NAME_BYTES> {
    let mut name = String::new();
    for character in text.chars() {
        if name.push(character).is_err() {
            break;
        }
    }
    name
}

/// What a poll did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Progress {
    /// Something was sent or taken: poll again before sleeping.
    pub worked: bool,
    /// The board is to restart now: the reply that promises it has been given to the link.
    pub reboot: Option<RebootInto>,
}
