//! The FPGA beside the chip: the gateware's golden model.

use nirspi_hdl_model::{AdcSample, Gateware};
use nirspi_mcu::{BusError, FpgaBus};
use nirspi_virtual::SimulatedFpga;
use nirspi_wire::ADC_HZ;
use nirspi_wire::host_port::{
    QUAD, READ_FRAME, READ_PACKET, READ_RAW, READ_REGISTER, SEALED_BYTES, WRITE_REGISTER, seal,
    unseal,
};
use std::collections::VecDeque;

/// What the chip sees of it.
pub trait Fpga {
    /// Its time goes on to this moment of the chip's, in picoseconds.
    fn advance(&mut self, now_ps: u64);
    /// The bytes on the lines after opcode, address and dummy cycles.
    fn read(&mut self, opcode: u8, address: u16, bytes: usize) -> Vec<u8>;
    /// An access that writes. False: it has no effect.
    fn write(&mut self, opcode: u8, address: u16, bytes: &[u8]) -> bool;
    /// The lines `frame_ready` and `raw_ready`.
    fn ready(&mut self) -> (bool, bool);
    /// Whether its lines may change by themselves.
    fn runs(&self) -> bool;
    /// The level of the board's LED enable, beside its own.
    fn set_board_enable(&mut self, high: bool);
    /// The next bytes of the parallel port, at most so many.
    fn parallel(&mut self, most: usize) -> Vec<u8>;
}

/// A model of the gateware.
pub struct Golden<F> {
    model: F,
    clocks: u64,
    /// What the parallel port is sending.
    sending: VecDeque<u8>,
    /// Takes the next packet for the parallel port out of the model.
    packet: fn(&mut F) -> Option<Vec<u8>>,
}

/// Outside a run the model needs no more time than this for one look: nothing happens in it.
const IDLE_CLOCKS: u64 = 2_000;

impl<F: SimulatedFpga> Golden<F> {
    /// This model, whose parallel port has no wires.
    pub fn new(model: F) -> Self {
        Self { model, clocks: 0, sending: VecDeque::new(), packet: |_| None }
    }

    /// This model, with the packets of its parallel port.
    pub fn with_parallel(model: F, packet: fn(&mut F) -> Option<Vec<u8>>) -> Self {
        Self { packet, ..Self::new(model) }
    }
}

impl<F: SimulatedFpga> Fpga for Golden<F> {
    fn advance(&mut self, now_ps: u64) {
        let clocks = (u128::from(now_ps) * u128::from(ADC_HZ) / 1_000_000_000_000) as u64;
        let passed = clocks.saturating_sub(self.clocks);
        self.clocks = clocks;
        let passed = if self.model.running() { passed } else { passed.min(IDLE_CLOCKS) };
        self.model.advance(passed as u32);
    }

    fn read(&mut self, opcode: u8, address: u16, bytes: usize) -> Vec<u8> {
        let model = &mut self.model;
        let read = match opcode & !QUAD {
            READ_REGISTER => {
                let value = model.read(address).unwrap_or(0);
                Ok(Some(seal(address, value).to_vec()))
            }
            READ_FRAME | READ_PACKET => model.frame().map(|found| found.map(<[u8]>::to_vec)),
            READ_RAW => model.raw().map(|found| found.map(<[u8]>::to_vec)),
            _ => Ok(None),
        };
        let mut read = read.ok().flatten().unwrap_or_default();
        // Zeros behind what there is.
        read.resize(bytes, 0);
        read
    }

    fn write(&mut self, opcode: u8, address: u16, bytes: &[u8]) -> bool {
        let Ok(sealed) = <[u8; SEALED_BYTES]>::try_from(bytes) else { return false };
        let value = unseal(address, sealed).filter(|_| opcode & !QUAD == WRITE_REGISTER);
        value.is_some_and(|value| self.model.write(address, value).is_ok())
    }

    fn ready(&mut self) -> (bool, bool) {
        (self.model.frame_ready(), self.model.raw_ready())
    }

    fn runs(&self) -> bool {
        self.model.running() || !self.sending.is_empty()
    }

    fn set_board_enable(&mut self, high: bool) {
        self.model.set_board_enable(high);
    }

    fn parallel(&mut self, most: usize) -> Vec<u8> {
        while self.sending.len() < most
            && let Some(packet) = (self.packet)(&mut self.model)
        {
            self.sending.extend(nirspi_hdl_model::on_lines(&packet));
        }
        let length = most.min(self.sending.len());
        self.sending.drain(..length).collect()
    }
}

/// The gateware before an ADC that always says the same: no light to compute, for tests of time.
pub struct Even {
    gateware: Gateware,
    clock: u64,
}

impl Even {
    pub fn new() -> Self {
        let mut gateware = Gateware::new();
        gateware.set_interlock(true);
        Self { gateware, clock: 0 }
    }
}

impl SimulatedFpga for Even {
    fn advance(&mut self, clocks: u32) {
        for _ in 0..clocks {
            self.gateware.tick(AdcSample { code: 1000, over_range: false });
        }
        self.clock += u64::from(clocks);
    }

    fn clock(&self) -> u64 {
        self.clock
    }

    fn running(&self) -> bool {
        self.gateware.running()
    }

    fn set_interlock(&mut self, closed: bool) {
        self.gateware.set_interlock(closed);
    }

    /// Without light there is nothing to switch.
    fn set_board_enable(&mut self, _high: bool) {}
}

impl FpgaBus for Even {
    fn read(&mut self, address: u16) -> Result<u32, BusError> {
        Ok(self.gateware.read(address).unwrap_or(0))
    }

    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError> {
        self.gateware.write(address, value);
        Ok(())
    }

    fn frame_ready(&mut self) -> bool {
        self.gateware.frame_ready()
    }

    fn raw_ready(&mut self) -> bool {
        self.gateware.raw_ready()
    }

    fn frame(&mut self) -> Result<Option<&[u8]>, BusError> {
        Ok(self.gateware.frame())
    }

    fn raw(&mut self) -> Result<Option<&[u8]>, BusError> {
        Ok(self.gateware.raw())
    }
}
