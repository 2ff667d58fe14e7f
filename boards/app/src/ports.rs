//! What a board implements: its FPGA port, its pins, its depth sensor.
//!
//! The one law: a board decides nothing. It moves bytes, reads pins, and sets one pin as it is told.

use core::future::Future;
use nirspi_mcu::{BusError, HostPort, Inputs};
use nirspi_wire::RebootInto;

/// The FPGA's host port with long reads that do not keep the processor.
pub trait FpgaPort: HostPort {
    /// Fills all of `into` by one access with this opcode ([`nirspi_wire::host_port`]) at address 0.
    ///
    /// # Errors
    /// [`BusError`]; the bytes are then of no use.
    fn read_bytes(
        &mut self,
        opcode: u8,
        into: &mut [u8],
    ) -> impl Future<Output = Result<(), BusError>>;

    /// Until one of the two ready lines is high. A board that cannot wait for its lines returns in a millisecond.
    fn ready(&mut self) -> impl Future<Output = ()>;
}

/// Everything else of a board.
pub trait Board {
    /// Sensors as of now, without waiting.
    fn inputs(&mut self) -> Inputs;

    /// Level of the pin that lets the LED drivers work; low after reset. It is high from a configuration on
    /// until a fault, the end of the session or a crash: before the FPGA lights anything, so that no frame begins dark.
    fn enable_leds(&mut self, enabled: bool);

    /// The firmware is alive: called at least once in 10 ms.
    fn feed_watchdog(&mut self);

    /// Restarts the chip.
    fn restart(&mut self, into: RebootInto) -> !;
}

/// Zones along one edge of a time-of-flight map.
pub const DEPTH_SIDE: u8 = 8;

/// Distances in mm, row-major; 0 where there is none.
pub type DepthMap = [u16; DEPTH_SIDE as usize * DEPTH_SIDE as usize];

/// A time-of-flight sensor of 8 x 8 zones.
pub trait DepthSensor {
    /// Waits for the next map; `None` if the sensor does not answer, after a while.
    fn next(&mut self) -> impl Future<Output = Option<DepthMap>>;
}
