//! A host port beside a parallel port, behind which a DMA channel fills a ring.

use super::super::fake_fpga::FakeFpga;
use super::super::host_port::Port;
use crate::{BusError, FpgaBus, HostPort, Micros, Ring, RingMemory};
use core::sync::atomic::Ordering;
use nirspi_wire::host_port::SEALED_BYTES;
use nirspi_wire::register::{Register, control, mode};
use std::boxed::Box;
use std::collections::VecDeque;
use std::vec::Vec;

const WORDS: usize = 1024;

/// A host port beside a parallel port.
pub struct Wired {
    pub port: Port,
    ring: Ring,
    memory: &'static RingMemory<WORDS>,
    /// What the FPGA still has to send of the frame that it sends, and how many bytes it may send.
    outgoing: VecDeque<u8>,
    pub granted: usize,
    fifo: Vec<u8>,
    written: usize,
}

impl Wired {
    pub fn new() -> Self {
        let memory: &'static RingMemory<WORDS> = Box::leak(Box::new(RingMemory::new()));
        Self {
            port: Port::default(),
            ring: Ring::new(memory),
            memory,
            outgoing: VecDeque::new(),
            granted: 0,
            fifo: Vec::new(),
            written: 0,
        }
    }

    pub fn fpga(&mut self) -> &mut FakeFpga {
        &mut self.port.fpga
    }

    /// The FPGA's port sends these bytes, and the DMA moves the whole words among them.
    pub fn send(&mut self, bytes: &[u8]) {
        self.fifo.extend(bytes);
        let whole = self.fifo.len() / 4 * 4;
        for word in self.fifo.drain(..whole).collect::<Vec<_>>().chunks(4) {
            let value = u32::from_le_bytes(word.try_into().unwrap());
            self.memory.words()[self.written / 4 % WORDS].store(value, Ordering::Relaxed);
            self.written += 4;
        }
    }

    /// The FPGA's port sends what it may of the frames that wait, after `spoil` has changed the first. Returns those
    /// that it has begun.
    pub fn transmit(&mut self, spoil: impl FnOnce(&mut Vec<u8>)) -> Vec<Vec<u8>> {
        let mut spoil = Some(spoil);
        let mut begun = Vec::new();
        loop {
            if self.outgoing.is_empty() {
                let Some(mut packet) = self.fpga().frame.clone() else { return begun };
                begun.push(packet.clone());
                if let Some(spoil) = spoil.take() {
                    spoil(&mut packet);
                }
                self.outgoing.extend([&[0], &packet[..], &[0; 3]].concat());
            }
            let bytes = self.outgoing.len().min(self.granted);
            self.granted -= bytes;
            let bytes: Vec<u8> = self.outgoing.drain(..bytes).collect();
            self.send(&bytes);
            if !self.outgoing.is_empty() {
                return begun;
            }
            self.fpga().write(Register::Control.address(), control::RELEASE).unwrap();
        }
    }
}

impl HostPort for Wired {
    fn write(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) -> Result<(), BusError> {
        let begun = self.port.fpga.made;
        self.port.write(address, sealed)?;
        if self.port.fpga.running && self.port.fpga.made == 0 && begun > 0 {
            // A start cuts what is under way.
            self.outgoing.clear();
        }
        Ok(())
    }

    fn read(&mut self, address: u16) -> Result<[u8; SEALED_BYTES], BusError> {
        self.port.read(address)
    }

    fn frame_ready(&mut self) -> bool {
        self.port.fpga.raw.is_none()
            && self.port.fpga.get(Register::Mode) & mode::PARALLEL == 0
            && self.port.frame_ready()
    }

    fn raw_ready(&mut self) -> bool {
        self.port.raw_ready()
    }

    fn ring(&mut self) -> Option<&mut Ring> {
        Some(&mut self.ring)
    }

    fn look(&mut self) {
        self.ring.came(self.written % (4 * WORDS));
        let Micros(grant) = self.ring.grant();
        self.granted = 42 * grant as usize;
    }
}
