//! The interfaces that a board implements for the firmware: the FPGA, the link to the host, a
//! bitstream loader, its sensors.
//!
//! No call waits. An operation that is not complete says so, and the firmware asks again on a later
//! poll.

use crate::{Loan, Micros, Ring};
use core::ops::Range;
use heapless::String;
use nirspi_wire::{Capabilities, RebootInto, Version};

/// Why an access to the FPGA failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BusError {
    /// The transfer did not complete in time.
    Timeout,
    /// The bus peripheral reported an error.
    Transfer,
    /// The access came damaged, however often it was repeated.
    Damaged,
}

/// The FPGA's host port: registers of [`nirspi_wire::register`], frames of [`nirspi_wire::fpga`].
///
/// A register access is a few bytes and is complete when the call returns: a value that was read is the
/// FPGA's, and a write to a register has been taken. The order table's entries are read back by the
/// camera. Every access, to a register or to data, restarts the FPGA's watchdog.
pub trait FpgaBus {
    /// Reads a register.
    ///
    /// # Errors
    /// [`BusError`]. A missing FPGA usually reads as all zeros or all ones instead.
    fn read(&mut self, address: u16) -> Result<u32, BusError>;

    /// Writes a register.
    ///
    /// # Errors
    /// [`BusError`].
    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError>;

    /// Register accesses since power-up that came damaged, each repetition counted. A bus without
    /// wires damages none.
    fn damaged(&self) -> u32 {
        0
    }

    /// Level of the FPGA's line: a frame is ready. The line falls with `CONTROL.RELEASE`.
    fn frame_ready(&mut self) -> bool;

    /// Whether a raw burst can be read.
    fn raw_ready(&mut self) -> bool;

    /// The whole frame that is ready; `None` during its transfer. Each call gives the same bytes
    /// until `CONTROL.RELEASE` is written.
    ///
    /// # Errors
    /// [`BusError`]; the firmware then discards and releases the frame.
    fn frame(&mut self) -> Result<Option<&[u8]>, BusError>;

    /// Reads the packet that is ready into `room`, which is of the link and has
    /// [`fast_read_bytes`](nirspi_wire::ready::fast_read_bytes): zeros, the packet, zeros. False during the transfer, which
    /// a board carries out into the same room before the next call.
    ///
    /// # Errors
    /// [`BusError`]; the firmware then discards and releases the frame.
    fn packet(&mut self, room: &mut [u8]) -> Result<bool, BusError> {
        let Some(bytes) = self.frame()? else { return Ok(false) };
        room.fill(0);
        if let Some(place) = room.get_mut(..bytes.len()) {
            place.copy_from_slice(bytes);
        }
        Ok(true)
    }

    /// The ring of the FPGA's parallel port, with what had come at the last [`look`](Self::look). `None`: this board has
    /// no wires to that port, and the code that serves the port is left out of its firmware.
    fn ring(&mut self) -> Option<&mut Ring> {
        None
    }

    /// Notes in that ring what has come until now, and lets the FPGA send for as long as the ring grants.
    fn look(&mut self) {}

    /// The whole raw burst that is ready, as little-endian `u16` samples; `None` during its
    /// transfer. Each call gives the same bytes until the next start.
    ///
    /// # Errors
    /// [`BusError`]; the firmware then discards the burst.
    fn raw(&mut self) -> Result<Option<&[u8]>, BusError>;

    /// The frame buffer, lent to the memory self-test; its contents are lost. `None` if this bus
    /// has no buffer.
    fn memory(&mut self) -> Option<&mut [u8]> {
        None
    }
}

/// The link towards the host. It takes whole packets or nothing.
pub trait PacketSink {
    /// Room for one packet of at most `length` bytes; `None`: the link is full, which is
    /// back-pressure and not an error. The next claim takes back room that was not committed: a claim
    /// of the same length gives the same room, with the bytes that were written into it.
    fn claim(&mut self, length: usize) -> Option<&mut [u8]>;

    /// Sends this part of the claimed room.
    fn commit(&mut self, part: Range<usize>);

    /// Sends bytes of a ring where they lie, after all that was sent before, and gives them back when the host has
    /// them. False: the link is full, or it is one that cannot, and a board with a ring must have one that can. Room
    /// that was claimed and not committed is taken back.
    fn lend(&mut self, _loan: Loan) -> bool {
        false
    }
}

/// Why a bitstream could not be loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoadError {
    /// This board cannot load gateware, or not a bitstream of this length.
    Unsupported,
    /// The FPGA or the flash memory did not accept the bitstream.
    Device,
}

/// The destination of a bitstream. A second `begin` discards an unfinished bitstream.
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

    /// Puts the bitstream into effect. All bytes have been written and their checksum is right.
    ///
    /// # Errors
    /// [`LoadError`].
    fn finish(&mut self) -> Result<(), LoadError>;

    /// The FPGA does not answer, so it is not known to run the bitstream loaded last.
    fn forget(&mut self) {}

    /// Continues what `finish` began, for a millisecond at most; true if there is more to do. Until
    /// `step` returns false, the board does not poll the camera: meanwhile the FPGA has no host
    /// port and lights no LED.
    fn step(&mut self, _now: Micros) -> bool {
        false
    }
}

/// The loader of a board without gateware loading.
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

/// Everything that a board lends for one call.
#[derive(Debug)]
pub struct Ports<'p, B, S, G> {
    /// The FPGA.
    pub bus: &'p mut B,
    /// The link towards the host.
    pub sink: &'p mut S,
    /// The destination of bitstreams.
    pub loader: &'p mut G,
}

/// Sensor readings that the board takes for every call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Inputs {
    /// The enclosure's interlock.
    pub interlock_closed: bool,
    /// LED array, hundredths of a degree Celsius; `None`: the sensor does not answer.
    pub temperature_centi_celsius: Option<i16>,
}

/// Longest board name and serial number, in bytes.
pub const NAME_BYTES: usize = 32;

/// Identity of the device.
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
    /// Keeps the first [`NAME_BYTES`] bytes of both names, in whole characters.
    #[must_use]
    pub fn new(board: &str, serial: &str, firmware: Version) -> Self {
        let capabilities = Capabilities::default();
        Self { board: cut(board), serial: cut(serial), firmware, capabilities }
    }

    /// The same board with one more capability.
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

/// Outcome of a poll.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Progress {
    /// Something was sent or taken: the board polls again before it sleeps.
    pub worked: bool,
    /// The board must restart now; the link already holds the reply that promises the restart.
    pub reboot: Option<RebootInto>,
}
