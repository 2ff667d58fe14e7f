//! A simulated OTG core: the registers as the chip's driver finds them, and the bus as a host does.
//!
//! What of the core the simulation keeps (ST RM0456, OTG_HS; Synopsys' databook as Linux' dwc2,
//! Zephyr's udc_dwc2 and TinyUSB state it):
//!
//! - `EPENA` is set by software and cleared only by the core: at the end of a transfer, or when an
//!   endpoint that was told `EPDIS` is disabled. A written 0 does not clear `EPENA`.
//! - A reset of the bus clears `USBAEP` of all endpoints but the first, and leaves `EPENA`, the
//!   FIFOs and the device's address as they are.
//! - An endpoint that is armed answers NAK while its FIFO does not hold the whole packet.
//! - `EPDISD`, `INEPNE` and the flush bits change some reads after the request.
//! - `GRXSTSP` and the receive FIFO are emptied by reading, `GINTSTS` and `DxEPINT` are cleared by
//!   writing 1, `RXFLVL`, `IEPINT`, `OEPINT` and `TXFE` are levels.
//! - SETUP is always received, ends a halt of the control endpoint and sets NAK.
//!
//! An OUT endpoint takes a packet when it is active and not set to NAK, whatever its `EPENA`: the
//! driver arms only with `CNAK` after the first packet, and works so on silicon.
//!
//! With `GAHBCFG.DMAEN` the core reads and writes memory itself: [`engine`].
//!
//! What a driver must not do is kept in [`OtgCore::violations`].
//!
//! Two users: the tests of `boards/usb`, where the driver runs on the host, and `tests/silicon`, where the released ELF
//! runs on a model of its chip.

mod engine;

use engine::{Engine, GLOBAL_OUT_NAK};
use std::collections::{BTreeMap, VecDeque};

/// Endpoints each way.
pub const ENDPOINTS: usize = 9;

/// The memory that the core's DMA reads and writes.
pub trait Memory {
    /// The bytes at this address. `None`: the core must not read there.
    fn fetch(&mut self, address: u32, bytes: usize) -> Option<Vec<u8>>;

    /// Writes bytes. False: the core must not write there.
    fn store(&mut self, address: u32, bytes: &[u8]) -> bool;
}

/// No memory.
struct Nothing;

impl Memory for Nothing {
    fn fetch(&mut self, _address: u32, _bytes: usize) -> Option<Vec<u8>> {
        None
    }

    fn store(&mut self, _address: u32, _bytes: &[u8]) -> bool {
        false
    }
}

const MPSIZ: u32 = 0x7FF;
const USBAEP: u32 = 1 << 15;
const DPID: u32 = 1 << 16;
const NAKSTS: u32 = 1 << 17;
const EPTYP: u32 = 3 << 18;
const STALL: u32 = 1 << 21;
const TXFNUM: u32 = 15 << 22;
const CNAK: u32 = 1 << 26;
const SNAK: u32 = 1 << 27;
const SD0PID: u32 = 1 << 28;
const SD1PID: u32 = 1 << 29;
const EPDIS: u32 = 1 << 30;
const EPENA: u32 = 1 << 31;

const XFRC: u32 = 1 << 0;
const EPDISD: u32 = 1 << 1;
const STUP: u32 = 1 << 3;
const INEPNE: u32 = 1 << 6;
const TXFE: u32 = 1 << 7;

const RXFLVL: u32 = 1 << 4;
const USBSUSP: u32 = 1 << 11;
const USBRST: u32 = 1 << 12;
const ENUMDNE: u32 = 1 << 13;
const IEPINT: u32 = 1 << 18;
const OEPINT: u32 = 1 << 19;
const WKUPINT: u32 = 1 << 31;

const OUT_DATA_RX: u32 = 2;
const OUT_DATA_DONE: u32 = 3;
const SETUP_DATA_DONE: u32 = 4;
const SETUP_DATA_RX: u32 = 6;

/// Reads of registers until the core has done what it was told.
const DELAY_READS: u32 = 3;

/// The speed that host and core agree on (`DSTS.ENUMSPD`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Speed {
    /// 480 Mbit/s.
    High = 0,
    /// 12 Mbit/s.
    Full = 1,
}

/// What a host gets for a token.
#[derive(Debug, PartialEq)]
pub enum Answer {
    /// Data with its toggle; the acknowledgement for data from the host.
    Data(Vec<u8>, u8),
    /// Not now.
    Nak,
    /// Never, until the halt is cleared.
    Stall,
    /// Nothing: no such device or endpoint.
    Silence,
}

#[derive(Default)]
struct Side {
    ctl: u32,
    int: u32,
    size: u32,
    /// Words that wait to be sent.
    fifo: VecDeque<u32>,
    nak_in: u32,
    disabled_in: u32,
    /// `DIEPDMA`, `DOEPDMA`.
    address: u32,
    /// Lengths of the packets that the DMA has put into the FIFO, and how many are left to put there.
    lengths: VecDeque<usize>,
    to_load: u32,
}

impl Side {
    fn bytes(&self) -> usize {
        (self.size & 0x7FFFF) as usize
    }

    fn packets(&self) -> u32 {
        self.size >> 19 & 0x3FF
    }

    fn take(&mut self, bytes: usize) {
        let left = (self.bytes() - bytes) as u32;
        self.size = self.size & !0x1FFF_FFFF | (self.packets() - 1) << 19 | left;
    }

    fn is(&self, bits: u32) -> bool {
        self.ctl & bits != 0
    }

    /// Length of the next packet to the host, if that is known.
    fn next_length(&self, endpoint: usize, uses_dma: bool) -> Option<usize> {
        if uses_dma {
            self.lengths.front().copied()
        } else {
            Some(self.bytes().min(packet_bytes(endpoint, self.ctl)))
        }
    }
}

/// The core.
pub struct OtgCore {
    /// What the driver did that it must not do.
    pub violations: Vec<String>,
    memory: Box<dyn Memory>,
    speed: u32,
    latched: u32,
    flushing: Option<(u32, u32)>,
    ins: [Side; ENDPOINTS],
    outs: [Side; ENDPOINTS],
    /// Status words, each with the words of its packet.
    received: VecDeque<(u32, Vec<u32>)>,
    reading: VecDeque<u32>,
    plain: BTreeMap<usize, u32>,
    engine: Engine,
}

const GAHBCFG: usize = 0x08;
const GRSTCTL: usize = 0x10;
const GINTSTS: usize = 0x14;
const GINTMSK: usize = 0x18;
const GRXSTSP: usize = 0x20;
const GRXFSIZ: usize = 0x24;
const DIEPTXF0: usize = 0x28;
const DIEPTXF1: usize = 0x104;
const DCFG: usize = 0x800;
const DCTL: usize = 0x804;
const DSTS: usize = 0x808;
const DIEPMSK: usize = 0x810;
const DOEPMSK: usize = 0x814;
const DAINT: usize = 0x818;
const DAINTMSK: usize = 0x81C;
const DIEPEMPMSK: usize = 0x834;
const IN: usize = 0x900;
const OUT: usize = 0xB00;
const FIFOS: usize = 0x1000;

impl Default for OtgCore {
    fn default() -> Self {
        Self::new(Nothing)
    }
}

impl OtgCore {
    /// A core after its reset, in front of this memory.
    #[must_use]
    pub fn new(memory: impl Memory + 'static) -> Self {
        Self {
            violations: Vec::new(),
            memory: Box::new(memory),
            speed: 0,
            latched: 0,
            flushing: None,
            ins: Default::default(),
            outs: Default::default(),
            received: VecDeque::new(),
            reading: VecDeque::new(),
            plain: BTreeMap::new(),
            engine: Engine::default(),
        }
    }

    fn plain(&self, offset: usize) -> u32 {
        self.plain.get(&offset).copied().unwrap_or(0)
    }

    fn violation(&mut self, what: String) {
        self.violations.push(what);
    }

    /// What was told to the core some reads ago happens.
    fn tick(&mut self) {
        self.engine_moves();
        let due = |count: &mut u32| {
            let was = *count;
            *count = was.saturating_sub(1);
            was == 1
        };
        let mut flushed = None;
        if let Some((bits, count)) = &mut self.flushing
            && due(count)
        {
            flushed = Some(*bits);
        }
        if let Some(bits) = flushed {
            self.flushing = None;
            let number = bits >> 6 & 0x1F;
            for (index, side) in self.ins.iter_mut().enumerate() {
                if bits & 1 << 5 != 0 && (number == 0x10 || number as usize == index) {
                    side.fifo.clear();
                    side.lengths.clear();
                }
            }
            if bits & 1 << 4 != 0 {
                self.received.clear();
                self.reading.clear();
            }
        }
        for side in self.ins.iter_mut().chain(&mut self.outs) {
            if due(&mut side.nak_in) {
                side.int |= INEPNE;
            }
            if due(&mut side.disabled_in) && side.is(EPENA) {
                side.ctl &= !(EPENA | EPDIS);
                side.int |= EPDISD;
                side.to_load = 0;
            }
        }
    }

    fn fifo_words(&self, index: usize) -> usize {
        let register = if index == 0 { DIEPTXF0 } else { DIEPTXF1 + 4 * (index - 1) };
        (self.plain(register) >> 16) as usize
    }

    fn in_interrupts(&self) -> u32 {
        let due = self.ins.iter().enumerate().map(|(index, side)| {
            let empty = side.fifo.is_empty() && self.plain(DIEPEMPMSK) >> index & 1 != 0;
            u32::from(side.int & self.plain(DIEPMSK) != 0 || empty) << index
        });
        due.sum::<u32>() & self.plain(DAINTMSK)
    }

    fn out_interrupts(&self) -> u32 {
        let due =
            self.outs.iter().enumerate().map(|(index, side)| {
                u32::from(side.int & self.plain(DOEPMSK) != 0) << (index + 16)
            });
        due.sum::<u32>() & self.plain(DAINTMSK)
    }

    fn interrupts(&self) -> u32 {
        let level = |bit: u32, is: bool| if is { bit } else { 0 };
        self.latched
            | level(RXFLVL, !self.received.is_empty() && !self.uses_dma())
            | level(GLOBAL_OUT_NAK, self.engine.is_nak_effective)
            | level(IEPINT, self.in_interrupts() != 0)
            | level(OEPINT, self.out_interrupts() != 0)
    }

    /// Whether the core asks for its interrupt.
    pub fn interrupt(&mut self) -> bool {
        self.engine_moves();
        self.plain(GAHBCFG) & 1 != 0 && self.interrupts() & self.plain(GINTMSK) != 0
    }

    fn write_control(&mut self, is_in: bool, index: usize, value: u32) {
        let armed_at = if is_in { "DIEPCTL" } else { "DOEPCTL" };
        if value & SNAK != 0 && value & CNAK != 0 {
            self.violation(format!("{armed_at}{index}: SNAK and CNAK at once"));
        }
        self.check_disable(is_in, index, value);
        let side = if is_in { &mut self.ins[index] } else { &mut self.outs[index] };
        let mut ctl = side.ctl & (EPENA | EPDIS | NAKSTS | DPID);
        ctl |= value & (MPSIZ | USBAEP | EPTYP | STALL | TXFNUM | EPENA);
        if index == 0 {
            // Always active; a halt ends with the next request.
            ctl |= USBAEP | side.ctl & STALL;
        }
        if value & SD0PID != 0 {
            ctl &= !DPID;
        }
        if value & SD1PID != 0 {
            ctl |= DPID;
        }
        if value & CNAK != 0 {
            ctl &= !NAKSTS;
            side.int &= !INEPNE;
        }
        if value & SNAK != 0 {
            ctl |= NAKSTS;
            side.nak_in = DELAY_READS;
        }
        if value & EPDIS != 0 && side.is(EPENA) {
            ctl |= EPDIS;
            side.disabled_in = DELAY_READS;
        }
        let begins = value & EPENA != 0 && !side.is(EPENA);
        side.ctl = ctl;
        if begins {
            self.engine_begins(is_in, index);
        }
    }

    fn pop_status(&mut self) -> u32 {
        let Some((status, words)) = self.received.pop_front() else {
            self.violation("GRXSTSP read while empty".into());
            return 0;
        };
        if !self.reading.is_empty() {
            self.violation("words of a packet left in the receive FIFO".into());
        }
        self.reading = words.into();
        let out = &mut self.outs[(status & 15) as usize];
        match status >> 17 & 15 {
            SETUP_DATA_DONE => out.int |= STUP,
            OUT_DATA_DONE => {
                out.int |= XFRC;
                out.ctl &= !EPENA;
            }
            _ => {}
        }
        status
    }

    fn receive(&mut self, kind: u32, endpoint: usize, bytes: &[u8]) {
        let status = kind << 17 | (bytes.len() as u32) << 4 | endpoint as u32;
        self.received.push_back((status, words(bytes).collect()));
    }

    // The bus, as a host uses it.

    fn hears(&self, address: u8) -> bool {
        self.plain(DCTL) & 2 == 0 && (self.plain(DCFG) >> 4 & 0x7F) as u8 == address
    }

    /// Whether a hub sees a device.
    pub fn is_attached(&self) -> bool {
        self.plain(GAHBCFG) & 1 != 0 && self.plain(DCTL) & 2 == 0
    }

    /// The host resets the bus.
    pub fn reset(&mut self) {
        self.latched |= USBRST;
        for side in self.ins.iter_mut().chain(&mut self.outs).skip(1) {
            side.ctl &= !USBAEP;
        }
        self.ins[0].ctl |= USBAEP;
        self.outs[0].ctl |= USBAEP;
    }

    /// Host and core have agreed on a speed.
    pub fn enumerated(&mut self, speed: Speed) {
        self.speed = speed as u32;
        self.latched |= ENUMDNE;
    }

    /// The bus has been silent for 3 ms.
    pub fn suspend(&mut self) {
        self.latched |= USBSUSP;
    }

    /// The host wakes the bus.
    pub fn resume(&mut self) {
        self.latched |= WKUPINT;
    }

    /// A request, and the token after it.
    pub fn setup(&mut self, address: u8, request: [u8; 8]) -> Answer {
        let answer = self.setup_alone(address, request);
        if answer != Answer::Silence {
            self.receive(SETUP_DATA_DONE, 0, &[]);
        }
        answer
    }

    /// A request, which another one may follow.
    pub fn setup_alone(&mut self, address: u8, request: [u8; 8]) -> Answer {
        if !self.hears(address) {
            return Answer::Silence;
        }
        for side in [&mut self.ins[0], &mut self.outs[0]] {
            side.ctl = side.ctl & !STALL | NAKSTS | DPID;
        }
        self.engine.is_control_read = request[0] & 0x80 != 0 && request[6..] != [0, 0];
        self.receive(SETUP_DATA_RX, 0, &request);
        Answer::Data(Vec::new(), 0)
    }

    /// A packet from the host.
    pub fn send(&mut self, address: u8, endpoint: usize, bytes: &[u8], toggle: u8) -> Answer {
        let words: usize = self.received.iter().map(|(_, words)| words.len() + 1).sum();
        let has_room = words + bytes.len().div_ceil(4) < self.plain(GRXFSIZ) as usize;
        let out = &mut self.outs[endpoint];
        let packet = packet_bytes(endpoint, out.ctl);
        if !out.is(USBAEP) || !self.hears(address) {
            return Answer::Silence;
        }
        let out = &mut self.outs[endpoint];
        if bytes.len() > packet {
            self.violation(format!("endpoint {endpoint} got {} bytes of {packet}", bytes.len()));
            return Answer::Silence;
        }
        if out.is(STALL) {
            return Answer::Stall;
        }
        if out.is(NAKSTS) || !has_room || !self.engine_takes(endpoint) {
            return Answer::Nak;
        }
        let out = &mut self.outs[endpoint];
        if endpoint != 0 && u8::from(out.is(DPID)) != toggle {
            // Sent again: the host has missed the acknowledgement.
            return Answer::Data(Vec::new(), toggle);
        }
        out.ctl = (out.ctl ^ DPID) | NAKSTS;
        self.receive(OUT_DATA_RX, endpoint, bytes);
        self.receive(OUT_DATA_DONE, endpoint, &[]);
        Answer::Data(Vec::new(), toggle)
    }

    /// A packet to the host, which hears it and whose acknowledgement arrives or not.
    pub fn fetch(&mut self, address: u8, endpoint: usize, acknowledged: bool) -> Answer {
        self.engine_moves();
        let heard = self.hears(address);
        let uses_dma = self.uses_dma();
        let side = &mut self.ins[endpoint];
        if !side.is(USBAEP) || !heard {
            return Answer::Silence;
        }
        if side.is(STALL) {
            return Answer::Stall;
        }
        let Some(length) = side.next_length(endpoint, uses_dma) else { return Answer::Nak };
        if side.is(NAKSTS) || !side.is(EPENA) || side.fifo.len() < length.div_ceil(4) {
            return Answer::Nak;
        }
        let words = side.fifo.iter().take(length.div_ceil(4)).flat_map(|word| word.to_ne_bytes());
        let answer = Answer::Data(words.take(length).collect(), u8::from(side.is(DPID)));
        if acknowledged {
            side.fifo.drain(..length.div_ceil(4));
            if uses_dma {
                side.lengths.pop_front();
                side.size -= 1 << 19;
            } else {
                side.take(length);
            }
            side.ctl ^= DPID;
            if side.packets() == 0 {
                side.ctl &= !EPENA;
                side.int |= XFRC;
            }
        }
        answer
    }

    /// Flips a bit, in the core's memory, of the packet that waits for the host. The byte is not 0 before or afterwards,
    /// and the `before` bytes before it in the packet are not 0 either. Returns whether there is such a byte.
    pub fn damage(&mut self, endpoint: usize, before: usize) -> bool {
        self.engine_moves();
        let uses_dma = self.uses_dma();
        let side = &mut self.ins[endpoint];
        let Some(length) = side.next_length(endpoint, uses_dma) else { return false };
        if !side.is(EPENA) || side.fifo.len() < length.div_ceil(4) {
            return false;
        }
        let mut packet: Vec<u8> = side.fifo.iter().flat_map(|word| word.to_ne_bytes()).collect();
        let Some(start) = packet[..length].windows(before + 1).position(|part| !part.contains(&0))
        else {
            return false;
        };
        let byte = &mut packet[start + before];
        *byte ^= if *byte == 1 { 2 } else { 1 };
        let (words, _) = packet.as_chunks::<4>();
        side.fifo = words.iter().map(|word| u32::from_ne_bytes(*word)).collect();
        true
    }

    /// Whether a transfer to the host is armed.
    pub fn is_armed(&self, endpoint: usize) -> bool {
        self.ins[endpoint].is(EPENA)
    }

    /// The next data toggles of an endpoint, to and from the host.
    pub fn toggles(&self, endpoint: usize) -> [u8; 2] {
        [&self.ins, &self.outs].map(|sides| u8::from(sides[endpoint].is(DPID)))
    }

    /// Largest packet that an endpoint may carry now, to and from the host.
    pub fn packet_bytes(&self, endpoint: usize) -> [usize; 2] {
        [&self.ins, &self.outs].map(|sides| packet_bytes(endpoint, sides[endpoint].ctl))
    }
}

/// Words of the FIFO that hold these bytes.
fn words(bytes: &[u8]) -> impl Iterator<Item = u32> {
    bytes.chunks(4).map(|chunk| {
        let mut word = [0; 4];
        word[..chunk.len()].copy_from_slice(chunk);
        u32::from_ne_bytes(word)
    })
}

fn packet_bytes(endpoint: usize, ctl: u32) -> usize {
    if endpoint == 0 { 64 >> (ctl & 3) } else { (ctl & MPSIZ) as usize }
}

/// The registers, by their offset.
impl OtgCore {
    /// A read, which may change the core.
    pub fn read(&mut self, offset: usize) -> u32 {
        self.tick();
        match offset {
            GRSTCTL => self.idle() | self.flushing.map_or(0, |(bits, _)| bits),
            GINTSTS => self.interrupts(),
            GRXSTSP | FIFOS.. if self.uses_dma() => {
                self.violation(format!("the processor reads {offset:#x} beside the DMA"));
                0
            }
            GRXSTSP => self.pop_status(),
            DSTS => self.speed << 1,
            DAINT => self.in_interrupts() | self.out_interrupts(),
            IN..FIFOS if offset < OUT + 32 * ENDPOINTS => {
                let is_in = offset < OUT;
                let index = (offset - if is_in { IN } else { OUT }) / 32;
                let room = self.fifo_words(index).saturating_sub(self.ins[index].fifo.len());
                let side = if is_in { &self.ins[index] } else { &self.outs[index] };
                match offset % 32 {
                    0x00 => side.ctl,
                    0x08 if is_in && side.fifo.is_empty() => side.int | TXFE,
                    0x08 => side.int,
                    0x10 => side.size,
                    0x14 => side.address,
                    0x18 if is_in => room as u32,
                    _ => 0,
                }
            }
            FIFOS.. => match self.reading.pop_front() {
                Some(word) => word,
                None => {
                    self.violation("the receive FIFO was read past the packet".into());
                    0
                }
            },
            _ => self.plain(offset),
        }
    }

    /// A write.
    pub fn write(&mut self, offset: usize, value: u32) {
        match offset {
            GRSTCTL => {
                let bits = value & 0x7F0;
                self.check_flush();
                self.flushing = (bits & 0x30 != 0).then_some((bits, DELAY_READS));
            }
            GINTSTS => self.latched &= !value,
            GINTMSK if self.uses_dma() && value & RXFLVL != 0 => {
                self.violation("RXFLVL unmasked beside the DMA".into());
            }
            DCTL => self.control_device(value),
            IN..FIFOS if offset < OUT + 32 * ENDPOINTS => {
                let is_in = offset < OUT;
                let index = (offset - if is_in { IN } else { OUT }) / 32;
                match offset % 32 {
                    0x00 => self.write_control(is_in, index, value),
                    0x08 if is_in => self.ins[index].int &= !value,
                    0x08 => self.outs[index].int &= !value,
                    0x10 if is_in => {
                        if self.ins[index].is(EPENA) {
                            self.violation(format!("DIEPTSIZ{index} written while armed"));
                        }
                        self.ins[index].size = value;
                    }
                    0x10 => {
                        if self.uses_dma() && self.outs[index].is(EPENA) {
                            self.violation(format!("DOEPTSIZ{index} written while armed"));
                        }
                        self.outs[index].size = value;
                    }
                    0x14 => self.set_address(is_in, index, value),
                    _ => {}
                }
            }
            FIFOS.. if self.uses_dma() => {
                self.violation(format!("the processor writes {offset:#x} beside the DMA"));
            }
            FIFOS.. => {
                let index = offset / FIFOS - 1;
                if self.ins[index].fifo.len() >= self.fifo_words(index) {
                    self.violation(format!("the FIFO of endpoint {index} overflows"));
                }
                self.ins[index].fifo.push_back(value);
            }
            _ => {
                self.plain.insert(offset, value);
            }
        }
    }
}
