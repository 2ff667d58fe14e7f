//! The FPGA's host port as the camera's [`FpgaBus`]: which data to transfer, how long it is, and until when it is kept.
//!
//! Register accesses are a few bytes, and done when the call returns. Frames and bursts are long, so the board
//! moves them between two polls, by DMA where it has one:
//!
//! ```
//! use nirspi_mcu::{BusError, HostPort, PortBus};
//!
//! /// One turn of a board's loop, after the camera's poll.
//! async fn transfer<P: HostPort>(
//!     bus: &mut PortBus<'_, P>,
//!     read: impl AsyncFn(&mut P, u8, &mut [u8]) -> Result<(), BusError>,
//! ) {
//!     if let Some((port, opcode, bytes)) = bus.wanted() {
//!         let done = read(port, opcode, bytes).await;
//!         bus.transferred(done);
//!     }
//! }
//! ```
//!
//! The one law: what has been transferred is given unchanged until the FPGA has been told to release it or to
//! start anew; nothing older is ever given after that.

use crate::{BusError, FpgaBus};
use nirspi_wire::fpga::{MAX_FRAME_BYTES, frame_bytes};
use nirspi_wire::host_port::{READ_FRAME, READ_RAW};
use nirspi_wire::register::{Register, control};

/// Times that a transfer is tried. The FPGA keeps the data until it is released.
const ATTEMPTS: u8 = 3;

/// Single accesses of the FPGA's host port, see [`nirspi_wire::host_port`]; and its two lines.
pub trait HostPort {
    /// Writes a register.
    ///
    /// # Errors
    /// [`BusError`].
    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError>;

    /// Reads a register.
    ///
    /// # Errors
    /// [`BusError`].
    fn read(&mut self, address: u16) -> Result<u32, BusError>;

    /// Level of the line: a frame is ready.
    fn frame_ready(&mut self) -> bool;

    /// Level of the line: a raw burst is ready.
    fn raw_ready(&mut self) -> bool;
}

/// What the FPGA delivers in one long read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Data {
    Frame,
    Raw,
}

/// How far a transfer is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Transfer {
    /// None asked for.
    None,
    /// The board is to carry it out; this many attempts have failed.
    Wanted { data: Data, failed: u8 },
    /// The buffer holds it.
    Held(Data),
    /// Not told yet.
    Failed(Data, BusError),
}

/// The FPGA behind its host port, with memory for one frame or burst.
#[derive(Debug)]
pub struct PortBus<'b, P> {
    port: P,
    buffer: &'b mut [u8; MAX_FRAME_BYTES],
    transfer: Transfer,
    /// As written last: the FPGA copies both when it starts.
    patterns: u32,
    raw_samples: u32,
    frame_bytes: usize,
    raw_bytes: usize,
}

impl<'b, P: HostPort> PortBus<'b, P> {
    /// An FPGA as after its reset. The buffer is lent because where it may lie is a matter of the board's DMA.
    #[must_use]
    pub fn new(port: P, buffer: &'b mut [u8; MAX_FRAME_BYTES]) -> Self {
        let mut bus = Self {
            port,
            buffer,
            transfer: Transfer::None,
            patterns: Register::Patterns.reset(),
            raw_samples: Register::RawLength.reset(),
            frame_bytes: 0,
            raw_bytes: 0,
        };
        bus.take_lengths();
        bus
    }

    /// The port, for its other lines.
    pub fn port(&mut self) -> &mut P {
        &mut self.port
    }

    /// The transfer to carry out now, if any: the port, the opcode, and where the bytes go, all of them.
    /// Then [`transferred`](Self::transferred) is to be called, before the camera is polled again.
    pub fn wanted(&mut self) -> Option<(&mut P, u8, &mut [u8])> {
        let Transfer::Wanted { data, .. } = self.transfer else { return None };
        let (opcode, length) = match data {
            Data::Frame => (READ_FRAME, self.frame_bytes),
            Data::Raw => (READ_RAW, self.raw_bytes),
        };
        Some((&mut self.port, opcode, self.buffer.get_mut(..length)?))
    }

    /// The wanted transfer is over.
    pub fn transferred(&mut self, result: Result<(), BusError>) {
        let Transfer::Wanted { data, failed } = self.transfer else { return };
        let failed = failed.saturating_add(1);
        self.transfer = match result {
            Ok(()) => Transfer::Held(data),
            Err(_) if failed < ATTEMPTS => Transfer::Wanted { data, failed },
            Err(error) => Transfer::Failed(data, error),
        };
    }

    fn data(&mut self, data: Data) -> Result<Option<&[u8]>, BusError> {
        match self.transfer {
            Transfer::Held(held) if held == data => {
                let length = if data == Data::Frame { self.frame_bytes } else { self.raw_bytes };
                Ok(self.buffer.get(..length))
            }
            Transfer::Wanted { data: wanted, .. } if wanted == data => Ok(None),
            Transfer::Failed(failed, error) if failed == data => {
                self.transfer = Transfer::None;
                Err(error)
            }
            _ => {
                self.transfer = Transfer::Wanted { data, failed: 0 };
                Ok(None)
            }
        }
    }

    /// What was written to [`Register::Control`] ends what was there before.
    fn note_control(&mut self, bits: u32) {
        let starts = bits & (control::START | control::START_RAW) != 0;
        let is_frame = match self.transfer {
            Transfer::None => false,
            Transfer::Wanted { data, .. } | Transfer::Held(data) | Transfer::Failed(data, _) => {
                data == Data::Frame
            }
        };
        if starts || (is_frame && bits & control::RELEASE != 0) {
            self.transfer = Transfer::None;
        }
        if starts {
            self.take_lengths();
        }
    }

    /// The FPGA refuses to start with settings beyond the buffer's length.
    fn take_lengths(&mut self) {
        let within = |length: usize| length.min(MAX_FRAME_BYTES);
        let patterns = u16::try_from(self.patterns).unwrap_or(u16::MAX);
        self.frame_bytes = within(frame_bytes(patterns));
        let samples = usize::try_from(self.raw_samples).unwrap_or(usize::MAX);
        self.raw_bytes = within(samples.saturating_mul(2));
    }
}

impl<P: HostPort> FpgaBus for PortBus<'_, P> {
    fn read(&mut self, address: u16) -> Result<u32, BusError> {
        self.port.read(address)
    }

    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError> {
        match Register::at(address) {
            Some(Register::Patterns) => self.patterns = value,
            Some(Register::RawLength) => self.raw_samples = value,
            Some(Register::Control) => self.note_control(value),
            _ => {}
        }
        self.port.write(address, value)
    }

    fn frame_ready(&mut self) -> bool {
        self.port.frame_ready()
    }

    fn raw_ready(&mut self) -> bool {
        self.port.raw_ready()
    }

    fn frame(&mut self) -> Result<Option<&[u8]>, BusError> {
        self.data(Data::Frame)
    }

    fn raw(&mut self) -> Result<Option<&[u8]>, BusError> {
        self.data(Data::Raw)
    }

    fn memory(&mut self) -> Option<&mut [u8]> {
        self.transfer = Transfer::None;
        Some(self.buffer)
    }
}
