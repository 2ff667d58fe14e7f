//! The ECP5's slave SPI port (Lattice FPGA-TN-02039): it keeps what it is told, and runs a bitstream that came in order.

use crate::chip::SpiDevice;

const IDCODE: u32 = nirspi_mcu::ecp5::IDCODE_LFE5UM5G_85F;
const DONE: u32 = 1 << 8;

/// The port.
#[derive(Debug, Default)]
pub struct Ecp5 {
    selected: bool,
    sent: Vec<u8>,
    commands: Vec<u8>,
    program_low: bool,
    runs: bool,
    bitstream: Vec<u8>,
}

impl SpiDevice for Ecp5 {
    fn exchange(&mut self, byte: u8) -> u8 {
        if !self.selected {
            return 0xFF;
        }
        // The answer begins behind four bytes.
        let at = self.sent.len();
        let answer = match (self.sent.first(), at.checked_sub(4)) {
            (Some(0xE0), Some(place @ 0..4)) => IDCODE.to_be_bytes()[place],
            (Some(0x3C), Some(place @ 0..4)) => {
                (if self.runs { DONE } else { 0 }).to_be_bytes()[place]
            }
            _ => 0,
        };
        self.sent.push(byte);
        answer
    }

    fn select(&mut self, selected: bool) {
        self.selected = selected;
        if selected || self.sent.is_empty() {
            return;
        }
        let sent = std::mem::take(&mut self.sent);
        let code = sent[0];
        let was = |code: u8| self.commands.contains(&code);
        if code == 0x7A && was(0xC6) && was(0x0E) && was(0x46) {
            self.bitstream = sent[4..].to_vec();
            self.runs = true;
        }
        if code != 0x3C {
            self.commands.push(code);
        }
    }

    fn program(&mut self, low: bool, _now_us: u64) {
        if low {
            self.runs = false;
            self.commands.clear();
        }
        self.program_low = low;
    }

    fn bitstream(&self) -> Vec<u8> {
        self.bitstream.clone()
    }

    fn done(&self) -> bool {
        self.runs && !self.program_low
    }
}
