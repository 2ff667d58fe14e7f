//! The board around the simulated FPGA: clocks, host port's pins, LEDs, photodiode, ADC.
//!
//! The FPGA is accessed only through its pins, and both of its clocks run all the time.

use crate::receiver::Receiver;
use nirspi_hdl_model::{AdcSample, Lines};
use nirspi_hdl_sim::{pins::Pins, project::Project};
use nirspi_optics::{Chain, LedArray};
use nirspi_virtual::StuckEnable;
use nirspi_wire::fpga::{FpgaFrame, HEADER_BYTES, frame_bytes};
use nirspi_wire::host_port::{
    DUMMY_CYCLES, QUAD, READ_FRAME, READ_PACKET, READ_RAW, READ_REGISTER, SCK_DIVIDER,
    SEALED_BYTES, WRITE_REGISTER, seal, unseal,
};
use nirspi_wire::ready;
use nirspi_wire::register::{Design, Register, loopback, mode};
use nirspi_wire::samples::Width;
use std::collections::VecDeque;

/// Period of the ADC's clock.
const ADC_PS: u64 = 8_000;
/// Period of the host port's clock: 100 MHz, so `sck` has 16.7 MHz.
pub const HOST_PS: u64 = 10_000;
/// Clocks of the host port between two accesses, enough for the effects of a write to reach the
/// pins.
const BETWEEN: u8 = 40;

/// What is in front of the FPGA.
pub enum Front {
    /// LEDs, photodiode and ADC.
    Camera(Box<LedArray>, Box<Chain>),
    /// Nothing: the bring-up design. The levels at the LED pins come back after these clocks.
    Loopback(VecDeque<Lines>),
}

impl Front {
    /// The bring-up design: two registers on the way out, one on the way in, four of `loopback`.
    pub fn loopback() -> Self {
        Self::Loopback(VecDeque::from([Lines::default(); 7]))
    }

    /// The sample in a clock with these lines, of which the LEDs have this enable.
    fn sample(&mut self, lines: Lines, shines: bool) -> AdcSample {
        match self {
            Self::Camera(array, chain) => {
                let light = array.step(lines.rows, lines.columns, shines);
                let sample = chain.sample(light);
                AdcSample { code: sample.counts, over_range: sample.over_range }
            }
            Self::Loopback(late) => {
                late.push_back(lines);
                let Lines { rows, columns, enable } = late.pop_front().unwrap_or_default();
                AdcSample { code: loopback(rows, columns, enable), over_range: false }
            }
        }
    }
}

/// A powered board.
pub struct Board {
    pins: Pins,
    front: Front,
    at_pins: AdcSample,
    /// Level of the microcontroller's LED enable.
    board_enable: bool,
    /// One of the two enables is high whatever its chip says.
    pub stuck: Option<StuckEnable>,
    /// What the wires of the parallel port lead to, if there are any.
    receiver: Option<Receiver>,
    is_ready: bool,
    /// ADC clocks since reset.
    clock: u64,
    next_adc_ps: u64,
    next_host_ps: u64,
    /// Period of the host port's clock.
    host_ps: u64,
    /// Length of a raw burst, mode and patterns as written last: only the host knows how much it has to read.
    raw_length: u32,
    mode: u32,
    patterns: u32,
}

/// Levels at the microcontroller's other pins.
#[derive(Debug, Clone, Copy, Default)]
pub struct Seen {
    pub clock: u64,
    pub lit: bool,
    pub frame_ready: bool,
    pub raw_ready: bool,
}

impl Board {
    /// A board whose host port's clock has this period.
    pub fn new(front: Front, host_ps: u64) -> Self {
        let mut pins = Pins::new(&Project::read());
        pins.interlock(true);
        if matches!(front, Front::Loopback(_)) {
            pins.design(Design::BringUp);
        }
        Self {
            pins,
            front,
            at_pins: AdcSample::default(),
            board_enable: false,
            stuck: None,
            receiver: None,
            is_ready: false,
            clock: 0,
            next_adc_ps: 0,
            next_host_ps: 1,
            host_ps,
            raw_length: Register::RawLength.reset(),
            mode: Register::Mode.reset(),
            patterns: Register::Patterns.reset(),
        }
    }

    /// Leads the parallel port to a ring.
    pub fn wire_parallel_port(&mut self) {
        self.receiver = Some(Receiver::new());
    }

    /// The microcontroller's end of the parallel port.
    pub fn receiver(&mut self) -> Option<&mut Receiver> {
        self.receiver.as_mut()
    }

    pub fn seen(&mut self) -> Seen {
        let (frame_ready, raw_ready) = self.pins.ready();
        Seen { clock: self.clock, lit: self.pins.leds().enable, frame_ready, raw_ready }
    }

    /// Takes the ADC's clock away, or brings it back.
    pub fn set_adc_clock(&mut self, ticks: bool) {
        self.pins.adc_clock(ticks);
    }

    pub fn interlock(&mut self, closed: bool) {
        self.pins.interlock(closed);
    }

    pub fn board_enable(&mut self, high: bool) {
        self.board_enable = high;
    }

    /// One clock of the ADC. The sample has the light of this clock's lines, except for the latency
    /// of the optical chain.
    fn adc_clock(&mut self) {
        let lines = self.pins.leds();
        let fpga = lines.enable || self.stuck == Some(StuckEnable::Fpga);
        let board = self.board_enable || self.stuck == Some(StuckEnable::Board);
        let sample = self.front.sample(lines, fpga && board);
        if self.at_pins != sample {
            self.at_pins = sample;
            self.pins.sample(sample);
        }
        if let Some(receiver) = &self.receiver {
            let is_ready = receiver.is_ready(self.next_adc_ps);
            if is_ready != self.is_ready {
                self.is_ready = is_ready;
                self.pins.receives(is_ready);
            }
        }
        self.pins.adc_edge();
        if let Some(receiver) = &mut self.receiver {
            receiver.clock(self.pins.parallel());
        }
        self.clock += 1;
    }

    /// One clock of the host port, and the clocks of the ADC before it.
    fn host_clock(&mut self) {
        while self.next_adc_ps <= self.next_host_ps {
            self.next_adc_ps += ADC_PS;
            self.adc_clock();
        }
        self.next_host_ps += self.host_ps;
        self.pins.host_edge();
    }

    fn wait(&mut self, host_clocks: u8) {
        for _ in 0..host_clocks {
            self.host_clock();
        }
    }

    /// Time since reset.
    pub fn now_ps(&self) -> u64 {
        self.next_host_ps
    }

    /// Time that passes between two accesses without any.
    pub fn pause_ps(&self) -> u64 {
        (u64::from(BETWEEN) + u64::from(SCK_DIVIDER / 2)) * self.host_ps
    }

    pub fn advance(&mut self, adc_clocks: u32) {
        let end = self.clock + u64::from(adc_clocks);
        while self.clock < end {
            self.host_clock();
        }
    }

    /// One period of `sck`; returns the lines at its rising edge.
    fn sck(&mut self, lines: u8) -> u8 {
        self.pins.drive(lines);
        self.pins.sck(false);
        self.wait(SCK_DIVIDER / 2);
        let (driven, _) = self.pins.driven();
        self.pins.sck(true);
        self.wait(SCK_DIVIDER / 2);
        driven
    }

    /// Sends the lowest `bits` of a word by four lines.
    fn send(&mut self, word: u32, bits: u32) {
        for shift in (0..bits).step_by(4).rev() {
            self.sck((word >> shift) as u8 & 0xF);
        }
    }

    fn receive(&mut self, bits: u32) -> u32 {
        (0..bits).step_by(4).fold(0, |word, _| word << 4 | u32::from(self.sck(0)))
    }

    fn receive_bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| self.receive(8) as u8).collect()
    }

    /// Selects the FPGA and sends opcode and address.
    fn begin(&mut self, opcode: u8, address: u16) {
        self.pins.sck(false);
        self.pins.select(true);
        for shift in (0..8).rev() {
            self.sck((opcode | QUAD) >> shift & 1);
        }
        self.send(address.into(), 16);
    }

    fn dummy(&mut self) {
        for _ in 0..DUMMY_CYCLES {
            self.sck(0);
        }
    }

    fn end(&mut self) {
        self.pins.sck(false);
        self.wait(SCK_DIVIDER / 2);
        self.pins.select(false);
        self.wait(BETWEEN);
    }

    pub fn write(&mut self, address: u16, value: u32) {
        match Register::at(address) {
            Some(Register::RawLength) => self.raw_length = value,
            Some(Register::Mode) => self.mode = value,
            Some(Register::Patterns) => self.patterns = value,
            _ => {}
        }
        self.write_sealed(address, seal(address, value));
    }

    pub fn write_sealed(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) {
        self.begin(WRITE_REGISTER, address);
        for byte in sealed {
            self.send(byte.into(), 8);
        }
        self.end();
    }

    pub fn read(&mut self, address: u16) -> u32 {
        unseal(address, self.read_sealed(address)).unwrap()
    }

    pub fn read_sealed(&mut self, address: u16) -> [u8; SEALED_BYTES] {
        self.begin(READ_REGISTER, address);
        self.dummy();
        let sealed = [(); SEALED_BYTES].map(|()| self.receive(8) as u8);
        self.end();
        sealed
    }

    /// Reads the frame, whose header gives its length, or as much as a packet of so many patterns may take.
    pub fn frame(&mut self) -> Vec<u8> {
        if self.mode & mode::PACKETS != 0 {
            let is_narrow = self.mode & mode::NARROW != 0;
            let width = if is_narrow { Width::Bits24 } else { Width::Bits32 };
            return self.frame_bytes(ready::read_bytes(self.patterns as u16, width));
        }
        self.begin(READ_FRAME, 0);
        self.dummy();
        let mut bytes = self.receive_bytes(HEADER_BYTES);
        if let Some(header) = FpgaFrame::parse_header(&bytes) {
            let rest = frame_bytes(header.patterns) - HEADER_BYTES;
            bytes.extend(self.receive_bytes(rest));
        }
        self.end();
        bytes
    }

    /// Reads so many bytes of the frame or packet.
    pub fn frame_bytes(&mut self, count: usize) -> Vec<u8> {
        self.begin(READ_FRAME, 0);
        self.dummy();
        let bytes = self.receive_bytes(count);
        self.end();
        bytes
    }

    /// Reads the packet with an `sck` of this period, which has nothing to do with the FPGA's clocks.
    pub fn packet(&mut self, into: &mut [u8], sck_ps: u64) {
        self.pins.sck(false);
        self.pins.select(true);
        let mut at_ps = self.next_host_ps;
        let opcode = READ_PACKET | QUAD;
        for shift in (0..8).rev() {
            self.sck_at(&mut at_ps, sck_ps, opcode >> shift & 1);
        }
        for _ in 0..4 + DUMMY_CYCLES {
            self.sck_at(&mut at_ps, sck_ps, 0);
        }
        for byte in into {
            let high = self.sck_at(&mut at_ps, sck_ps, 0);
            *byte = high << 4 | self.sck_at(&mut at_ps, sck_ps, 0);
        }
        self.pins.select(false);
        self.wait(BETWEEN);
    }

    /// One period of such an `sck`; returns the lines at its rising edge.
    fn sck_at(&mut self, at_ps: &mut u64, sck_ps: u64, lines: u8) -> u8 {
        self.pins.drive(lines);
        *at_ps += sck_ps / 2;
        self.wait_until(*at_ps);
        let (driven, _) = self.pins.driven();
        self.pins.sck(true);
        *at_ps += sck_ps / 2;
        self.wait_until(*at_ps);
        self.pins.sck(false);
        driven
    }

    /// Clocks of both domains up to this time.
    fn wait_until(&mut self, ps: u64) {
        while self.next_host_ps <= ps {
            self.host_clock();
        }
        while self.next_adc_ps <= ps {
            self.next_adc_ps += ADC_PS;
            self.adc_clock();
        }
    }

    pub fn raw(&mut self) -> Vec<u8> {
        self.begin(READ_RAW, 0);
        self.dummy();
        let bytes = self.receive_bytes(2 * self.raw_length as usize);
        self.end();
        bytes
    }
}
