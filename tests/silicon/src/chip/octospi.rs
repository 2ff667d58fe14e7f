//! OCTOSPI1 in indirect mode (RM0456, 28), with the FPGA's host port at its pins.
//!
//! Assumed: the kernel's clock is the core's; data come at two clocks a byte behind opcode, address and dummy cycles; a FIFO
//! of 32 bytes stops the clock when it is full. Not modelled: the hold time of chip select, delay blocks, DQS, the skew of
//! lines. Half a period of sample shift is required for packets and forbidden for slower accesses
//! (`docs/log/gateware.md`, Packets clocked by sck).

use super::Chip;
use super::map::{OCTOSPI1, OCTOSPIM};
use nirspi_wire::host_port::{
    DUMMY_CYCLES, PACKET_SCK_MAX_HZ, PACKET_SCK_MIN_HZ, QUAD, READ_PACKET, SCK_DIVIDER,
    WRITE_REGISTER,
};

/// Slowest clock of the FPGA's host port: its oscillator 15 % below nominal.
const HOST_CLOCK_MIN_HZ: f64 = 87.8e6;
const FIFO: usize = 32;

#[derive(Debug, Default)]
pub struct Octospi {
    complete: bool,
    transfer: Option<Transfer>,
    /// Transfers by opcode, for the report.
    pub counts: std::collections::BTreeMap<u32, u64>,
}

impl Octospi {
    /// After a reset; what was counted stays.
    pub fn restart(&mut self) {
        (self.complete, self.transfer) = (false, None);
    }
}

#[derive(Debug)]
struct Transfer {
    is_read: bool,
    bytes: Vec<u8>,
    /// How many have been read, or given.
    done: usize,
    length: usize,
    /// When the first byte begins, and how long each takes.
    begins_ps: u64,
    byte_ps: u64,
    /// A write that is whole ends then.
    ends_ps: u64,
}

impl Transfer {
    fn arrived(&self, now: u64) -> usize {
        let time = now.saturating_sub(self.begins_ps) / self.byte_ps;
        (time as usize).min(self.length).min(self.done + FIFO)
    }
}

const FMODE: u32 = 28;

impl Chip {
    fn ospi(&self, offset: u32) -> u32 {
        self.value(OCTOSPI1 + offset)
    }

    fn is_busy(&self) -> bool {
        self.octospi.transfer.as_ref().is_some_and(|transfer| {
            if transfer.is_read {
                transfer.done < transfer.length
            } else {
                transfer.done > 0 && self.now < transfer.ends_ps
            }
        })
    }

    pub(super) fn read_octospi(&mut self, offset: u32, bytes: u32) -> u32 {
        match offset {
            0x20 => self.octospi_status(),
            0x50 => {
                let now = self.now;
                let Some(transfer) =
                    self.octospi.transfer.as_mut().filter(|transfer| transfer.is_read)
                else {
                    self.violation("OCTOSPI1.DR read without a transfer".into());
                    return 0;
                };
                let (from, until) =
                    (transfer.done, (transfer.done + bytes as usize).min(transfer.length));
                if until > transfer.arrived(now) {
                    self.violation(format!("OCTOSPI1.DR read before its {bytes} bytes have come"));
                    return 0;
                }
                if transfer.arrived(now) == from + FIFO && from + FIFO < transfer.length {
                    // The clock stood still until now.
                    transfer.begins_ps = now - (from + FIFO) as u64 * transfer.byte_ps;
                }
                let word = transfer.bytes[from..until]
                    .iter()
                    .rev()
                    .fold(0, |word, byte| word << 8 | u32::from(*byte));
                transfer.done = until;
                if until == transfer.length {
                    self.octospi.complete = true;
                }
                word
            }
            _ => self.ospi(offset),
        }
    }

    fn octospi_status(&mut self) -> u32 {
        let now = self.now;
        let threshold = (self.ospi(0) >> 8 & 31) as usize;
        let mut status = 0;
        match &self.octospi.transfer {
            Some(transfer) if transfer.is_read => {
                let arrived = transfer.arrived(now);
                let level = arrived - transfer.done;
                if arrived == transfer.length {
                    self.octospi.complete = true;
                }
                status |= (level as u32) << 8;
                if level > threshold || arrived == transfer.length && level > 0 {
                    status |= 1 << 2;
                }
            }
            Some(transfer) if transfer.done == transfer.length && now >= transfer.ends_ps => {
                self.octospi.complete = true;
            }
            _ => status |= 1 << 2,
        }
        if self.is_busy() {
            status |= 1 << 5;
        }
        status | u32::from(self.octospi.complete) << 1
    }

    pub(super) fn write_octospi(&mut self, offset: u32, bytes: u32, value: u32) {
        let sets_transfer = matches!(offset, 0x0C | 0x40 | 0x48 | 0x100 | 0x108 | 0x110);
        if sets_transfer && self.is_busy() {
            self.violation(format!("OCTOSPI1+{offset:#x} written while busy"));
        }
        match offset {
            0x24 => {
                if value & 2 != 0 {
                    self.octospi.complete = false;
                }
            }
            0x48 => {
                self.set(OCTOSPI1 + 0x48, value);
                self.octospi_begins();
            }
            0x50 => self.octospi_gives(bytes, value),
            _ => {
                self.set(OCTOSPI1 + offset, value);
                self.start_dma();
            }
        }
    }

    /// The clock of an access, in Hz.
    fn sck_hz(&self) -> f64 {
        self.core_hz() / f64::from((self.ospi(0x0C) & 0xFF) + 1)
    }

    /// Whether the FPGA would understand this access. Says why not.
    fn check_access(&mut self, opcode: u32) -> bool {
        let (ccr, tcr, sck) = (self.ospi(0x100), self.ospi(0x108), self.sck_hz());
        let base = opcode as u8 & !QUAD;
        let is_packet = opcode as u8 == READ_PACKET | QUAD;
        let mut wrong = Vec::new();
        let mut law = |right: bool, what: String| {
            if !right {
                wrong.push(what);
            }
        };
        law(opcode as u8 & QUAD != 0, "opcode without four lines".into());
        law(
            ccr & 0x3F == 1,
            format!("opcode phase {:#x}, expected 8 bits by one line", ccr & 0x3F),
        );
        law(
            ccr >> 8 & 0x3F == 0x13,
            format!("address phase {:#x}, expected 16 bits by four lines", ccr >> 8 & 0x3F),
        );
        law(ccr >> 24 & 15 == 3, format!("data phase {:#x}, expected four lines", ccr >> 24 & 15));
        law(ccr >> 16 & 7 == 0, "alternate bytes".into());
        law(ccr >> 31 == 0, "the opcode is sent only once".into());
        let dummy = if base == WRITE_REGISTER { 0 } else { u32::from(DUMMY_CYCLES) };
        law(tcr & 31 == dummy, format!("{} dummy cycles, expected {dummy}", tcr & 31));
        if is_packet {
            let (least, most) = (f64::from(PACKET_SCK_MIN_HZ), f64::from(PACKET_SCK_MAX_HZ));
            law((least..=most).contains(&sck), format!("a packet at {:.2} MHz", sck / 1e6));
            law(tcr >> 30 & 1 == 1, "a packet without half a period of sample shift".into());
        } else {
            let most = HOST_CLOCK_MIN_HZ / f64::from(SCK_DIVIDER);
            law(sck <= most, format!("sck of {:.2} MHz, at most {:.2}", sck / 1e6, most / 1e6));
            law(tcr >> 30 & 1 == 0, "sample shift at a slow clock".into());
        }
        for pin in ["fpga_sck", "fpga_cs_n", "fpga_io0", "fpga_io1", "fpga_io2", "fpga_io3"] {
            let connected = self.is_connected(pin);
            law(connected, format!("{pin} has not its alternate function"));
        }
        let manager = self.value(OCTOSPIM + 4);
        // Clock, chip select and the low four lines of port 1 from OCTOSPI1.
        law(
            manager & 0x0006_0303 == 0x0000_0101 && manager >> 16 & 1 == 1,
            format!("OCTOSPIM.P1CR {manager:#x}"),
        );
        let right = wrong.is_empty();
        for what in wrong {
            self.violation(format!("OCTOSPI1, opcode {opcode:#04x}: {what}"));
        }
        right
    }

    /// The address is written: a read begins.
    fn octospi_begins(&mut self) {
        let cr = self.ospi(0);
        if cr & 1 == 0 {
            self.violation("OCTOSPI1.AR written while the peripheral is off".into());
            return;
        }
        let (opcode, address, length) =
            (self.ospi(0x110) & 0xFF, self.ospi(0x48), self.ospi(0x40) as usize + 1);
        self.octospi.complete = false;
        let is_read = match cr >> FMODE & 3 {
            0 => false,
            1 => true,
            mode => {
                self.violation(format!("OCTOSPI1 in mode {mode}"));
                return;
            }
        };
        let sck_ps = (1e12 / self.sck_hz()) as u64;
        let mut transfer = Transfer {
            is_read,
            bytes: Vec::new(),
            done: 0,
            length,
            begins_ps: self.now,
            byte_ps: 2 * sck_ps,
            ends_ps: u64::MAX,
        };
        if is_read {
            *self.octospi.counts.entry(opcode).or_default() += 1;
            let dummy = u64::from(self.ospi(0x108) & 31);
            transfer.begins_ps += (8 + 4 + dummy) * sck_ps;
            transfer.bytes = if self.check_access(opcode) {
                self.fpga_reads(opcode as u8, address as u16, length)
            } else {
                vec![0xFF; length]
            };
        }
        self.octospi.transfer = Some(transfer);
        self.start_dma();
    }

    fn octospi_gives(&mut self, bytes: u32, value: u32) {
        let sck_ps = (1e12 / self.sck_hz()) as u64;
        let now = self.now;
        let Some(transfer) = self.octospi.transfer.as_mut().filter(|transfer| !transfer.is_read)
        else {
            self.violation("OCTOSPI1.DR written without a transfer".into());
            return;
        };
        transfer.bytes.extend(&value.to_le_bytes()[..bytes as usize]);
        transfer.done = transfer.bytes.len();
        if transfer.done < transfer.length {
            return;
        }
        transfer.ends_ps = now + (8 + 4 + 2 * transfer.length as u64) * sck_ps;
        let bytes = transfer.bytes.clone();
        let (opcode, address) = (self.ospi(0x110) & 0xFF, self.ospi(0x48));
        *self.octospi.counts.entry(opcode).or_default() += 1;
        if self.check_access(opcode) {
            self.fpga_writes(opcode as u8, address as u16, &bytes);
        }
    }

    /// For the DMA: when the bytes of a read have all come, if one is under way that asks for the DMA.
    pub(super) fn octospi_offers(&self) -> Option<(u64, usize)> {
        let transfer = self.octospi.transfer.as_ref()?;
        let offers = self.ospi(0) >> 2 & 1 == 1 && transfer.is_read && transfer.done == 0;
        offers.then(|| {
            (transfer.begins_ps + transfer.length as u64 * transfer.byte_ps, transfer.length)
        })
    }

    /// The DMA takes all bytes.
    pub(super) fn octospi_taken(&mut self) -> Vec<u8> {
        self.octospi.complete = true;
        let Some(transfer) = &mut self.octospi.transfer else { return Vec::new() };
        transfer.done = transfer.length;
        std::mem::take(&mut transfer.bytes)
    }
}
