//! The simulated core's DMA: with `GAHBCFG.DMAEN` all endpoints go by it.
//!
//! What the simulation keeps, from ST RM0456 (OTG_HS: DMA mode, `DIEPTSIZ`, `DOEPCTL0`, "OUT endpoint disable"), and from
//! what the drivers of TinyUSB and Zephyr say of cores from version 3.00a on:
//!
//! - To the host: from `EPENA` on the core reads packet after packet at `DIEPDMA`, at times of its own, as far as the
//!   FIFO has room. `XFRSIZ` falls when a packet is in the FIFO, `PKTCNT` when the host has it. `EPENA` falls with the
//!   last packet, or when the endpoint was told `EPDIS`.
//! - From the host: what has come waits in the receive FIFO, in order, until the core has written it to memory. A request
//!   that finds the control endpoint without `EPENA` holds up all that comes after it.
//! - A request is written to where `DOEPDMA0` points, and may follow another one there. `EPENA` falls before its end is
//!   reported, as `STUP`, `XFRC` and `STPKTRX`. Data of the control endpoint are taken after `CNAK` only.
//! - After the status stage of a request for data, `STSPHSRX` stands, and no other request is reported before it is
//!   cleared.
//! - Addresses are multiples of four, `PKTCNT` fits `XFRSIZ`, and FIFOs leave out the end of their memory.
//! - An OUT endpoint is disabled only while all OUT endpoints are set to NAK, and the OUT side of the control endpoint
//!   never. A FIFO is emptied when the DMA rests.

use super::*;

const DMAEN: u32 = 1 << 5;
const AHBIDL: u32 = 1 << 31;
const SGONAK: u32 = 1 << 9;
const CGONAK: u32 = 1 << 10;
/// `GINTSTS.BOUTNAKEFF`.
pub const GLOBAL_OUT_NAK: u32 = 1 << 7;
const STSPHSRX: u32 = 1 << 5;
const STPKTRX: u32 = 1 << 15;
/// What the receive FIFO says where all OUT endpoints begin to answer NAK.
const GLOBAL_NAK: u32 = 1;

/// Words of the FIFO memory without those in which the DMA keeps its addresses, on an STM32U5A5 (`GHWCFG3`).
const FIFO_WORDS: u32 = 952;

#[derive(Default)]
pub struct Engine {
    /// The request under way asks for data.
    pub is_control_read: bool,
    /// All OUT endpoints answer NAK; the second: the core has said so.
    is_nak: bool,
    pub is_nak_effective: bool,
    /// Reads of registers until the DMA rests.
    busy: u32,
}

impl OtgCore {
    /// Whether the driver has chosen DMA.
    pub fn uses_dma(&self) -> bool {
        self.plain(GAHBCFG) & DMAEN != 0
    }

    pub(super) fn idle(&self) -> u32 {
        if self.engine.busy == 0 { AHBIDL } else { 0 }
    }

    pub(super) fn check_flush(&mut self) {
        if self.engine.busy > 0 {
            self.violation("a FIFO is emptied while the DMA works".into());
        }
    }

    pub(super) fn set_address(&mut self, is_in: bool, index: usize, value: u32) {
        let side = if is_in { &mut self.ins[index] } else { &mut self.outs[index] };
        side.address = value;
        if side.is(EPENA) {
            self.violation(format!("the address of endpoint {index} is written while armed"));
        }
    }

    pub(super) fn check_disable(&mut self, is_in: bool, index: usize, value: u32) {
        if !self.uses_dma() || value & EPDIS == 0 {
            return;
        }
        if is_in {
            // A word may be on its way.
            self.engine.busy = 2 * DELAY_READS;
        } else if index == 0 || !self.engine.is_nak_effective {
            self.violation(format!("OUT endpoint {index} is disabled while packets may come"));
        }
    }

    pub(super) fn control_device(&mut self, value: u32) {
        if value & SGONAK != 0 && !self.engine.is_nak {
            self.engine.is_nak = true;
            self.receive(GLOBAL_NAK, 0, &[]);
        }
        if value & CGONAK != 0 {
            (self.engine.is_nak, self.engine.is_nak_effective) = (false, false);
        }
        self.plain.insert(DCTL, value & !(SGONAK | CGONAK));
    }

    /// Whether an OUT endpoint takes a packet. Without DMA its `EPENA` does not matter.
    pub(super) fn engine_takes(&self, index: usize) -> bool {
        !self.uses_dma() || self.outs[index].is(EPENA) && !self.engine.is_nak
    }

    /// A transfer begins.
    pub(super) fn engine_begins(&mut self, is_in: bool, index: usize) {
        if !self.uses_dma() {
            return;
        }
        let register = if index == 0 { DIEPTXF0 } else { DIEPTXF1 + 4 * (index - 1) };
        let fifo = self.plain(register);
        let side = if is_in { &mut self.ins[index] } else { &mut self.outs[index] };
        let packet = packet_bytes(index, side.ctl).max(1);
        let mut wrong = Vec::new();
        if side.address % 4 != 0 && side.bytes() > 0 {
            wrong.push(format!("memory at {:#x}", side.address));
        }
        let packets = side.bytes().div_ceil(packet).max(1) as u32;
        if side.packets() != packets {
            wrong.push(format!("{} packets for {} bytes", side.packets(), side.bytes()));
        }
        if is_in {
            side.to_load = packets;
            if !side.fifo.is_empty() || !side.lengths.is_empty() {
                wrong.push("with an old packet in the FIFO".into());
            }
            if (fifo & 0xFFFF) + (fifo >> 16) > FIFO_WORDS {
                wrong.push("with a FIFO where the DMA keeps its addresses".into());
            }
        } else if side.bytes() % packet != 0 {
            wrong.push(format!("room for {} bytes", side.bytes()));
        } else if index == 0 && side.size >> 29 & 3 == 0 {
            wrong.push("without room for a request".into());
        }
        for what in wrong {
            self.violation(format!("endpoint {index} (to the host: {is_in}) armed: {what}"));
        }
    }

    /// What the DMA does in a moment: a packet from memory for each endpoint, and all that it can to memory.
    pub(super) fn engine_moves(&mut self) {
        self.engine.busy = self.engine.busy.saturating_sub(1);
        if !self.uses_dma() {
            return;
        }
        for index in 0..ENDPOINTS {
            self.load(index);
        }
        while self.unload() {}
    }

    /// Reads a packet out of memory.
    fn load(&mut self, index: usize) {
        let room = self.fifo_words(index).saturating_sub(self.ins[index].fifo.len());
        let side = &mut self.ins[index];
        let bytes = side.bytes().min(packet_bytes(index, side.ctl));
        if !side.is(EPENA) || side.to_load == 0 || room < bytes.div_ceil(4) {
            return;
        }
        let address = side.address;
        let read = if bytes == 0 { Some(Vec::new()) } else { self.memory.fetch(address, bytes) };
        let packet = read.unwrap_or_else(|| {
            self.violation(format!(
                "{bytes} bytes read at {address:#x}, which the driver has not lent"
            ));
            vec![0; bytes]
        });
        let side = &mut self.ins[index];
        side.fifo.extend(words(&packet));
        side.lengths.push_back(bytes);
        side.address += bytes as u32;
        side.size -= bytes as u32;
        side.to_load -= 1;
    }

    /// Writes what waits longest to memory. Returns whether that went.
    fn unload(&mut self) -> bool {
        let Some((status, words)) = self.received.front() else { return false };
        let (kind, index, length) =
            (status >> 17 & 15, (status & 15) as usize, status >> 4 & 0x7FF);
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_ne_bytes()).collect();
        let out = &mut self.outs[index];
        match kind {
            GLOBAL_NAK => self.engine.is_nak_effective = self.engine.is_nak,
            SETUP_DATA_DONE if out.int & STSPHSRX != 0 => return false,
            SETUP_DATA_DONE => {
                out.ctl &= !EPENA;
                out.int |= STUP | XFRC;
            }
            _ if !out.is(EPENA) => return false,
            OUT_DATA_DONE => {
                out.ctl = out.ctl & !EPENA | NAKSTS;
                out.int |= XFRC;
                if index == 0 && self.engine.is_control_read {
                    out.int |= STSPHSRX;
                }
            }
            _ => {
                let address = out.address;
                out.address += length;
                if kind == SETUP_DATA_RX {
                    out.int |= STPKTRX;
                    out.size = out.size.saturating_sub(1 << 29);
                } else {
                    out.size -= 1 << 19 | length;
                }
                if length > 0 && !self.memory.store(address, &bytes[..length as usize]) {
                    self.violation(format!(
                        "{length} bytes written at {address:#x}, which was not lent"
                    ));
                }
            }
        }
        self.received.pop_front();
        true
    }
}
