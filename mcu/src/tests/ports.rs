//! Tests of what a board need not implement: an interface that leaves it out promises nothing.

use super::support::*;
use crate::{BusError, FpgaBus, GatewareLoader, LoadError, Micros, NoLoader};
use nirspi_wire::RunLength;

/// A bus with a frame and nothing that is optional.
struct Bus([u8; 4]);

impl FpgaBus for Bus {
    fn read(&mut self, _address: u16) -> Result<u32, BusError> {
        Ok(0)
    }

    fn write(&mut self, _address: u16, _value: u32) -> Result<(), BusError> {
        Ok(())
    }

    fn frame_ready(&mut self) -> bool {
        true
    }

    fn raw_ready(&mut self) -> bool {
        false
    }

    fn frame(&mut self) -> Result<Option<&[u8]>, BusError> {
        Ok(Some(&self.0))
    }

    fn raw(&mut self) -> Result<Option<&[u8]>, BusError> {
        Ok(None)
    }
}

#[test]
fn a_bus_that_says_nothing_of_it_has_no_memory_and_no_ring() {
    let mut bus = Bus([1, 2, 3, 4]);
    assert_eq!(bus.damaged(), 0);
    assert!(bus.ring().is_none());
    assert!(bus.memory().is_none());
}

#[test]
fn a_packet_is_the_frames_bytes_and_zeros_in_all_of_the_room() {
    let mut room = [9; 6];
    assert_eq!(Bus([1, 2, 3, 4]).packet(&mut room), Ok(true));
    assert_eq!(room, [1, 2, 3, 4, 0, 0]);
}

/// A loader that takes everything at once.
struct AtOnce;

impl GatewareLoader for AtOnce {
    fn begin(&mut self, _total: u32) -> Result<(), LoadError> {
        Ok(())
    }

    fn write(&mut self, _data: &[u8]) -> Result<(), LoadError> {
        Ok(())
    }

    fn finish(&mut self) -> Result<(), LoadError> {
        Ok(())
    }
}

/// A board does not poll the camera for as long as a loader has something to do.
#[test]
fn a_loader_is_done_unless_it_says_otherwise_and_no_loader_takes_nothing() {
    assert!(!AtOnce.step(Micros(0)));
    let mut none = NoLoader;
    assert!(!none.step(Micros(0)));
    let unsupported = Err(LoadError::Unsupported);
    let answers = [none.begin(4), none.write(&[1]), none.finish()];
    assert_eq!(answers, [unsupported; 3]);
}

/// At rest the firmware writes to the FPGA only if LEDs are on.
#[test]
fn an_fpga_that_is_dark_at_rest_is_looked_at_and_not_written() {
    let mut bench = Bench::configured();
    let before = bench.fpga.writes;
    for _ in 0..100 {
        bench.after(100_000);
    }
    assert_eq!(bench.fpga.writes, before);
    // A run that has ended is one at rest.
    let mut bench = Bench::running(RunLength::Frames(1));
    bench.frame();
    bench.after(1_000);
    let before = bench.fpga.writes;
    for _ in 0..100 {
        bench.after(100_000);
    }
    assert_eq!(bench.fpga.writes, before);
}
