//! A tap that records what an FPGA gives its firmware.
//!
//! A tap changes nothing.

use nirspi_mcu::{BusError, FpgaBus};
use nirspi_virtual::SimulatedFpga;
use std::sync::{Arc, Mutex};

/// Bytes of each frame and burst, in order of arrival.
#[derive(Debug, Clone, Default)]
pub struct Log(Arc<Mutex<Vec<Vec<u8>>>>);

impl Log {
    pub fn bytes(&self) -> Vec<Vec<u8>> {
        self.0.lock().unwrap().clone()
    }
}

/// An FPGA with a log.
pub struct Tap<F> {
    fpga: F,
    log: Log,
}

impl<F: SimulatedFpga> Tap<F> {
    pub fn new(fpga: F) -> (Self, Log) {
        let log = Log::default();
        (Self { fpga, log: log.clone() }, log)
    }

    /// Records new bytes once. The bus gives the same bytes again until their release.
    fn note(log: &Log, bytes: Option<&[u8]>) {
        let mut log = log.0.lock().unwrap();
        if let Some(bytes) = bytes
            && log.last().is_none_or(|last| last != bytes)
        {
            log.push(bytes.to_vec());
        }
    }
}

impl<F: SimulatedFpga> FpgaBus for Tap<F> {
    fn read(&mut self, address: u16) -> Result<u32, BusError> {
        self.fpga.read(address)
    }

    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError> {
        self.fpga.write(address, value)
    }

    fn frame_ready(&mut self) -> bool {
        self.fpga.frame_ready()
    }

    fn raw_ready(&mut self) -> bool {
        self.fpga.raw_ready()
    }

    fn frame(&mut self) -> Result<Option<&[u8]>, BusError> {
        let bytes = self.fpga.frame()?;
        Self::note(&self.log, bytes);
        Ok(bytes)
    }

    fn raw(&mut self) -> Result<Option<&[u8]>, BusError> {
        let bytes = self.fpga.raw()?;
        Self::note(&self.log, bytes);
        Ok(bytes)
    }
}

impl<F: SimulatedFpga> SimulatedFpga for Tap<F> {
    fn advance(&mut self, clocks: u32) {
        self.fpga.advance(clocks);
    }

    fn clock(&self) -> u64 {
        self.fpga.clock()
    }

    fn running(&self) -> bool {
        self.fpga.running()
    }

    fn set_interlock(&mut self, closed: bool) {
        self.fpga.set_interlock(closed);
    }

    fn set_board_enable(&mut self, high: bool) {
        self.fpga.set_board_enable(high);
    }
}
