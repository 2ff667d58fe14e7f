//! The pins of the RTL as the firmware's host port.

use crate::board::{Board, Front, HOST_PS};
use nirspi_mcu::{BusError, HostPort, Ring};
use nirspi_tests::throughput::{PACKET_SCK_PS, SCK_PS, TimedPort};
use nirspi_wire::host_port::{READ_FRAME, READ_PACKET, SCK_DIVIDER, SEALED_BYTES};

/// The host port of a powered board with the bring-up design.
pub struct RtlPort(Board);

impl RtlPort {
    /// The board after power-up, with the interlock closed.
    pub fn bring_up() -> Self {
        Self(Board::new(Front::loopback(), HOST_PS))
    }

    /// The same with the `sck` of the reference board, which is as fast as the slowest clock of the FPGA allows.
    pub fn bring_up_at_the_boards_sck() -> Self {
        Self(Board::new(Front::loopback(), SCK_PS / u64::from(SCK_DIVIDER)))
    }
}

impl RtlPort {
    /// The same with the wires of the parallel port.
    pub fn with_parallel_port() -> Self {
        let Self(mut board) = Self::bring_up_at_the_boards_sck();
        board.wire_parallel_port();
        Self(board)
    }
}

impl HostPort for RtlPort {
    fn write(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) -> Result<(), BusError> {
        self.0.write_sealed(address, sealed);
        Ok(())
    }

    fn read(&mut self, address: u16) -> Result<[u8; SEALED_BYTES], BusError> {
        Ok(self.0.read_sealed(address))
    }

    fn frame_ready(&mut self) -> bool {
        self.0.seen().frame_ready
    }

    fn raw_ready(&mut self) -> bool {
        self.0.seen().raw_ready
    }

    fn ring(&mut self) -> Option<&mut Ring> {
        self.0.receiver().map(|receiver| &mut receiver.ring)
    }

    fn look(&mut self) {
        let now_ps = self.0.now_ps();
        if let Some(receiver) = self.0.receiver() {
            receiver.look(now_ps);
        }
    }
}

impl TimedPort for RtlPort {
    fn transfer(&mut self, opcode: u8, into: &mut [u8]) {
        match opcode {
            READ_FRAME => into.copy_from_slice(&self.0.frame_bytes(into.len())),
            READ_PACKET => self.0.packet(into, PACKET_SCK_PS),
            other => panic!("opcode {other:#x}"),
        }
    }

    fn pass(&mut self, ps: u64) {
        let end = self.now_ps() + ps;
        while self.now_ps() < end {
            self.0.advance(1);
        }
    }

    fn now_ps(&self) -> u64 {
        self.0.now_ps()
    }

    fn pause_ps(&self) -> u64 {
        self.0.pause_ps()
    }
}
