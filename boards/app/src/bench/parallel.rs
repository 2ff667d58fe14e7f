//! The parallel port of the fake FPGA, and the ring into which a DMA channel writes what it sends.

use core::sync::atomic::Ordering;
use nirspi_mcu::{Micros, Ring, RingMemory};
use std::boxed::Box;
use std::collections::VecDeque;
use std::vec::Vec;

/// 16 KB: some packets of the longest frames.
const WORDS: usize = 4096;
/// Bytes of a round of the ring.
pub const ROUND_BYTES: usize = 4 * WORDS;
/// Bytes that the FPGA sends in a microsecond.
const BYTES_PER_MICRO: u64 = 41;
/// Frames that can wait in the FPGA.
const BANKS: usize = 3;
/// Bytes that come after the line has fallen.
const LATE: usize = 4;

/// Port, channel and ring.
pub struct Parallel {
    pub ring: Ring,
    memory: &'static RingMemory<WORDS>,
    /// Packets that wait, the first of which is being sent.
    waiting: VecDeque<VecDeque<u8>>,
    /// Bytes of an unfinished word.
    fifo: Vec<u8>,
    /// Bytes in the ring since power-up.
    pub written: usize,
    /// Until when the port has sent, and until when it may.
    sent_us: u64,
    until_us: u64,
    pub made: u32,
    pub lost: u32,
}

impl Parallel {
    pub fn new() -> Self {
        let memory: &'static RingMemory<WORDS> = Box::leak(Box::new(RingMemory::new()));
        Self {
            ring: Ring::new(memory),
            memory,
            waiting: VecDeque::new(),
            fifo: Vec::new(),
            written: 0,
            sent_us: 0,
            until_us: 0,
            made: 0,
            lost: 0,
        }
    }

    /// A run begins, which cuts what is under way.
    pub fn start(&mut self) {
        (self.made, self.lost) = (0, 0);
        self.waiting.clear();
    }

    /// A frame is complete. It is lost if all banks are taken.
    pub fn make(&mut self, packet: impl FnOnce(u32) -> Vec<u8>) {
        if self.waiting.len() < BANKS {
            let packet = packet(self.made);
            let zeros = [0; 3];
            self.waiting.push_back([0].into_iter().chain(packet).chain(zeros).collect());
        } else {
            self.lost += 1;
        }
        self.made += 1;
    }

    /// Sends what there is until then, as long as the receiver takes it.
    pub fn send_until(&mut self, now_us: u64) {
        let end = now_us.min(self.until_us);
        let mut bytes = (end.saturating_sub(self.sent_us) * BYTES_PER_MICRO) as usize;
        if now_us >= self.until_us && self.sent_us < self.until_us {
            bytes += LATE;
        }
        self.sent_us = self.sent_us.max(now_us);
        while bytes > 0
            && let Some(packet) = self.waiting.front_mut()
        {
            let length = packet.len().min(bytes);
            self.fifo.extend(packet.drain(..length));
            bytes -= length;
            if packet.is_empty() {
                self.waiting.pop_front();
            }
        }
        let (words, rest) = self.fifo.as_chunks();
        for word in words {
            let place = self.written / 4 % WORDS;
            self.memory.words()[place].store(u32::from_le_bytes(*word), Ordering::Relaxed);
            self.written += 4;
        }
        self.fifo = rest.to_vec();
    }

    /// The firmware looks at the channel.
    pub fn look(&mut self, now_us: u64) {
        self.ring.came(self.written % (4 * WORDS));
        let Micros(grant) = self.ring.grant();
        self.until_us = now_us + grant;
    }
}
