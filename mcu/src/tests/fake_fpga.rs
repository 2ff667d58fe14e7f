//! A fake FPGA for tests: its registers, one frame or two, and every kind of failure.

use crate::{BusError, FpgaBus};
use nirspi_wire::fpga::{Header, Sums};
use nirspi_wire::packet::{MAX_DEVICE_PACKET, seal};
use nirspi_wire::ready::Head;
use nirspi_wire::register::{
    DUTY_LIMIT_MAX, FaultCode, IDENTITY, NO_CLOCK, ORDER_TABLE, Register, TEST_SEED, clocks,
    control, mode, status, test_sample,
};
use nirspi_wire::samples::Width;
use nirspi_wire::{ADC_HZ, FrameFlags, crc32};
use std::collections::BTreeMap;
use std::rc::Rc;
use std::vec::Vec;

/// Register file and frame buffer. A run makes frames only when the test calls `make_frame`.
#[derive(Clone)]
pub struct FakeFpga {
    pub registers: BTreeMap<u16, u32>,
    pub identity: u32,
    pub interlock_closed: bool,
    pub fault: FaultCode,
    pub running: bool,
    pub made: u32,
    pub lost: u32,
    pub clock: u64,
    pub frame: Option<Vec<u8>>,
    /// The frame that waits behind the delivered one, and what the signal meter will ask of it.
    pub behind: Option<(Vec<u8>, (u64, u32))>,
    /// Samples over range in every frame.
    pub over_range: u32,
    /// What is added to the positive sums of a frame, by its sequence.
    pub noise_of: fn(u32, u64) -> u64,
    /// What the scratch register reads, by what it holds.
    pub scratch_of: Rc<dyn Fn(u32) -> u32>,
    /// What is added to every sum.
    pub light: u64,
    /// After a read of this register, a frame is made, once.
    pub frame_after_read_of: Option<Register>,
    pub raw: Option<Vec<u8>>,
    /// A start completes all frames of the run before the next register read.
    pub instant: bool,
    /// Number of calls of `frame` and `raw` during which the transfer is still in progress.
    pub transfer_polls: u32,
    /// Every access fails.
    pub dead: bool,
    /// The bus loses every write, without an error.
    pub deaf: bool,
    /// The bus loses writes to this address.
    pub lost_address: Option<u16>,
    /// Bits of the data bus that always read 1.
    pub stuck_ones: u32,
    pub accesses: u32,
    /// Writes taken.
    pub writes: u32,
    /// The ADC has no clock.
    pub clockless: bool,
    /// Level of the board's own LED enable.
    pub pin: bool,
    /// The FPGA's enable, or the board's, is high whatever its chip says.
    pub stuck: (bool, bool),
    /// Counts of a sample of the light of all LEDs, which the detector sees in runs of pattern 0 alone.
    pub array_counts: u64,
    /// The runs of pattern 0 alone: whether they are without light, and the level of the board's enable at their start.
    pub of_pattern_0: Vec<(bool, bool)>,
    /// The line of a ready frame stays low.
    pub ready_line_broken: bool,
    /// Bits that the wires invert in the read after this many others.
    pub noise: Option<(u32, u32)>,
    config_error: bool,
    after_loss: bool,
    /// Sum of the samples and samples over range of the delivered frame.
    measures: (u64, u32),
    clock_read: u64,
    /// Run, clock and time of packets, as of the start.
    stamp: (u16, u64, u64),
}

impl Default for FakeFpga {
    fn default() -> Self {
        let mut registers: BTreeMap<_, _> =
            Register::ALL.iter().map(|r| (r.address(), r.reset())).collect();
        let ready = clocks::LOCKED | clocks::ALIVE | clocks::READY;
        registers.insert(Register::Clocks.address(), ready | (ADC_HZ / clocks::UNIT_HZ));
        Self {
            registers,
            identity: IDENTITY,
            interlock_closed: true,
            fault: FaultCode::None,
            running: false,
            made: 0,
            lost: 0,
            clock: 0,
            frame: None,
            behind: None,
            over_range: 0,
            noise_of: |_, _| 0,
            scratch_of: Rc::new(|word| word),
            light: 0,
            frame_after_read_of: None,
            raw: None,
            instant: false,
            transfer_polls: 0,
            dead: false,
            deaf: false,
            lost_address: None,
            stuck_ones: 0,
            accesses: 0,
            writes: 0,
            clockless: false,
            pin: false,
            stuck: (false, false),
            array_counts: 5_000,
            of_pattern_0: Vec::new(),
            ready_line_broken: false,
            noise: None,
            config_error: false,
            after_loss: false,
            measures: (0, 0),
            clock_read: 0,
            stamp: (0, 0, 0),
        }
    }
}

impl FakeFpga {
    /// Whether the last start was refused, and whether a frame was lost since the last one.
    pub fn flags(&self) -> (bool, bool) {
        (self.config_error, self.after_loss)
    }

    /// Whether frames are delivered as packets.
    pub fn sends_packets(&self) -> bool {
        self.get(Register::Mode) & mode::PACKETS != 0
    }

    pub fn get(&self, register: Register) -> u32 {
        self.registers[&register.address()]
    }

    pub fn leds_on(&self) -> bool {
        let unlit = self.get(Register::Mode) & mode::UNLIT != 0;
        let may = self.interlock_closed && self.fault == FaultCode::None && !self.clockless;
        self.running && may && !unlit
    }

    /// Whether LEDs shine in a slot of pattern 0: both enables are high, or look so.
    fn shines(&self) -> bool {
        let unlit = self.get(Register::Mode) & mode::UNLIT != 0;
        let (fpga, board) = self.stuck;
        (!unlit || fpga) && (self.pin || board)
    }

    /// Latches a fault, which ends the run.
    pub fn trip(&mut self, fault: FaultCode) {
        self.fault = fault;
        self.running = false;
    }

    /// Loses its configuration: all registers as after power-up.
    pub fn reset(&mut self) {
        let version = self.get(Register::Version);
        *self = Self { accesses: self.accesses, ..Self::default() };
        self.registers.insert(Register::Version.address(), version);
    }

    /// Sums of frame `sequence`; sums of the test generator where the mode selects it.
    pub fn sums(&self, sequence: u32) -> Vec<Sums> {
        let patterns = self.get(Register::Patterns) as usize;
        if self.get(Register::Mode) & mode::TEST_SOURCE != 0 {
            return self.test_sums(patterns);
        }
        if patterns == 1 {
            let word = |register| u64::from(self.get(register));
            let samples = word(Register::Dwell) - word(Register::Blank);
            let lit = if self.shines() { self.array_counts } else { 0 };
            let sum = |counts: u64| (self.light + counts) * samples * word(Register::Sweeps);
            return std::vec![Sums { positive: sum(lit), negative: sum(0) }];
        }
        (0..patterns as u64)
            .map(|k| {
                let noise = (self.noise_of)(sequence, k);
                let positive = 1000 * u64::from(sequence) + k + noise;
                Sums { positive: self.light + positive, negative: self.light + 7 }
            })
            .collect()
    }

    /// Sums by definition: the sample of clock t belongs to what was shown at clock t - latency.
    fn test_sums(&self, patterns: usize) -> Vec<Sums> {
        let dwell = self.get(Register::Dwell) as usize;
        let (blank, latency) = (self.get(Register::Blank), self.get(Register::Latency) as usize);
        let mut state = TEST_SEED;
        let mut sums = std::vec![Sums::default(); patterns];
        for t in 0..latency + 2 * patterns * dwell {
            if let Some(shown) = t.checked_sub(latency) {
                let (slot, clock) = (shown / dwell, shown % dwell);
                if clock >= blank as usize {
                    let sum = &mut sums[slot / 2];
                    let half = if slot % 2 == 0 { &mut sum.positive } else { &mut sum.negative };
                    *half += u64::from(state);
                }
            }
            state = test_sample(state);
        }
        sums
    }

    /// Completes a frame of the run.
    pub fn make_frame(&mut self) {
        if !self.running {
            return;
        }
        let sequence = self.made;
        self.made = self.made.wrapping_add(1);
        if self.behind.is_some() {
            self.lost += 1;
            self.after_loss = true;
        } else {
            let flags = if std::mem::take(&mut self.after_loss) {
                FrameFlags::AFTER_LOSS
            } else {
                FrameFlags::default()
            };
            let bytes = self.frame_bytes(sequence, flags);
            let sums = self.sums(sequence);
            let total = sums.iter().map(|sums| sums.positive + sums.negative).sum();
            let measures = (total, self.over_range);
            if self.frame.is_some() {
                self.behind = Some((bytes, measures));
            } else {
                (self.frame, self.measures) = (Some(bytes), measures);
            }
        }
        if self.made == self.get(Register::Frames) {
            self.running = false;
        }
    }

    /// Delivers this frame, with what the signal meter will ask of it.
    pub fn deliver(&mut self, frame: Vec<u8>, measures: (u64, u32)) {
        (self.frame, self.measures) = (Some(frame), measures);
    }

    fn frame_bytes(&self, sequence: u32, mut flags: FrameFlags) -> Vec<u8> {
        let mode = self.get(Register::Mode);
        if mode & mode::TEST_SOURCE != 0 {
            flags = flags.with(FrameFlags::TEST_SOURCE);
        }
        if mode & mode::DIFFERENTIAL != 0 {
            flags = flags.with(FrameFlags::DIFFERENTIAL);
        }
        let header = Header {
            patterns: self.get(Register::Patterns) as u16,
            flags,
            sequence,
            sweeps: self.get(Register::Sweeps),
            over_range: self.over_range,
            lost: self.lost,
            clock: self.clock,
        };
        if self.sends_packets() {
            return self.packet(&header);
        }
        let mut bytes = header.to_bytes().to_vec();
        for sum in self.sums(sequence) {
            bytes.extend(sum.to_bytes());
        }
        bytes.extend(crc32(&bytes).to_le_bytes());
        bytes
    }

    /// The packet of a frame, without zeros around it.
    fn packet(&self, header: &Header) -> Vec<u8> {
        let (run, clock, time) = self.stamp;
        let is_narrow = self.get(Register::Mode) & mode::NARROW != 0;
        let width = if is_narrow { Width::Bits24 } else { Width::Bits32 };
        let head = Head {
            run,
            sequence: header.sequence,
            device_time_us: time + (header.clock - clock) / 125,
            sweeps: header.sweeps,
            flags: header.flags,
            patterns: header.patterns,
            width,
        };
        let mut payload = head.to_bytes().to_vec();
        for sums in self.sums(header.sequence) {
            payload.extend(&(sums.difference() as i32).to_le_bytes()[..width.bytes()]);
        }
        seal(&payload, &mut [0; MAX_DEVICE_PACKET]).unwrap().to_vec()
    }

    /// What the signal meter asks of the delivered frame.
    fn measures(&self) -> (u64, u32) {
        if self.frame.is_some() { self.measures } else { (0, 0) }
    }

    fn status(&self) -> u32 {
        let bits = [
            (self.running, status::RUNNING),
            (self.frame.is_some(), status::FRAME_READY),
            (self.raw.is_some(), status::RAW_READY),
            (self.leds_on(), status::LEDS_ON),
            (self.fault != FaultCode::None, status::FAULT),
            (self.interlock_closed, status::INTERLOCK_CLOSED),
            (self.config_error, status::CONFIG_ERROR),
        ];
        bits.iter().filter(|(set, _)| *set).map(|(_, bit)| bit).sum()
    }

    fn control(&mut self, bits: u32) {
        if bits & control::STOP != 0 {
            self.running = false;
        }
        if bits & control::CLEAR_FAULT != 0 && !self.running {
            self.fault = FaultCode::None;
        }
        if bits & control::RELEASE != 0 {
            self.frame = self.behind.take().map(|(bytes, measures)| {
                self.measures = measures;
                bytes
            });
        }
        if bits & (control::START | control::START_RAW) != 0 {
            self.start(bits & control::START_RAW != 0);
        }
    }

    fn start(&mut self, raw: bool) {
        if self.running || self.fault != FaultCode::None || !self.interlock_closed {
            return;
        }
        self.config_error = self.get(Register::Blank) >= self.get(Register::Dwell)
            || self.get(Register::DutyLimit) > DUTY_LIMIT_MAX;
        if self.config_error {
            return;
        }
        (self.made, self.lost, self.frame, self.behind, self.raw) = (0, 0, None, None, None);
        let time = u64::from(self.get(Register::TimeHigh)) << 32;
        let time = time | u64::from(self.get(Register::TimeLow));
        self.stamp = (self.get(Register::Run) as u16, self.clock_read, time);
        self.after_loss = false;
        if raw {
            let samples = self.get(Register::RawLength) as u16;
            self.raw = Some((0..samples).flat_map(|s| (s % 16_384).to_le_bytes()).collect());
            return;
        }
        self.running = true;
        let bits = self.get(Register::Mode);
        if self.get(Register::Patterns) == 1 {
            self.of_pattern_0.push((bits & mode::UNLIT != 0, self.pin));
        }
        // The packet of the training, which a test need not wait for.
        let trains = mode::UNLIT | mode::PACKETS;
        if self.instant || bits & trains == trains {
            for _ in 0..self.get(Register::Frames) {
                self.make_frame();
            }
        }
    }
}

impl FpgaBus for FakeFpga {
    fn read(&mut self, address: u16) -> Result<u32, BusError> {
        self.accesses += 1;
        if self.dead {
            return Err(BusError::Timeout);
        }
        let value = match Register::at(address) {
            Some(Register::Identity) => self.identity,
            Some(Register::Version | Register::Design) => self.registers[&address],
            Some(Register::Clocks) if self.clockless => 0,
            Some(Register::Clocks) => self.registers[&address],
            _ if self.clockless => NO_CLOCK,
            Some(Register::Status) => self.status(),
            Some(Register::Fault) => self.fault as u32,
            Some(Register::FramesMade) => self.made,
            Some(Register::FramesLost) => self.lost,
            Some(Register::Scratch) => (self.scratch_of)(self.get(Register::Scratch)),
            Some(Register::ClockLow) => {
                self.clock_read = self.clock;
                self.clock as u32
            }
            Some(Register::ClockHigh) => (self.clock_read >> 32) as u32,
            Some(Register::SumLow) => self.measures().0 as u32,
            Some(Register::SumHigh) => (self.measures().0 >> 32) as u32,
            Some(Register::OverRange) => self.measures().1,
            Some(Register::Control) => 0,
            Some(Register::Writes) => self.writes,
            _ => self.registers.get(&address).copied().unwrap_or(0),
        };
        if self.frame_after_read_of.is_some_and(|register| register.address() == address) {
            self.frame_after_read_of = None;
            self.make_frame();
        }
        let flipped = match &mut self.noise {
            Some((0, bits)) => std::mem::take(bits),
            Some((reads, _)) => {
                *reads -= 1;
                0
            }
            None => 0,
        };
        Ok((value ^ flipped) | self.stuck_ones)
    }

    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError> {
        self.accesses += 1;
        if self.dead {
            return Err(BusError::Timeout);
        }
        if self.deaf || self.clockless || self.lost_address == Some(address) {
            return Ok(());
        }
        self.writes = self.writes.wrapping_add(1);
        if address == Register::Control.address() {
            self.control(value);
        } else if address >= ORDER_TABLE || Register::at(address).is_some() {
            self.registers.insert(address, value);
        }
        Ok(())
    }

    fn frame_ready(&mut self) -> bool {
        self.frame.is_some() && !self.ready_line_broken
    }

    fn raw_ready(&mut self) -> bool {
        self.raw.is_some()
    }

    fn frame(&mut self) -> Result<Option<&[u8]>, BusError> {
        if self.transfer_polls > 0 {
            self.transfer_polls -= 1;
            return Ok(None);
        }
        if self.dead { Err(BusError::Timeout) } else { Ok(self.frame.as_deref()) }
    }

    fn raw(&mut self) -> Result<Option<&[u8]>, BusError> {
        if self.dead { Err(BusError::Timeout) } else { Ok(self.raw.as_deref()) }
    }
}
