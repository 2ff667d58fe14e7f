//! The virtual camera as a link in memory. Its time advances while the host listens.

use super::{SimulatedFpga, VirtualCamera};
use nirspi::link::{Link, Received};
use nirspi_mcu::{GatewareLoader, NoLoader};
use std::io;
use std::time::Duration;

/// Clocks between two polls of the firmware while waiting: 8 us.
const STEP_CLOCKS: u32 = 1000;
/// The longest simulated time that one call advances without result, so that the host regains
/// control.
const PATIENCE_CLOCKS: u32 = 2_500_000;

/// A camera in the same process: single-threaded and deterministic.
pub struct MemoryLink<F, G = NoLoader> {
    camera: VirtualCamera<F, G>,
}

impl<F: SimulatedFpga, G: GatewareLoader> MemoryLink<F, G> {
    /// A link to this camera.
    #[must_use]
    pub fn new(camera: VirtualCamera<F, G>) -> Self {
        Self { camera }
    }

    /// Tells the camera that its host has gone.
    pub fn unplug(&mut self) {
        self.camera.link_closed();
    }
}

impl<F: SimulatedFpga, G: GatewareLoader + Send> Link for MemoryLink<F, G> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.camera.receive(bytes);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _timeout: Duration) -> io::Result<Received> {
        let mut spent = 0;
        while self.camera.packets_out().waiting().is_empty() {
            if spent >= PATIENCE_CLOCKS {
                return Ok(Received::Nothing);
            }
            self.camera.step(STEP_CLOCKS);
            spent += STEP_CLOCKS;
        }
        let packets = self.camera.packets_out();
        let length = packets.waiting().len().min(buffer.len());
        if let (Some(to), Some(from)) = (buffer.get_mut(..length), packets.waiting().get(..length))
        {
            to.copy_from_slice(from);
        }
        packets.sent(length);
        Ok(Received::Bytes(length))
    }
}
