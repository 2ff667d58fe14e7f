//! GPDMA1 (RM0456, 17): single transfers from OCTOSPI1, and the list that the PSSI fills a ring by.
//!
//! Assumed: a beat (a read of the peripheral, a write to memory) takes [`BEAT_CLOCKS`] clocks of the bus. A transfer that
//! nobody looks at while it runs ends as a whole. Not modelled: arbitration between channels, contention for the bus.

use super::Chip;
use super::map::{GPDMA1, OCTOSPI1, PSSI};

/// Clocks of the bus that one beat takes: an estimate (`../shared/review/hardware.md`, 2.5, has 7 to 10).
pub const BEAT_CLOCKS: u64 = 8;

pub const CHANNELS: usize = 16;
const OCTOSPI1_REQUEST: u32 = 40;
const PSSI_REQUEST: u32 = 86;

/// Memory that DMA may reach: SRAM1, 2, 3 and 5.
const RAM: std::ops::Range<u32> = 0x2000_0000..0x2027_0000;

#[derive(Debug, Clone, Copy)]
pub struct Channel {
    pub status: u32,
    /// When the transfer under way ends.
    pub due_ps: u64,
}

impl Default for Channel {
    fn default() -> Self {
        // Idle.
        Self { status: 1, due_ps: u64::MAX }
    }
}

const CFCR: u32 = 0x0C;
const CSR: u32 = 0x10;
const CCR: u32 = 0x14;
const CTR1: u32 = 0x40;
const CTR2: u32 = 0x44;
const CBR1: u32 = 0x48;
const CSAR: u32 = 0x4C;
const CDAR: u32 = 0x50;
const CLLR: u32 = 0x7C;

const EN: u32 = 1;
const COMPLETE: u32 = 1 << 8;
const USER_ERROR: u32 = 1 << 12;
const SUSPENDED: u32 = 1 << 13;

fn at(channel: usize, offset: u32) -> u32 {
    GPDMA1 + 0x50 + 0x80 * channel as u32 + offset
}

impl Chip {
    fn dma(&self, channel: usize, offset: u32) -> u32 {
        self.value(at(channel, offset))
    }

    pub(super) fn read_dma(&mut self, channel: usize, offset: u32) -> u32 {
        match offset {
            CSR => self.channels[channel].status,
            CFCR => 0,
            _ => self.dma(channel, offset),
        }
    }

    pub(super) fn write_dma(&mut self, channel: usize, offset: u32, value: u32) {
        let enabled = self.dma(channel, CCR) & EN != 0;
        match offset {
            CFCR => self.channels[channel].status &= !(value & 0x7F00),
            CCR if value & 2 != 0 => {
                self.channels[channel] = Channel::default();
                self.set(at(channel, CCR), 0);
            }
            CCR if value & 4 != 0 => {
                self.channels[channel].status |= 1 | SUSPENDED;
                self.channels[channel].due_ps = u64::MAX;
                self.set(at(channel, CCR), value & !EN);
            }
            CCR => {
                self.set(at(channel, CCR), value);
                if value & EN != 0 && !enabled {
                    self.channels[channel].status &= !1;
                    self.check_channel(channel);
                    self.start_dma();
                }
            }
            CSR => self.violation(format!("GPDMA1.C{channel}.CSR written")),
            _ => {
                if enabled {
                    self.violation(format!("GPDMA1.C{channel}+{offset:#x} written while enabled"));
                }
                self.set(at(channel, offset), value);
            }
        }
    }

    /// The rules for a channel that is enabled.
    fn check_channel(&mut self, channel: usize) {
        let (transfer, request) = (self.dma(channel, CTR1), self.dma(channel, CTR2));
        let (source, destination) = (self.dma(channel, CSAR), self.dma(channel, CDAR));
        let bytes = self.dma(channel, CBR1) & 0xFFFF;
        let (from, to) = (1 << (transfer & 3), 1 << (transfer >> 16 & 3));
        let mut wrong = Vec::new();
        let mut law = |right: bool, what: String| {
            if !right {
                wrong.push(what);
            }
        };
        let expected = match source {
            _ if source == OCTOSPI1 + 0x50 => Some(OCTOSPI1_REQUEST),
            _ if source == PSSI + 0x28 => Some(PSSI_REQUEST),
            _ => None,
        };
        if let Some(expected) = expected {
            law(
                request & 0x7F == expected,
                format!("request {}, expected {expected}", request & 0x7F),
            );
            law(
                request >> 9 & 3 == 0,
                format!("software or destination request, TR2 {request:#x}"),
            );
            law(transfer & 1 << 3 == 0, "the address of the peripheral counts up".into());
            law(transfer >> 19 & 1 == 1, "the address of the memory does not count up".into());
            law(
                RAM.contains(&destination) && RAM.contains(&(destination + bytes - 1)),
                format!("memory at {destination:#x}"),
            );
            law(
                destination % to == 0 && bytes.is_multiple_of(to),
                format!("{bytes} bytes at {destination:#x} in units of {to}"),
            );
            law(
                bytes.is_multiple_of(from) && bytes > 0,
                format!("{bytes} bytes in units of {from}"),
            );
            // Two channels with streams of their own would wait for each other at the same priority.
            law(self.dma(channel, CCR) >> 22 & 3 == 3, "not at the highest priority".into());
        }
        let alignment =
            !(destination % to == 0 && bytes.is_multiple_of(to) && bytes.is_multiple_of(from));
        if expected.is_some() && alignment {
            self.channels[channel].status |= USER_ERROR | 1;
            self.set(at(channel, CCR), self.dma(channel, CCR) & !EN);
        }
        for what in wrong {
            self.violation(format!("GPDMA1 channel {channel}: {what}"));
        }
    }

    /// Begins what source and channel are both ready for.
    pub(super) fn start_dma(&mut self) {
        let Some((arrived_ps, length)) = self.octospi_offers() else { return };
        let waiting = (0..CHANNELS).find(|&channel| {
            self.dma(channel, CCR) & EN != 0
                && self.channels[channel].due_ps == u64::MAX
                && self.dma(channel, CTR2) & 0x7F == OCTOSPI1_REQUEST
                && self.dma(channel, CSAR) == OCTOSPI1 + 0x50
        });
        let Some(channel) = waiting else { return };
        let bytes = (self.dma(channel, CBR1) & 0xFFFF) as usize;
        if bytes != length {
            self.violation(format!(
                "GPDMA1 channel {channel}: {bytes} bytes, OCTOSPI1 has {length}"
            ));
        }
        let width = 1usize << (self.dma(channel, CTR1) & 3);
        let beats_ps =
            ((length / width) as f64 * BEAT_CLOCKS as f64 * 1e12 / self.core_hz()) as u64;
        self.channels[channel].due_ps = arrived_ps.max(self.now + beats_ps);
    }

    pub(super) fn dma_due(&self) -> u64 {
        self.channels.iter().map(|channel| channel.due_ps).min().unwrap_or(u64::MAX)
    }

    /// Ends the transfers that are due.
    pub(super) fn end_dma(&mut self) {
        for channel in 0..CHANNELS {
            if self.channels[channel].due_ps > self.now {
                continue;
            }
            self.channels[channel].due_ps = u64::MAX;
            let bytes = self.octospi_taken();
            let taken = (self.dma(channel, CBR1) & 0xFFFF) as usize;
            let destination = self.dma(channel, CDAR);
            if !self.memory.put(destination, &bytes[..taken.min(bytes.len())]) {
                self.violation(format!("GPDMA1 channel {channel}: no memory at {destination:#x}"));
            }
            self.set(at(channel, CBR1), 0);
            self.set(at(channel, CCR), self.dma(channel, CCR) & !EN);
            self.channels[channel].status |= 1 | COMPLETE;
        }
    }

    /// Whether a channel asks for its interrupt.
    pub(super) fn dma_interrupt(&self, channel: usize) -> bool {
        self.channels[channel].status & self.dma(channel, CCR) & 0x7F00 != 0
    }

    /// The PSSI has words for the DMA. Returns how many bytes a channel took.
    pub(super) fn dma_takes_parallel(&mut self, bytes: &[u8]) -> usize {
        let found = (0..CHANNELS).find(|&channel| {
            self.dma(channel, CCR) & EN != 0
                && self.dma(channel, CTR2) & 0x7F == PSSI_REQUEST
                && self.dma(channel, CSAR) == PSSI + 0x28
        });
        let Some(channel) = found else { return 0 };
        let mut rest = bytes;
        while rest.len() >= 4 && self.dma(channel, CCR) & EN != 0 {
            let left = (self.dma(channel, CBR1) & 0xFFFF) as usize;
            let length = (rest.len() & !3).min(left);
            let destination = self.dma(channel, CDAR);
            let (now, later) = rest.split_at(length);
            if !RAM.contains(&destination) || !self.memory.put(destination, now) {
                self.violation(format!("GPDMA1 channel {channel}: no memory at {destination:#x}"));
                return bytes.len() - rest.len();
            }
            rest = later;
            self.set(at(channel, CDAR), destination + length as u32);
            let block = self.dma(channel, CBR1);
            self.set(at(channel, CBR1), block & !0xFFFF | (left - length) as u32);
            if left == length {
                self.next_item(channel);
            }
        }
        bytes.len() - rest.len()
    }

    /// Loads the next item of a channel's list (RM0456, 17.4.8: the registers in the order BR1, TR..., as `CLLR` chooses).
    fn next_item(&mut self, channel: usize) {
        let link = self.dma(channel, CLLR);
        if link == 0 {
            self.set(at(channel, CCR), self.dma(channel, CCR) & !EN);
            self.channels[channel].status |= 1 | COMPLETE;
            return;
        }
        let mut address = self.dma(channel, 0) & 0xFFFF_0000 | link & 0xFFFC;
        let order = [
            (31, CTR1),
            (30, CTR2),
            (29, CBR1),
            (28, CSAR),
            (27, CDAR),
            (26, 0x54),
            (25, 0x58),
            (16, CLLR),
        ];
        for (bit, register) in order {
            if link >> bit & 1 == 1 {
                if !RAM.contains(&address) {
                    self.violation(format!(
                        "GPDMA1 channel {channel}: an item of its list at {address:#x}"
                    ));
                    return;
                }
                let word = self.memory.word(address);
                self.set(at(channel, register), word);
                address += 4;
            }
        }
        let (bytes, destination) = (self.dma(channel, CBR1) & 0xFFFF, self.dma(channel, CDAR));
        if bytes == 0 || !RAM.contains(&destination) {
            self.violation(format!(
                "GPDMA1 channel {channel}: its list leads to {bytes} bytes at {destination:#x}"
            ));
            self.set(at(channel, CCR), self.dma(channel, CCR) & !EN);
        }
    }
}
