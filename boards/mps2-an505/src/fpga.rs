//! The FPGA behind a tunnel: one request and one reply over a UART for each access of its host
//! port.
//!
//! The tunnel has a checksum of its own, so the checks of the host port are made and looked at here.
//!
//! Levels of lines and readings of sensors are those of the last reply. They stay true until the
//! next access, because simulated time passes only during accesses.

use crate::uart::Uart;
use core::cell::Cell;
use core::future::pending;
use embassy_time::{Duration, with_timeout};
use nirspi_app::FpgaPort;
use nirspi_mcu::{BusError, HostPort};
use nirspi_wire::Crc32;
use nirspi_wire::host_port::{READ_REGISTER, SEALED_BYTES, WRITE_REGISTER, seal, unseal};
use nirspi_wire::tunnel::{CRC_BYTES, LOOK, Lines, REPLY_HEAD_BYTES, Request};

/// Longest time for a register access: a simulator of the RTL needs some milliseconds.
const PATIENCE: Duration = Duration::from_secs(1);
/// Longest time for an access after one without an answer. This time is short so that the host need
/// not wait for a missing FPGA.
const IMPATIENCE: Duration = Duration::from_millis(50);
/// Longest time for a frame: a simulator of the RTL needs some seconds.
const DATA_PATIENCE: Duration = Duration::from_secs(30);
/// Time of silence after a failed access, in which a late reply arrives.
const SILENCE: Duration = Duration::from_millis(20);

/// The tunnel's end.
pub struct Tunnel<'b> {
    uart: &'static Uart,
    lines: &'b Cell<Lines>,
    board_enable: &'b Cell<bool>,
    number: u8,
    look: Option<Look>,
    patience: Duration,
}

/// A look at the lines whose reply has not arrived whole. The task that waited may be gone; the
/// reply comes all the same.
struct Look {
    request: Request,
    reply: [u8; REPLY_HEAD_BYTES + CRC_BYTES],
    filled: usize,
}

impl<'b> Tunnel<'b> {
    /// A tunnel over this UART. Readings of the sensors are written to `lines`, and each access tells the level of the
    /// board's LED enable.
    pub fn new(uart: &'static Uart, lines: &'b Cell<Lines>, board_enable: &'b Cell<bool>) -> Self {
        // A crash may have left half a request.
        uart.quieten(SILENCE);
        let mut tunnel =
            Self { uart, lines, board_enable, number: 0, look: None, patience: PATIENCE };
        tunnel.begin_look();
        // A missing answer leaves no FPGA, no interlock and no sensor, and the camera reports that.
        let _ = tunnel.end_look();
        tunnel
    }

    fn next(&mut self, opcode: u8, address: u16, argument: u32) -> Request {
        self.number = self.number.wrapping_add(1);
        let board_enable = self.board_enable.get();
        Request { opcode, number: self.number, address, argument, board_enable }
    }

    /// Takes the lines of a correct reply.
    fn check(
        &mut self,
        request: Request,
        head: [u8; REPLY_HEAD_BYTES],
        data: &[u8],
        crc: [u8; CRC_BYTES],
    ) -> Result<(), BusError> {
        let mut expected = Crc32::new();
        expected.update(&head);
        expected.update(data);
        let (number, lines) = Lines::from_reply_head(head);
        if number != request.number || expected.value() != u32::from_le_bytes(crc) {
            return self.failed(BusError::Transfer);
        }
        self.lines.set(lines);
        self.patience = PATIENCE;
        Ok(())
    }

    fn failed(&mut self, error: BusError) -> Result<(), BusError> {
        self.uart.quieten(SILENCE);
        self.patience = IMPATIENCE;
        self.lines.set(Lines { frame_ready: false, raw_ready: false, ..self.lines.get() });
        Err(error)
    }

    fn begin_look(&mut self) {
        if self.look.is_none() {
            let request = self.next(LOOK, 0, 0);
            self.uart.write_blocking(&request.to_bytes());
            self.look = Some(Look { request, reply: [0; _], filled: 0 });
        }
    }

    /// Waits for a reply that has not arrived yet, if any.
    fn end_look(&mut self) -> Result<(), BusError> {
        let Some(Look { request, mut reply, filled }) = self.look.take() else { return Ok(()) };
        let rest = reply.get_mut(filled..).unwrap_or_default();
        if self.uart.read_blocking(rest, self.patience).is_err() {
            return self.failed(BusError::Timeout);
        }
        let [h0, h1, h2, h3, crc @ ..] = reply;
        self.check(request, [h0, h1, h2, h3], &[], crc)
    }

    fn access(&mut self, request: Request, data: &mut [u8]) -> Result<(), BusError> {
        self.end_look()?;
        self.uart.write_blocking(&request.to_bytes());
        let (mut head, mut crc) = ([0; REPLY_HEAD_BYTES], [0; CRC_BYTES]);
        for part in [&mut head[..], data, &mut crc[..]] {
            if self.uart.read_blocking(part, self.patience).is_err() {
                return self.failed(BusError::Timeout);
            }
        }
        self.check(request, head, data, crc)
    }

    async fn long_access(&mut self, request: Request, data: &mut [u8]) -> Result<(), BusError> {
        self.end_look()?;
        let (mut head, mut crc) = ([0; REPLY_HEAD_BYTES], [0; CRC_BYTES]);
        let answer = async {
            self.uart.write(&request.to_bytes()).await;
            for part in [&mut head[..], data, &mut crc[..]] {
                self.uart.read_exact(part).await;
            }
        };
        if with_timeout(DATA_PATIENCE, answer).await.is_err() {
            return self.failed(BusError::Timeout);
        }
        self.check(request, head, data, crc)
    }
}

impl HostPort for Tunnel<'_> {
    fn write(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) -> Result<(), BusError> {
        let value = unseal(address, sealed).ok_or(BusError::Transfer)?;
        let request = self.next(WRITE_REGISTER, address, value);
        self.access(request, &mut [])
    }

    fn read(&mut self, address: u16) -> Result<[u8; SEALED_BYTES], BusError> {
        let request = self.next(READ_REGISTER, address, 0);
        let mut value = [0; 4];
        self.access(request, &mut value)?;
        Ok(seal(address, u32::from_le_bytes(value)))
    }

    fn frame_ready(&mut self) -> bool {
        self.lines.get().frame_ready
    }

    fn raw_ready(&mut self) -> bool {
        self.lines.get().raw_ready
    }
}

impl FpgaPort for Tunnel<'_> {
    async fn read_bytes(&mut self, opcode: u8, into: &mut [u8]) -> Result<(), BusError> {
        let length = u32::try_from(into.len()).map_err(|_| BusError::Transfer)?;
        let request = self.next(opcode, 0, length);
        self.long_access(request, into).await
    }

    /// Looks at the lines once, which lets simulated time pass. The application's next turn looks
    /// again.
    async fn ready(&mut self) {
        self.begin_look();
        while let Some(look) = &mut self.look
            && let rest @ [_, ..] = look.reply.get_mut(look.filled..).unwrap_or_default()
        {
            look.filled += self.uart.read(rest).await;
        }
        // The next register access notices a simulator that does not answer.
        let _ = self.end_look();
        if !self.frame_ready() && !self.raw_ready() {
            pending::<()>().await;
        }
    }
}
