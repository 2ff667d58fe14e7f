//! PSSI (RM0456, 42): eight lines that the FPGA fills while `ready`, a channel of TIM3, is high.
//!
//! Assumed: the FPGA sends a byte each three clocks of its 125 MHz while the line is high, and four more bytes after it has
//! fallen. Words go to the DMA as they are whole.

use super::Chip;
use super::map::{PSSI, TIM3};

/// Time of a byte: 42 bytes in a microsecond (`docs/log/gateware.md`, Parallel port).
const BYTE_PS: u64 = 24_000;
/// Bytes that come after `ready` has fallen.
const LATE: usize = 4;
/// The ring is looked at this often while bytes come.
const STEP_PS: u64 = 50_000_000;

#[derive(Debug, Default)]
pub struct Pssi {
    fifo: Vec<u8>,
    filled_ps: u64,
    was_ready: bool,
    pub bytes: u64,
}

/// Lines of the port, in the order of the board's README, with their alternate functions: ST's data sheet DS13086, table 27
/// (DCMI and PSSI share theirs; the last is TIM3's channel 1).
pub const FUNCTIONS: [u32; 11] = [10, 10, 10, 4, 10, 4, 10, 10, 10, 10, 2];

/// The name of such a line in the table of pins.
pub fn line(number: usize) -> String {
    format!("parallel_{number}")
}

impl Chip {
    fn receives(&self) -> bool {
        self.value(PSSI) >> 14 & 1 == 1
    }

    pub(super) fn pssi_due(&self) -> u64 {
        if self.receives() && self.fpga.runs() { self.pssi.filled_ps + STEP_PS } else { u64::MAX }
    }

    pub(super) fn write_pssi(&mut self, offset: u32, value: u32) {
        if offset == 0 && value >> 14 & 1 == 1 {
            self.fill_ring();
            let fields = [
                (value >> 5 & 1 == 1, "the rising edge of the clock"),
                (value >> 6 & 1 == 1, "DE active high"),
                (value >> 10 & 3 == 0, "eight lines"),
                (value >> 18 & 7 == 2, "DE alone"),
                (value >> 30 & 1 == 1, "DMA"),
                (value >> 31 == 0, "receiving"),
            ];
            for (_, what) in fields.into_iter().filter(|(is, _)| !is) {
                self.violation(format!("PSSI.CR {value:#010x}, expected {what}"));
            }
            self.pssi.filled_ps = self.now;
        }
        self.set(PSSI + offset, value);
    }

    /// What the FPGA has sent up to now goes into memory.
    pub(super) fn fill_ring(&mut self) {
        if !self.receives() {
            return;
        }
        let (ready, falls_ps) = self.timers[TIM3].output(self.pssi.filled_ps, self.clock_ps());
        let begins = self.pssi.filled_ps;
        self.pssi.filled_ps = self.now;
        if !ready && !self.pssi.was_ready {
            return;
        }
        let mut bytes =
            if ready { (self.now.min(falls_ps) - begins) / BYTE_PS } else { 0 } as usize;
        if ready && self.now < falls_ps {
            // What is left of the last byte's time is for the next look.
            self.pssi.filled_ps = begins + bytes as u64 * BYTE_PS;
            self.pssi.was_ready = true;
        } else {
            bytes += LATE;
            self.pssi.was_ready = false;
        }
        self.fpga.advance(self.now);
        let sent = self.fpga.parallel(bytes);
        if !sent.is_empty() {
            for number in 0..FUNCTIONS.len() {
                if !self.is_connected(&line(number)) {
                    self.violation(format!(
                        "line {number} of the parallel port has not its alternate function"
                    ));
                }
            }
        }
        self.pssi.bytes += sent.len() as u64;
        self.pssi.fifo.extend(sent);
        let waiting = std::mem::take(&mut self.pssi.fifo);
        let taken = self.dma_takes_parallel(&waiting);
        self.pssi.fifo = waiting[taken..].to_vec();
        if self.pssi.fifo.len() > 8 {
            self.violation("the PSSI's FIFO overflows: no channel takes its words".into());
            self.pssi.fifo.clear();
        }
    }
}
