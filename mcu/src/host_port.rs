//! The FPGA's host port as the camera's [`FpgaBus`]: which data to transfer, how long the data is,
//! and how long to keep it.
//!
//! A register access is a few bytes and is complete when the call returns. Frames and bursts are
//! long, so the board transfers them between two polls, by DMA where it has one:
//!
//! ```
//! use nirspi_mcu::{BusError, HostPort, PacketSink, PortBus, Target, Wanted};
//!
//! /// One turn of a board's loop, after the camera's poll. `forward` is the camera's.
//! async fn transfer<P: HostPort, S: PacketSink>(
//!     bus: &mut PortBus<'_, P>,
//!     link: &mut S,
//!     forward: impl FnOnce(&mut PortBus<'_, P>, &mut S),
//!     read: impl AsyncFn(&mut P, u8, &mut [u8]) -> Result<(), BusError>,
//! ) {
//!     match bus.wanted() {
//!         None => {}
//!         Some(Wanted { port, opcode, into: Target::Bus(bytes) }) => {
//!             let done = read(port, opcode, bytes).await;
//!             bus.transferred(done);
//!         }
//!         Some(Wanted { port, opcode, into: Target::Link(length) }) => {
//!             if let Some(room) = link.claim(length) {
//!                 let done = read(port, opcode, room).await;
//!                 bus.transferred(done);
//!             }
//!             forward(bus, link);
//!         }
//!     }
//! }
//! ```
//!
//! Wires damage what they carry, so every register access has a check, and the bus decides what to
//! believe. A read whose check is wrong is repeated: reads have no side effect that a second read would
//! not have. A write whose check is wrong is not taken by the FPGA, which counts the writes that it
//! took ([`Register::Writes`]): the bus reads that count after every write to a register, and repeats
//! a write that was not taken. So a start or a release acts once. The entries of the order table are
//! not asked for one by one, because the camera reads the whole table back.
//!
//! In a run the FPGA makes packets of its frames ([`nirspi_wire::ready`]). A packet goes straight into the link's
//! room, and needs no buffer of the bus. Such a read is clocked by `sck` itself ([`READ_PACKET`]).
//!
//! Packets of the FPGA's parallel port come by no transfer: a board that has the port's wires has the
//! [`Ring`] into which its DMA writes them. A start makes the ring forget what came before.
//!
//! # Invariant
//! Transferred data is given unchanged until the FPGA gets a release or a new start
//! (`tests::host_port::a_frame_is_transferred_once_and_given_until_it_is_released`). After a
//! release, data from before it is never given again
//! (`tests::host_port::after_a_release_an_older_frame_is_never_given`).
//!
//! A damaged answer is never given, and a damaged write is repeated or an error
//! (`tests::wires::no_damaged_answer_is_believed_and_no_damaged_write_is_taken_for_done`).

use crate::{BusError, FpgaBus, Ring};
use nirspi_wire::fpga::{MAX_FRAME_BYTES, frame_bytes};
use nirspi_wire::host_port::{READ_FRAME, READ_PACKET, READ_RAW, SEALED_BYTES, seal, unseal};
use nirspi_wire::ready::fast_read_bytes;
use nirspi_wire::register::{NO_CLOCK, ORDER_TABLE, Register, control, mode};
use nirspi_wire::samples::Width;

/// Number of attempts at a transfer. The FPGA keeps the data until the release.
const ATTEMPTS: u8 = 3;

/// Number of attempts at a register access whose check is wrong.
const REGISTER_ATTEMPTS: u8 = 3;

/// Single accesses of the FPGA's host port (see [`nirspi_wire::host_port`]), and the port's two
/// lines. A board carries bytes and judges none.
pub trait HostPort {
    /// Sends a write of these bytes: value and check.
    ///
    /// # Errors
    /// [`BusError`].
    fn write(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) -> Result<(), BusError>;

    /// Reads as many bytes of a register's answer: value and check.
    ///
    /// # Errors
    /// [`BusError`].
    fn read(&mut self, address: u16) -> Result<[u8; SEALED_BYTES], BusError>;

    /// Level of the line: a frame is ready.
    fn frame_ready(&mut self) -> bool;

    /// Level of the line: a raw burst is ready.
    fn raw_ready(&mut self) -> bool;

    /// The ring into which a DMA channel writes the bytes of the FPGA's parallel port. `None`: this board has no wires
    /// to that port.
    fn ring(&mut self) -> Option<&mut Ring> {
        None
    }

    /// Tells the ring the channel's place of this moment ([`Ring::came`]). From the moment before that place was read,
    /// the line on which the FPGA sends stays high for [`Ring::grant`], and then falls by itself.
    fn look(&mut self) {}
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
    /// No transfer is asked for.
    None,
    /// The board must carry out this transfer; `failed` attempts have failed.
    Wanted { data: Data, failed: u8 },
    /// The buffer holds this data.
    Held(Data),
    /// The transfer failed; the camera has not been given the error yet.
    Failed(Data, BusError),
}

/// The FPGA behind its host port, with memory for one frame or burst.
#[derive(Debug)]
pub struct PortBus<'b, P> {
    port: P,
    buffer: &'b mut [u8; MAX_FRAME_BYTES],
    transfer: Transfer,
    /// The values written last. The FPGA copies them when it starts.
    mode: u32,
    patterns: u32,
    raw_samples: u32,
    /// Frames of this run are packets, which go into the link's room.
    packets: bool,
    /// Bytes of a frame or packet.
    frame_bytes: usize,
    raw_bytes: usize,
    /// The FPGA's count of writes when it was last read.
    writes: Option<u32>,
    /// Accesses that came damaged since power-up.
    damaged: u32,
}

/// A transfer to carry out, and what there is to do meanwhile.
#[derive(Debug)]
pub struct Wanted<'w, P> {
    /// The FPGA's port.
    pub port: &'w mut P,
    /// Opcode of the read.
    pub opcode: u8,
    /// Where the bytes go.
    pub into: Target<'w>,
}

/// Where the bytes of a transfer go.
#[derive(Debug)]
pub enum Target<'w> {
    /// Into memory of the bus.
    Bus(&'w mut [u8]),
    /// Into room of the link for so many bytes, which the board claims. After the transfer and before anything
    /// else is claimed, the board must call [`Camera::forward`](crate::Camera::forward); without room it makes
    /// that call alone.
    Link(usize),
}

impl<'b, P: HostPort> PortBus<'b, P> {
    /// The bus of an FPGA after its reset. The buffer is a parameter because the board's DMA
    /// decides where the buffer may lie.
    #[must_use]
    pub fn new(port: P, buffer: &'b mut [u8; MAX_FRAME_BYTES]) -> Self {
        let mut bus = Self {
            port,
            buffer,
            transfer: Transfer::None,
            mode: Register::Mode.reset(),
            patterns: Register::Patterns.reset(),
            raw_samples: Register::RawLength.reset(),
            packets: false,
            frame_bytes: 0,
            raw_bytes: 0,
            writes: None,
            damaged: 0,
        };
        bus.take_lengths();
        bus
    }

    /// The port, for access to its other lines.
    pub fn port(&mut self) -> &mut P {
        &mut self.port
    }

    /// The transfer to carry out now, if any. After the transfer, and before the next poll of the
    /// camera, the board must call [`transferred`](Self::transferred).
    pub fn wanted(&mut self) -> Option<Wanted<'_, P>> {
        let Transfer::Wanted { data, .. } = self.transfer else { return None };
        let (opcode, length) = match data {
            Data::Frame if self.packets => {
                let into = Target::Link(self.frame_bytes);
                return Some(Wanted { port: &mut self.port, opcode: READ_PACKET, into });
            }
            Data::Frame => (READ_FRAME, self.frame_bytes),
            Data::Raw => (READ_RAW, self.raw_bytes),
        };
        let into = Target::Bus(self.buffer.get_mut(..length)?);
        Some(Wanted { port: &mut self.port, opcode, into })
    }

    /// Reports the end of the wanted transfer.
    pub fn transferred(&mut self, result: Result<(), BusError>) {
        let Transfer::Wanted { data, failed } = self.transfer else { return };
        let failed = failed.saturating_add(1);
        self.transfer = match result {
            Ok(()) => Transfer::Held(data),
            Err(_) if failed < ATTEMPTS => Transfer::Wanted { data, failed },
            Err(error) => Transfer::Failed(data, error),
        };
    }

    fn count_damage(&mut self) {
        self.damaged = self.damaged.saturating_add(1);
    }

    /// Reads a register, at most [`REGISTER_ATTEMPTS`] times.
    ///
    /// An identity counts without a check if it is the same every time, because all that follows is a refusal whose
    /// value shows crossed wires.
    fn read_checked(&mut self, address: u16) -> Result<u32, BusError> {
        let mut steady = None;
        for attempt in 0..REGISTER_ATTEMPTS {
            let sealed = self.port.read(address)?;
            if let Some(value) = unseal(address, sealed) {
                return Ok(value);
            }
            self.count_damage();
            steady = if attempt == 0 { Some(sealed) } else { steady.filter(|&s| s == sealed) };
        }
        steady
            .filter(|_| address == Register::Identity.address())
            .map(|[v0, v1, v2, v3, ..]| u32::from_be_bytes([v0, v1, v2, v3]))
            .ok_or(BusError::Damaged)
    }

    /// Writes a register, at most [`REGISTER_ATTEMPTS`] times until the FPGA has taken the write. The
    /// write is sent even if the count before cannot be read, because it may be a stop.
    fn write_checked(&mut self, address: u16, value: u32) -> Result<(), BusError> {
        let register = Register::Writes.address();
        for _ in 0..REGISTER_ATTEMPTS {
            let before = match self.writes.take() {
                Some(writes) => Ok(writes),
                None => self.read_checked(register),
            };
            self.port.write(address, seal(address, value))?;
            let (before, after) = (before?, self.read_checked(register)?);
            if after == NO_CLOCK {
                // Without the ADC's clock no write does anything, and the FPGA says so in every answer.
                return Ok(());
            }
            self.writes = Some(after);
            if after == before.wrapping_add(1) {
                return Ok(());
            }
            // Any other count is that of an FPGA that was reset, or of one whose clock has come back.
            if after == before {
                self.count_damage();
            }
        }
        Err(BusError::Damaged)
    }

    #[inline(never)]
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

    /// Discards what the bits written to [`Register::Control`] end.
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
            self.port.look();
            if let Some(ring) = self.port.ring() {
                ring.restart();
            }
            self.take_lengths();
        }
    }

    /// Copies the lengths for the next run. The FPGA refuses settings that do not fit the buffer.
    fn take_lengths(&mut self) {
        let within = |length: usize| length.min(MAX_FRAME_BYTES);
        let patterns = u16::try_from(self.patterns).unwrap_or(u16::MAX);
        self.packets = self.mode & mode::PACKETS != 0;
        let width = if self.mode & mode::NARROW == 0 { Width::Bits32 } else { Width::Bits24 };
        self.frame_bytes = within(match self.packets {
            true => fast_read_bytes(patterns, width),
            false => frame_bytes(patterns),
        });
        let samples = usize::try_from(self.raw_samples).unwrap_or(usize::MAX);
        self.raw_bytes = within(samples.saturating_mul(2));
    }
}

impl<P: HostPort> FpgaBus for PortBus<'_, P> {
    fn read(&mut self, address: u16) -> Result<u32, BusError> {
        self.read_checked(address)
    }

    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError> {
        match Register::at(address) {
            Some(Register::Mode) => self.mode = value,
            Some(Register::Patterns) => self.patterns = value,
            Some(Register::RawLength) => self.raw_samples = value,
            Some(Register::Control) => self.note_control(value),
            _ => {}
        }
        if address < ORDER_TABLE {
            self.write_checked(address, value)
        } else {
            // The write counts, unless it comes damaged.
            self.writes = None;
            self.port.write(address, seal(address, value))
        }
    }

    fn damaged(&self) -> u32 {
        self.damaged
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

    fn packet(&mut self, _room: &mut [u8]) -> Result<bool, BusError> {
        // The bytes came into the room by themselves. They are given once, because the room is the link's.
        let has_come = self.data(Data::Frame)?.is_some();
        if has_come {
            self.transfer = Transfer::None;
        }
        Ok(has_come)
    }

    fn ring(&mut self) -> Option<&mut Ring> {
        self.port.ring()
    }

    fn look(&mut self) {
        self.port.look();
    }

    fn raw(&mut self) -> Result<Option<&[u8]>, BusError> {
        self.data(Data::Raw)
    }

    fn memory(&mut self) -> Option<&mut [u8]> {
        self.transfer = Transfer::None;
        Some(self.buffer)
    }
}
