//! Runs the RTL and the golden model side by side: the same pins, the same accesses, compared every
//! clock.
//!
//! The model runs `DEPTH` clocks behind the RTL. The model gets only the levels of the pins, and
//! each access in the clock in which the `access` pin says that the access took effect. The model
//! never depends on an output of the RTL other than `access`.
//!
//! The delays that `hdl/model/src/lib.rs` allows the RTL are bounded here: [`STOP_CLOCKS`],
//! [`TRIP_CLOCKS`] and [`START_CLOCKS`]. Everything else is exact: LED lines at every clock, both
//! ready pins, every register read, every byte of a frame or burst.

use crate::parallel::Receiver;
use crate::pins::{Pins, SAMPLING};
use crate::project::Project;
use nirspi_hdl_model::{AdcSample, Gateware, Lines};
use nirspi_wire::{
    DeviceMessage, FrameFlags, crc32,
    fpga::{FpgaFrame, Sums},
    open,
    register::{Design, Register, clocks, control, mode},
    samples::Width,
};
use std::collections::VecDeque;

/// Clocks from the choice of a slot to its last effect: `types::DEPTH`.
const DEPTH: u64 = 13;
/// Clocks from the choice of a slot to the change of its lines at the pins; the sample of its light
/// is at the pins in the same clock.
const TO_PINS: u64 = 6;
/// Clocks from the interlock pin to its last effect: two to synchronise, one more, and `DEPTH`.
const INTERLOCK: u64 = 2 + 1 + DEPTH;
/// Clocks from the interlock pin to the LEDs' pins, by the direct path.
const TO_DARK: u64 = 3;
/// Clocks from the access that starts a run to clock 0 of the run.
const START_CLOCKS: u64 = DEPTH + 1;
/// Clocks for which LEDs may be lit longer than in the model after a stop or an opened interlock.
const STOP_CLOCKS: u64 = 9;
/// Clocks for which LEDs may be lit longer than in the model after any other trip and after a raw
/// burst.
const TRIP_CLOCKS: u64 = 7;

/// Period of the ADC's clock.
const ADC_PS: u64 = 8000;

/// An access of the host.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Access {
    Write(u16, u32),
    Read(u16),
    Frame,
    Raw,
}

/// The model's answer to an access.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Answer {
    Value(u32),
    Bytes(Vec<u8>),
    /// Zeros may come before it.
    Packet(Vec<u8>),
}

/// How the host drives its port.
#[derive(Debug, Clone, Copy)]
pub struct Port {
    /// Period of the host port's clock; the ADC's period is 8000 ps.
    pub host_ps: u64,
    /// Clocks of the host port in half a period of `sck`, and the additional clocks of the high
    /// half.
    pub half: u32,
    pub quad: bool,
    /// In every second period of `sck`, one sample of a line of the host's is wrong.
    pub glitches: bool,
}

pub struct Rig {
    pub(crate) pins: Pins,
    pub model: Gateware,
    pub port: Port,
    seed: u64,
    /// Number of over-range samples among 256.
    pub over_range_rate: u8,
    /// Period in clocks with which codes are in the lower and in the upper half of their range, half a period each; 0: in
    /// both. Where the period is that of a pattern and its complement, all differences have one sign.
    pub tilt: u64,
    /// Codes fade to an eighth and come back. This is the logarithm of a quarter of that period, in
    /// clocks.
    pub fade: u32,
    pub(crate) clock: u64,
    next_adc_ps: u64,
    next_host_ps: u64,
    seen: VecDeque<Seen>,
    interlock: VecDeque<(u64, bool)>,
    /// Clocks in which the level of the interlock pin keeps the LEDs off.
    dark: std::ops::Range<u64>,
    /// The interlock pin has switched the LEDs off, and no run has begun since.
    put_out: bool,
    /// Level of the interlock pin.
    closed: bool,
    design: Design,
    /// Most frames are read by `READ_PACKET`, with an `sck` of any speed.
    pub by_sck: bool,
    /// What is at the parallel port.
    pub receiver: Option<Receiver>,
    /// Periods of `sck`.
    pub(crate) periods: u64,
    pub(crate) asked: Option<Access>,
    pub(crate) answer: Option<Answer>,
    start: Option<(u64, u32)>,
    /// Starts, which the model gets as two writes: what comes at once, and the start itself.
    written_twice: u32,
    grace: u64,
    /// LEDs were enabled in the clock before.
    just_lit: bool,
    /// The run under way, or the last one, is without light.
    unlit: bool,
    /// The last inputs of the model, for the report of a difference.
    told: VecDeque<String>,
    pub mismatch: Option<String>,
    pub variant: Variant,
    clock_held: u64,
    pub seen_so_far: Tally,
}

/// An RTL with changed constants, which shows in seconds what would take hours.
#[derive(Debug, Clone, Copy)]
pub struct Variant {
    /// Width of a sum in bits.
    pub sum_bits: u32,
    /// Difference between the RTL's clock and the model's: a multiple of the duty window.
    pub clock_ahead: u64,
    /// Clock of the model when the RTL leaves reset.
    pub begins_at: u64,
}

impl Default for Variant {
    fn default() -> Self {
        Self { sum_bits: 48, clock_ahead: 0, begins_at: 0 }
    }
}

/// Counts of compared events, to check that scenarios reach what they are for.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tally {
    pub lit_clocks: u64,
    /// Clocks of runs without light.
    pub unlit_clocks: u64,
    pub frames: u64,
    pub frames_over_range: u64,
    pub frames_overflow: u64,
    pub frames_after_loss: u64,
    pub bursts: u64,
    pub packets: u64,
    pub packets_after_loss: u64,
    /// Packets whose samples have 24 bits.
    pub narrow: u64,
    /// Packets read with `sck` as their clock, whole, and reads that were cut short.
    pub by_sck: [u64; 2],
    /// Releases behind which another frame waited.
    pub followed: u64,
    /// Packets sent by the parallel port: whole, after a loss, and cut by a start.
    pub sent: u64,
    pub sent_after_loss: u64,
    pub cut: u64,
    /// Zeros before the packet of which most came, with the time of a byte in ps.
    pub lead: (u64, u64),
    pub starts: u64,
    pub starts_refused: u64,
    pub stops: u64,
    /// Faults, by fault code.
    pub faults: [u64; 5],
}

/// The pins in one clock.
#[derive(Debug, Clone, Copy)]
struct Seen {
    sample: AdcSample,
    leds: Lines,
    /// The interlock pin has switched the LEDs off.
    put_out: bool,
}

/// Whether this packet of the model, delimiter included, is of the first frame after a loss, and the width of its
/// samples.
pub(crate) fn loss_and_width(packet: &[u8]) -> (bool, Width) {
    let mut packet = packet[..packet.len() - 1].to_vec();
    let opened: DeviceMessage<'_> = open(&mut packet).expect("the model's packet");
    let DeviceMessage::Frame(frame) = opened else { panic!("{opened:?}") };
    (frame.flags.contains(FrameFlags::AFTER_LOSS), frame.samples.width())
}

/// The sample at the pins in a clock.
fn sample(seed: u64, rate: u8, clock: u64) -> AdcSample {
    let mut z = seed ^ clock.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    AdcSample { code: (z & 0x3FFF) as u16, over_range: (z >> 56) < rate.into() }
}

/// The golden model on the board of [`Pins`].
fn model(design: Design) -> Gateware {
    let mut model = Gateware::of(design);
    model.set_sampling(SAMPLING);
    model
}

impl Rig {
    pub fn new(project: &Project, seed: u64) -> Self {
        Self {
            pins: Pins::new(project),
            model: model(Design::Camera),
            port: Port { host_ps: 10_000, half: 3, quad: true, glitches: false },
            seed,
            over_range_rate: 0,
            tilt: 0,
            fade: 63,
            clock: 0,
            next_adc_ps: 0,
            next_host_ps: 1,
            seen: VecDeque::new(),
            interlock: VecDeque::new(),
            dark: 0..u64::MAX,
            put_out: true,
            closed: false,
            design: Design::Camera,
            by_sck: false,
            receiver: None,
            periods: 0,
            asked: None,
            answer: None,
            start: None,
            written_twice: 0,
            grace: 0,
            just_lit: false,
            unlit: false,
            told: VecDeque::new(),
            mismatch: None,
            variant: Variant::default(),
            clock_held: 0,
            seen_so_far: Tally::default(),
        }
    }

    /// The same for a changed RTL.
    pub fn of_variant(project: &Project, seed: u64, variant: Variant) -> Self {
        let half = format!("param HALF: u32 = {}", variant.sum_bits / 2);
        let clock = variant.begins_at.wrapping_add(variant.clock_ahead);
        let reset = format!("clock_now    = 64'd{clock} - (types::DEPTH as 64);");
        let project = project.with("accumulators", "param HALF: u32 = 24", &half).with(
            "engine",
            "clock_now    = -(types::DEPTH as 64);",
            &reset,
        );
        let mut rig = Self { variant, ..Self::new(&project, seed) };
        for _ in 0..variant.begins_at {
            rig.model.tick(AdcSample::default());
        }
        rig
    }

    /// A frame of the model in the form that this variant delivers, or a packet as it is.
    fn frame_of_variant(&mut self, bytes: Vec<u8>) -> Answer {
        if bytes.is_empty() {
            return Answer::Bytes(bytes);
        }
        let Ok(frame) = FpgaFrame::parse(&bytes) else {
            self.count_packet(&bytes);
            return Answer::Packet(bytes);
        };
        let mut header = frame.header;
        header.clock = header.clock.wrapping_add(self.variant.clock_ahead);
        let modulus = 1u64 << self.variant.sum_bits;
        if frame.sums().any(|sums| sums.positive.max(sums.negative) >= modulus) {
            header.flags = header.flags.with(FrameFlags::OVERFLOW);
        }
        let tally = &mut self.seen_so_far;
        tally.frames += 1;
        tally.frames_over_range += u64::from(header.flags.contains(FrameFlags::OVER_RANGE));
        tally.frames_overflow += u64::from(header.flags.contains(FrameFlags::OVERFLOW));
        tally.frames_after_loss += u64::from(header.flags.contains(FrameFlags::AFTER_LOSS));
        let mut bytes = header.to_bytes().to_vec();
        for sums in frame.sums() {
            let (positive, negative) = (sums.positive % modulus, sums.negative % modulus);
            bytes.extend(Sums { positive, negative }.to_bytes());
        }
        bytes.extend(crc32(&bytes).to_le_bytes());
        Answer::Bytes(bytes)
    }

    fn count_packet(&mut self, bytes: &[u8]) {
        let (is_after_loss, width) = loss_and_width(bytes);
        self.seen_so_far.packets += 1;
        self.seen_so_far.packets_after_loss += u64::from(is_after_loss);
        self.seen_so_far.narrow += u64::from(width == Width::Bits24);
    }

    /// A register read of the model, with the clock of this variant.
    fn read_of_variant(&mut self, address: u16) -> u32 {
        let value = self.model.read(address).unwrap_or(0);
        match Register::at(address) {
            Some(Register::ClockLow) => {
                let high = self.model.read(Register::ClockHigh.address()).unwrap_or(0);
                self.clock_held =
                    (u64::from(high) << 32 | u64::from(value)) + self.variant.clock_ahead;
                self.clock_held as u32
            }
            Some(Register::ClockHigh) => (self.clock_held >> 32) as u32,
            Some(Register::Writes) => value - self.written_twice,
            Some(Register::Fault) => {
                self.seen_so_far.faults[value as usize] += 1;
                value
            }
            _ => value,
        }
    }

    /// Records the first difference; later differences follow from the first.
    pub(crate) fn expect<T: PartialEq + std::fmt::Debug>(
        &mut self,
        what: &str,
        rtl: &T,
        model: &T,
    ) {
        if rtl != model && self.mismatch.is_none() {
            let told = Vec::from(self.told.clone()).join("\n  ");
            self.mismatch =
                Some(format!("clock {}: {what}: {rtl:?}, model {model:?}\n  {told}", self.clock));
        }
    }

    fn tell(&mut self, what: String) {
        self.told.push_back(what);
        if self.told.len() > 12 {
            self.told.pop_front();
        }
    }

    /// Takes the ADC's clock away. An access under way is forgotten.
    pub fn lose_adc_clock(&mut self) {
        self.pins.adc_clock(false);
        self.model.set_adc_clock(None);
        self.asked = None;
        self.start = None;
    }

    /// Brings the ADC's clock back, as the clock of this design, and waits until accesses reach the ADC's domain.
    pub fn bring_adc_clock_back(&mut self, design: Design) {
        self.design = design;
        self.pins.design(design);
        self.pins.adc_clock(true);
        while !self.pins.adc_answers() {
            self.host_clock();
        }
    }

    /// The ADC's domain has left its reset: RTL and model begin anew.
    fn restart(&mut self) {
        self.model = model(self.design);
        self.clock = 0;
        self.written_twice = 0;
        self.seen.clear();
        self.interlock.clear();
        self.receiver.iter_mut().for_each(Receiver::forget);
        (self.dark, self.put_out) = (0..u64::MAX, true);
        (self.grace, self.just_lit, self.unlit) = (0, false, false);
        self.tell("the ADC's clock is back".into());
        self.interlock(self.closed);
    }

    /// Checks what `Clocks` reads after two windows: the flags of the model, and the frequency of the two clocks
    /// here to within one unit.
    pub fn check_clocks(&mut self) {
        self.wait(2 * clocks::WINDOW + 10);
        let found = self.read(Register::Clocks.address()) & clocks::FREQUENCY;
        let ticks = u64::from(clocks::WINDOW) * self.port.host_ps / ADC_PS;
        let expected = ticks as u32 / clocks::PRESCALER * u32::from(self.pins.adc_answers());
        self.expect("frequency is as measured", &(found.abs_diff(expected) <= 1), &true);
    }

    /// One clock of the ADC.
    fn adc_clock(&mut self) {
        if !self.pins.adc_runs() {
            self.pins.adc_edge();
            if self.pins.adc_runs() {
                self.restart();
            }
            return;
        }
        let now = self.clock;
        // Samples of a clock's light are at the pins together with the clock's lines.
        let mut sample = sample(self.seed, self.over_range_rate, now);
        sample.code >>= (now >> self.fade) & 3;
        if self.tilt > 0 {
            sample.code = sample.code >> 1 | u16::from(now % self.tilt < self.tilt / 2) << 13;
        }
        self.pins.sample(sample);
        let leds = self.pins.leds();
        self.put_out |= self.dark.contains(&now);
        if self.put_out {
            self.expect("LEDs after the interlock opened", &leds.enable, &false);
        }
        self.seen.push_back(Seen { sample, leds, put_out: self.put_out });
        if self.seen.len() as u64 > DEPTH - TO_PINS + 1 {
            self.seen.pop_front();
        }
        let access = self.pins.access();
        let sent = self.parallel_clock();
        if now >= DEPTH {
            self.model_clock(now - DEPTH, access, sent);
        }
        self.pins.adc_edge();
        self.clock += 1;
    }

    /// Runs clock `t` of the model, which the RTL has completed; the parallel port has sent a packet before that clock.
    fn model_clock(&mut self, t: u64, access: bool, sent: bool) {
        if self.start.is_none() {
            let ready = self.pins.ready();
            let expected = (self.model.frame_ready(), self.model.raw_ready());
            self.expect("ready pins", &ready, &expected);
        }
        let was_shown = self.shows();
        while self.interlock.front().is_some_and(|&(at, _)| at == t) {
            let (_, closed) = self.interlock.pop_front().unwrap();
            self.model.set_interlock(closed);
            self.tell(format!("clock {t}: interlock {closed}"));
        }
        if access {
            match self.asked.take() {
                Some(asked) => self.access(t, asked),
                None => self.expect("accesses", &1, &0),
            }
        }
        if sent {
            self.model.sent();
        }
        if let Some((at, bits)) = self.start
            && at == t
        {
            self.start = None;
            self.model.write(Register::Control.address(), bits);
            let running = self.model.running();
            self.tell(format!("clock {t}: started {running}"));
            self.seen_so_far.starts += u64::from(running);
            if running {
                let mode = self.model.read(Register::Mode.address()).unwrap_or(0);
                self.unlit = mode & mode::UNLIT != 0;
                self.seen_so_far.cut += u64::from(self.cut());
            }
            self.seen_so_far.starts_refused += u64::from(!running);
        }
        if was_shown && !self.shows() {
            self.grace = STOP_CLOCKS + self.lag();
            self.seen_so_far.stops += 1;
        }
        let Seen { sample, mut leds, put_out } = self.seen[0];
        // Without `enable` the other lines light nothing, and may follow a clock later.
        if !leds.enable && !self.unlit {
            if !std::mem::take(&mut self.just_lit) {
                self.expect("lines without enable", &leds, &Lines::default());
            }
            leds = Lines::default();
        }
        self.just_lit |= leds.enable;
        let expected = self.model.lines();
        if self.grace > 0 && !self.shows() {
            self.grace -= 1;
            // The lines of a pattern without light may all be 0.
            if !leds.enable && !self.unlit {
                self.grace = 0;
                self.expect("LED lines going out", &leds, &expected);
            }
        } else if !put_out {
            self.expect("LED lines", &leds, &expected);
        }
        let shown = self.shows();
        self.seen_so_far.lit_clocks += u64::from(expected.enable);
        self.seen_so_far.unlit_clocks += u64::from(shown && self.unlit);
        let running = self.model.running();
        self.model.tick(sample);
        // A run that ends by itself has switched its LEDs off already, unless its latency is 0.
        if shown && running && !self.model.running() {
            self.grace = TRIP_CLOCKS + self.lag();
        }
    }

    /// Clocks by which the lines of a run without light go out later than its enable would.
    fn lag(&self) -> u64 {
        u64::from(self.unlit)
    }

    /// Whether the model shows a pattern, with light or without.
    fn shows(&self) -> bool {
        self.model.lines().enable || self.unlit && self.model.running()
    }

    fn access(&mut self, t: u64, access: Access) {
        const STARTS: u32 = control::START | control::START_RAW;
        self.tell(format!("clock {t}: {access:x?}, running {}", self.model.running()));
        let answer = match access {
            Access::Write(address, value) => {
                let control = address == Register::Control.address();
                if control && value & STARTS != 0 {
                    self.written_twice += 1;
                    self.model.write(address, value & !STARTS);
                    if self.model.running() {
                        self.model.write(address, value & STARTS);
                    } else {
                        self.start = Some((t + START_CLOCKS, value & STARTS));
                        self.put_out = self.dark.contains(&self.clock);
                    }
                } else {
                    let gives = control && value & control::RELEASE != 0;
                    let gives = gives && self.model.frame_ready();
                    self.model.write(address, value);
                    self.seen_so_far.followed += u64::from(gives && self.model.frame_ready());
                }
                return;
            }
            Access::Read(address) => Answer::Value(self.read_of_variant(address)),
            Access::Frame => {
                let bytes = self.model.frame().unwrap_or_default().to_vec();
                self.frame_of_variant(bytes)
            }
            Access::Raw => {
                let bytes = self.model.raw().unwrap_or_default().to_vec();
                self.seen_so_far.bursts += u64::from(!bytes.is_empty());
                Answer::Bytes(bytes)
            }
        };
        self.answer = Some(answer);
    }

    /// One clock of the host port, and the clocks of the ADC before it.
    pub(crate) fn host_clock(&mut self) {
        while self.next_adc_ps <= self.next_host_ps {
            self.next_adc_ps += ADC_PS;
            self.adc_clock();
        }
        self.next_host_ps += self.port.host_ps;
        self.pins.host_edge();
    }

    /// Clocks of both domains up to this time.
    pub(crate) fn wait_until(&mut self, ps: u64) {
        while self.next_host_ps <= ps {
            self.host_clock();
        }
        while self.next_adc_ps <= ps {
            self.next_adc_ps += ADC_PS;
            self.adc_clock();
        }
    }

    pub(crate) fn now_ps(&self) -> u64 {
        self.next_host_ps.min(self.next_adc_ps)
    }

    pub fn wait(&mut self, host_clocks: u32) {
        for _ in 0..host_clocks {
            self.host_clock();
        }
    }

    pub fn wait_adc(&mut self, clocks: u64) {
        let end = self.clock + clocks;
        while self.clock < end {
            self.host_clock();
        }
    }

    pub fn interlock(&mut self, closed: bool) {
        self.closed = closed;
        self.pins.interlock(closed);
        let at = self.clock + INTERLOCK - DEPTH;
        // A level that no clock has sampled has no effect.
        if self.interlock.back().is_some_and(|&(last, _)| last == at) {
            self.interlock.pop_back();
        }
        self.interlock.push_back((at, closed));
        if closed {
            self.dark.end = self.dark.end.min(self.clock + TO_DARK);
        } else {
            self.dark = self.clock + TO_DARK..u64::MAX;
        }
    }
}
