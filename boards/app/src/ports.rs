//! The interfaces that a board implements: its FPGA port, its pins, its depth sensor.
//!
//! A board makes no decisions. It transfers bytes, reads pins, and sets one pin to the level that
//! the firmware gives.

use core::future::Future;
use nirspi_mcu::{BusError, HostPort, Inputs, Lamps};
use nirspi_wire::RebootInto;

/// The FPGA's host port, with long reads during which the processor does other work.
pub trait FpgaPort: HostPort {
    /// Fills all of `into` by one access with this opcode ([`nirspi_wire::host_port`]) at address
    /// 0.
    ///
    /// # Errors
    /// [`BusError`]; the bytes are then undefined.
    fn read_bytes(
        &mut self,
        opcode: u8,
        into: &mut [u8],
    ) -> impl Future<Output = Result<(), BusError>>;

    /// Waits until one of the two ready lines is high. A board that cannot wait for its lines
    /// returns after a millisecond.
    fn ready(&mut self) -> impl Future<Output = ()>;
}

/// Everything else of a board.
pub trait Board {
    /// Sensor readings of this moment, without waiting.
    fn inputs(&mut self) -> Inputs;

    /// Sets the pin that enables the LED drivers; low after reset. The pin is high from a
    /// configuration until a fault, the end of the session, a crash, or a stop that the FPGA has not
    /// confirmed. It is high before the FPGA lights any LED, so no frame begins dark.
    fn enable_leds(&mut self, enabled: bool);

    /// Sets the lamps that people see. A board without lamps does nothing.
    fn show(&mut self, lamps: Lamps);

    /// Feeds the chip's watchdog. The firmware calls this at least once in 10 ms.
    fn feed_watchdog(&mut self);

    /// Restarts the chip.
    fn restart(&mut self, into: RebootInto) -> !;
}

/// Zones along one edge of a time-of-flight map.
pub const DEPTH_SIDE: u8 = 8;

/// Distances in mm, row-major; 0 where the sensor has no distance.
pub type DepthMap = [u16; DEPTH_SIDE as usize * DEPTH_SIDE as usize];

/// A time-of-flight sensor of 8 x 8 zones.
pub trait DepthSensor {
    /// Waits for the next map; `None` if the sensor does not answer in time.
    fn next(&mut self) -> impl Future<Output = Option<DepthMap>>;
}
