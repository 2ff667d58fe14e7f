//! The microcontroller's end of the parallel port: a DMA channel writes what comes into a ring, and a timer lets the line
//! `parallel_ready` fall when the time is over for which the ring has room.

use nirspi_hdl_sim::pins::Parallel;
use nirspi_mcu::{Micros, Ring, RingMemory};
use nirspi_tests::throughput::RING_WORDS;
use std::sync::atomic::Ordering;

pub struct Receiver {
    pub ring: Ring,
    memory: &'static RingMemory<RING_WORDS>,
    /// Until when the line is high.
    until_ps: u64,
    /// Level of the port's clock at the end of the last clock.
    was_high: bool,
    /// Bytes of the unfinished word.
    word: Vec<u8>,
    /// Bytes in the ring since power-up.
    written: usize,
}

impl Receiver {
    pub fn new() -> Self {
        let memory: &'static RingMemory<RING_WORDS> = Box::leak(Box::new(RingMemory::new()));
        Self {
            ring: Ring::new(memory),
            memory,
            until_ps: 0,
            was_high: false,
            word: Vec::new(),
            written: 0,
        }
    }

    /// Notes in the ring what has come, and sets the timer.
    pub fn look(&mut self, now_ps: u64) {
        self.ring.came(self.written % (4 * RING_WORDS));
        let Micros(grant) = self.ring.grant();
        self.until_ps = now_ps + grant * 1_000_000;
    }

    /// Level of `parallel_ready`.
    pub fn is_ready(&self, now_ps: u64) -> bool {
        now_ps < self.until_ps
    }

    /// Takes a byte where the port's clock rises, in the first or in the second half of this clock.
    pub fn clock(&mut self, port: Parallel) {
        let [first, second] = [port.strobe & 2 != 0, port.strobe & 1 != 0];
        let rises = first && !self.was_high || second && !first;
        self.was_high = second;
        if !rises || !port.enable {
            return;
        }
        self.word.push(port.lines);
        if let Ok(word) = <[u8; 4]>::try_from(&self.word[..]) {
            let place = self.written / 4 % RING_WORDS;
            self.memory.words()[place].store(u32::from_le_bytes(word), Ordering::Relaxed);
            self.written += 4;
            self.word.clear();
        }
    }
}
