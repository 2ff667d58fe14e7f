//! The pins of the RTL as the firmware's host port.

use crate::board::{Board, Front};
use nirspi_mcu::{BusError, HostPort};
use nirspi_wire::host_port::SEALED_BYTES;

/// The host port of a powered board with the bring-up design.
pub struct RtlPort(Board);

impl RtlPort {
    /// The board after power-up, with the interlock closed.
    pub fn bring_up() -> Self {
        Self(Board::new(Front::loopback()))
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
}
