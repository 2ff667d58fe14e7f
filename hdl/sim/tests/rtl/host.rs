//! The host's side of the host port, as defined in `nirspi_wire::host_port`.
//!
//! On every rising edge of `sck`, the levels that the FPGA drives are compared with the model's
//! answer to the same access.

use crate::rig::{Access, Answer, Rig};
use crate::scenario::Dice;
use nirspi_wire::{
    host_port,
    ready::{FAST_LEAD_BYTES, LEAD_BYTES},
    register::{Register, clocks},
};

/// Time that [`LEAD_BYTES`] take at 14.6 MHz by four lines.
const LEAD_PS: u64 = LEAD_BYTES as u64 * 2 * 68_300;

/// A line that the host drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Line {
    Sck,
    Select,
    Data,
}

impl Rig {
    /// One period of `sck`; returns what the FPGA drives when the host samples.
    fn sck(&mut self, lines: u8) -> (u8, u8) {
        let half = self.port.half;
        let glitch = self.glitch();
        self.pins.drive(lines);
        let mut driven = (0, 0);
        for clock in 0..2 * half {
            let high = clock >= half;
            if clock == half {
                driven = self.pins.driven();
            }
            let wrong = glitch.filter(|&(at, _)| at == clock).map(|(_, line)| line);
            self.pins.sck(high != (wrong == Some(Line::Sck)));
            self.pins.select(wrong != Some(Line::Select));
            self.pins.drive(if wrong == Some(Line::Data) { !lines & 0xF } else { lines });
            self.host_clock();
            // The FPGA lets its lines go with the level of `cs_n` at the pin, so a glitch is over before the
            // host samples.
            self.pins.select(true);
        }
        self.pins.drive(lines);
        driven
    }

    /// The clock of this period in which a line of the host's is wrong, and that line.
    fn glitch(&mut self) -> Option<(u32, Line)> {
        self.periods += 1;
        let chance = Dice::new(self.periods).next();
        let line = [Line::Sck, Line::Sck, Line::Select, Line::Data][chance as usize % 4];
        let at = (chance >> 32) as u32 % (2 * self.port.half);
        (self.port.glitches && self.periods.is_multiple_of(2)).then_some((at, line))
    }

    /// Sends the lowest `bits` of a word, quad or on `io0`.
    fn send(&mut self, word: u32, bits: u32, quad: bool) {
        let step = if quad { 4 } else { 1 };
        for shift in (0..bits).step_by(step as usize).map(|sent| bits - step - sent) {
            // Lines that the FPGA ignores carry noise.
            let noise = self.clock as u8 & 0xE;
            let value = (word >> shift) as u8;
            let (_, drive) = self.sck(if quad { value & 0xF } else { value & 1 | noise });
            self.expect("lines driven while the host drives them", &drive, &0);
        }
    }

    fn receive(&mut self, bits: u32) -> u32 {
        let mut word = 0;
        let quad = self.port.quad;
        for _ in 0..if quad { bits / 4 } else { bits } {
            let (lines, drive) = self.sck(self.clock as u8 & 0xD);
            self.expect("lines driven", &drive, &if quad { 0xF } else { 2 });
            word = if quad {
                word << 4 | u32::from(lines)
            } else {
                word << 1 | u32::from(lines >> 1 & 1)
            };
        }
        word
    }

    fn begin(&mut self, opcode: u8, address: u16) {
        self.pins.sck(false);
        self.pins.select(true);
        let quad = self.port.quad;
        self.send((opcode | if quad { host_port::QUAD } else { 0 }).into(), 8, false);
        self.send(address.into(), 16, quad);
    }

    fn end(&mut self) {
        self.pins.sck(false);
        self.wait(self.port.half);
        self.pins.select(false);
        let (_, drive) = self.pins.driven();
        self.expect("lines driven by a port not selected", &drive, &0);
        self.wait(4);
    }

    fn dummy(&mut self) {
        for _ in 0..host_port::DUMMY_CYCLES {
            self.sck(0);
        }
    }

    /// Waits until an access has no more effects.
    fn settled(&mut self) {
        for _ in 0..40 {
            if self.asked.is_none() {
                return;
            }
            self.host_clock();
        }
        self.expect("accesses that came through", &0, &1);
        self.asked = None;
    }

    /// Sends a write whose value and check have these wrong bits.
    fn send_write(&mut self, address: u16, value: u32, wrong: u64) {
        self.begin(host_port::WRITE_REGISTER, address);
        let quad = self.port.quad;
        self.send(value ^ (wrong >> 16) as u32, 32, quad);
        self.send(u32::from(host_port::check(address, value) ^ wrong as u16), 16, quad);
    }

    pub fn write(&mut self, address: u16, value: u32) {
        self.asked = self.pins.adc_answers().then_some(Access::Write(address, value));
        self.send_write(address, value, 0);
        self.end();
        self.settled();
    }

    /// Sends a write that comes damaged: one to three bits of value and check are wrong.
    pub fn write_damaged(&mut self, address: u16, value: u32, bits: [u64; 3]) {
        let wrong = bits.iter().fold(0, |wrong, bit| wrong | 1 << (bit % 48));
        self.send_write(address, value, wrong);
        self.end();
        self.wait(50);
    }

    /// Sends a write, and takes the ADC's clock away some clocks after its last bit.
    pub fn write_and_lose_adc_clock(&mut self, address: u16, value: u32, after: u32) {
        self.asked = Some(Access::Write(address, value));
        self.send_write(address, value, 0);
        self.wait(after);
        self.lose_adc_clock();
        self.end();
    }

    /// Reads bytes of a frame or burst while the ADC has no clock: zeros.
    pub fn stream_zeros(&mut self, opcode: u8, bytes: usize) {
        self.begin(opcode, 0);
        self.dummy();
        for _ in 0..bytes {
            let byte = self.receive(8);
            self.expect("a byte without clock", &byte, &0);
        }
        self.end();
    }

    /// Sends a write that ends before its last bits.
    pub fn write_cut_short(&mut self, address: u16, value: u32) {
        self.begin(host_port::WRITE_REGISTER, address);
        let quad = self.port.quad;
        self.send(value, 32, quad);
        self.send(u32::from(host_port::check(address, value) >> 4), 12, quad);
        self.end();
        self.wait(50);
    }

    pub fn set(&mut self, register: Register, value: u32) {
        self.write(register.address(), value);
    }

    pub fn read(&mut self, address: u16) -> u32 {
        if self.pins.adc_answers() {
            self.asked = Some(Access::Read(address));
        } else {
            self.answer = self.model.read(address).map(Answer::Value);
        }
        self.begin(host_port::READ_REGISTER, address);
        self.dummy();
        let value = self.receive(32);
        let check = self.receive(16);
        self.end();
        self.settled();
        self.expect("check of a register", &check, &host_port::check(address, value).into());
        // The frequency is measured: `check_clocks` compares it.
        let measured = if address == Register::Clocks.address() { clocks::FREQUENCY } else { 0 };
        let answer = self.answer.take().map(|answer| match answer {
            Answer::Value(word) => Answer::Value(word & !measured),
            other => other,
        });
        let found = Some(Answer::Value(value & !measured));
        self.expect(&format!("register {address:#x}"), &found, &answer);
        value
    }

    /// Reads the frame or burst: whole and some bytes beyond its end, or only its first bytes.
    pub fn stream(&mut self, raw: bool, at_most: usize) {
        let dice = &mut Dice::new(self.periods ^ self.clock);
        if self.by_sck && !raw && !dice.once_in(4) {
            // 45 to 60 MHz.
            let any = dice.range(8_334, 11_000);
            let half_ps = dice.pick(&[8_334, 9_375, any]);
            return self.packet(half_ps, at_most);
        }
        let (access, opcode) = if raw {
            (Access::Raw, host_port::READ_RAW)
        } else {
            (Access::Frame, host_port::READ_FRAME)
        };
        self.asked = Some(access);
        self.begin(opcode, 0);
        self.dummy();
        self.settled();
        let mut bytes = Vec::new();
        let mut expected = match self.answer.take() {
            Some(Answer::Bytes(expected)) => expected,
            Some(Answer::Packet(expected)) => {
                bytes.push(self.first_of_a_packet());
                expected
            }
            _ => return self.expect("a stream begun", &0, &1),
        };
        expected.extend([0; 3]);
        expected.truncate(at_most);
        bytes.extend((bytes.len()..expected.len()).map(|_| self.receive(8) as u8));
        self.end();
        if let Some(at) = (0..bytes.len()).find(|&at| bytes[at] != expected[at]) {
            let what =
                format!("byte {at} of {} ({})", bytes.len(), if raw { "raw" } else { "frame" });
            self.expect(&what, &bytes[at], &expected[at]);
        }
    }

    /// The first byte of a packet. Zeros come before the packet, for as long as [`LEAD_BYTES`] take a host of the
    /// fastest `sck` that the host port allows.
    fn first_of_a_packet(&mut self) -> u8 {
        let periods = if self.port.quad { 2 } else { 8 };
        let byte_ps = periods * u64::from(2 * self.port.half) * self.port.host_ps;
        for zeros in 0.. {
            let byte = self.receive(8) as u8;
            if byte != 0 {
                let lead = &mut self.seen_so_far.lead;
                *lead = std::cmp::max_by_key(*lead, (zeros, byte_ps), |(zeros, ps)| zeros * ps);
                return byte;
            }
            if zeros * byte_ps > LEAD_PS {
                self.expect("a packet begun", &0, &1);
                return byte;
            }
        }
        0
    }
}

/// A read that `sck` clocks, with clocks of the FPGA in any relation to it.
impl Rig {
    /// One period of `sck`; returns what the FPGA drives when the host samples.
    fn fast_sck(&mut self, at_ps: &mut u64, half_ps: u64, lines: u8) -> (u8, u8) {
        self.periods += 1;
        self.pins.drive(lines);
        *at_ps += half_ps;
        self.wait_until(*at_ps);
        let driven = self.pins.driven();
        self.pins.sck(true);
        *at_ps += half_ps;
        self.wait_until(*at_ps);
        self.pins.sck(false);
        driven
    }

    /// Opcode, address and dummy cycles of such a read, of which only the first clocks come if it is cut short.
    fn begin_packet(&mut self, at_ps: &mut u64, half_ps: u64, clocks: usize) {
        self.pins.sck(false);
        self.pins.select(true);
        let opcode = host_port::READ_PACKET | host_port::QUAD;
        let noise = self.clock as u8 & 0xE;
        let bits = (0..8).rev().map(|bit| opcode >> bit & 1 | noise);
        let rest = std::iter::repeat_n(0, 4 + usize::from(host_port::DUMMY_CYCLES));
        for lines in bits.chain(rest).take(clocks) {
            let (_, drive) = self.fast_sck(at_ps, half_ps, lines);
            self.expect("lines driven before the bytes", &drive, &0);
        }
    }

    /// A read of a packet while the ADC has no clock: the FPGA leaves the lines alone.
    pub fn packet_undriven(&mut self) {
        let at_ps = &mut self.now_ps();
        self.begin_packet(at_ps, 9_375, usize::MAX);
        for _ in 0..20 {
            let (_, drive) = self.fast_sck(at_ps, 9_375, 0);
            self.expect("lines driven without clock", &drive, &0);
        }
        self.end();
    }

    fn fast_byte(&mut self, at_ps: &mut u64, half_ps: u64) -> u8 {
        (0..2).fold(0, |byte, _| {
            let (lines, drive) = self.fast_sck(at_ps, half_ps, self.clock as u8 & 0xF);
            self.expect("lines driven by `sck`", &drive, &0xF);
            byte << 4 | lines
        })
    }

    /// Reads the packet, whole and some bytes beyond its end, or only its first bytes, or cut in its opcode. Frames that
    /// are no packets may have gaps, and are not compared.
    pub fn packet(&mut self, half_ps: u64, at_most: usize) {
        let at_ps = &mut self.now_ps();
        let cut = Dice::new(*at_ps).range(0, 60);
        if cut < 8 {
            self.begin_packet(at_ps, half_ps, cut as usize);
            self.end();
            return self.wait(50);
        }
        self.asked = Some(Access::Frame);
        self.begin_packet(at_ps, half_ps, usize::MAX);
        let mut bytes: Vec<u8> = (0..3).map(|_| self.fast_byte(at_ps, half_ps)).collect();
        // The access takes effect while zeros come.
        let wanted = loop {
            match self.answer.take() {
                Some(Answer::Packet(packet)) => break Some(packet),
                Some(Answer::Bytes(frame)) => break frame.is_empty().then(Vec::new),
                _ if bytes.len() > 40 => return self.expect("a packet asked for", &0, &1),
                _ => bytes.push(self.fast_byte(at_ps, half_ps)),
            }
        };
        let length = wanted.as_ref().map_or(0, Vec::len);
        let last = (FAST_LEAD_BYTES + length).min(at_most.saturating_add(3));
        while bytes.len() < last {
            let byte = self.fast_byte(at_ps, half_ps);
            bytes.push(byte);
        }
        self.end();
        let Some(wanted) = wanted else { return };
        let zeros = bytes.iter().take_while(|&&byte| byte == 0).count();
        let lead = &mut self.seen_so_far.lead;
        if zeros < bytes.len() {
            let byte_ps = 4 * half_ps;
            *lead = std::cmp::max_by_key(*lead, (zeros as u64, byte_ps), |(zeros, ps)| zeros * ps);
        }
        self.seen_so_far.by_sck[usize::from(at_most != usize::MAX)] += 1;
        let mut expected = vec![0; zeros];
        expected.extend(&wanted);
        expected.resize(expected.len().max(bytes.len()), 0);
        expected.truncate(bytes.len());
        if at_most == usize::MAX && !wanted.is_empty() && zeros + wanted.len() > bytes.len() {
            self.expect("zeros before a packet", &zeros, &FAST_LEAD_BYTES);
        }
        if let Some(at) = (0..bytes.len()).find(|&at| bytes[at] != expected[at]) {
            let what = format!("byte {at} ({zeros} zeros first) of a packet by `sck`");
            self.expect(&what, &bytes[at], &expected[at]);
        }
    }
}
