//! Tests of everything on the ADC's clock: accesses, light, samples, bytes.

use super::bundles::{Place, Settings};
use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::fpga::{FpgaFrame, HEADER_BYTES, frame_bytes};
use nirspi_wire::host_port::{READ_FRAME, READ_RAW, READ_REGISTER, WRITE_REGISTER};
use nirspi_wire::register::{FaultCode, Register as R, control, mode};
use nirspi_wire::{DeviceMessage, open};

/// Clocks from the access that starts a run to the lines of its first slot.
const TO_LIGHT: u64 = 7;
/// Clocks for which the LEDs stay lit after the sample or the light that ends their run: the run
/// ends seven clocks later.
const TO_DARK: u64 = 7;

laws![
    a_sample_is_summed_with_what_was_lit_latency_clocks_before,
    a_frame_says_when_its_first_slot_was_lit,
    over_range_counts_from_the_first_light_on,
    leds_are_lit_for_the_watchdogs_clocks_after_any_access,
    light_costs_what_the_register_map_says,
    a_run_of_packets_sends_them_whole_and_a_burst_stays_a_burst,
    a_delivered_frame_can_be_asked_for_its_sum_and_its_over_range_samples,
    packets_by_the_parallel_port_are_whole_whatever_the_host_reads,
];

/// The engine, its host and a count of clocks.
struct Engine {
    bench: Bench,
    clock: u64,
    /// Clock of the last access that took effect.
    accessed: u64,
    /// The ADC's code in each clock.
    code: fn(u64) -> u64,
    /// Packets leave by the parallel port.
    parallel: bool,
    /// Bytes that the parallel port has sent.
    sent: Vec<u8>,
}

impl Engine {
    /// The engine after reset, with the interlock closed.
    fn new(project: &Project) -> Self {
        let mut engine = Self {
            bench: Bench::new(project, "engine"),
            clock: 0,
            accessed: 0,
            code: |_| 0,
            parallel: false,
            sent: Vec::new(),
        };
        engine.reset();
        engine
    }

    fn reset(&mut self) {
        self.bench.reset("clk", "rst");
        self.bench.set("interlock", true);
        self.bench.set("byte_taken", false);
        self.clock = 0;
        // The interlock passes as many stages as a run.
        self.clocks(20);
    }

    fn tick(&mut self) {
        self.bench.set("code", (self.code)(self.clock));
        if self.bench.is("access") {
            self.accessed = self.clock;
        }
        if self.parallel
            && self.bench.get("parallel_strobe") == 0b01
            && self.bench.is("parallel_enable")
        {
            self.sent.push(self.bench.get("parallel_lines") as u8);
        }
        self.bench.tick();
        self.clock += 1;
    }

    fn clocks(&mut self, count: u64) {
        for _ in 0..count {
            self.tick();
        }
    }

    /// Ticks until a port is high.
    fn until(&mut self, port: &str) {
        let from = self.clock;
        while !self.bench.is(port) {
            self.tick();
            assert!(self.clock - from < 5000, "{port} never comes");
        }
    }

    fn access(&mut self, opcode: u8, address: u16, data: u32) -> u32 {
        self.bench.set("operation", opcode & 3);
        self.bench.set("address", address);
        self.bench.set("data", data);
        self.bench.set("request", true);
        self.tick();
        self.bench.set("request", false);
        self.until("answered");
        let value = self.bench.get("value") as u32;
        self.tick();
        value
    }

    fn set(&mut self, register: R, value: u64) {
        self.access(WRITE_REGISTER, register.address(), value as u32);
    }

    fn read(&mut self, register: R) -> u32 {
        self.access(READ_REGISTER, register.address(), 0)
    }

    /// Writes settings and begins a run; returns the clock of its first light.
    fn start(&mut self, settings: &Settings) -> u64 {
        self.begin(settings, control::START)
    }

    /// The same, with these bits of `Control`.
    fn begin(&mut self, settings: &Settings, bits: u32) -> u64 {
        let mode = if settings.differential { mode::DIFFERENTIAL } else { 0 };
        let mode = if settings.alternating { mode | mode::ALTERNATING } else { mode };
        let mode = if settings.packets { mode | mode::PACKETS } else { mode };
        let mode = if self.parallel { mode | mode::PARALLEL } else { mode };
        for (register, value) in [
            (R::Mode, mode.into()),
            (R::Patterns, settings.patterns),
            (R::Dwell, settings.dwell),
            (R::Blank, settings.blank),
            (R::Latency, settings.latency),
            (R::Sweeps, settings.sweeps),
            (R::Frames, settings.frames),
            (R::RawLength, settings.raw_length),
            (R::Watchdog, settings.watchdog),
            (R::DutyLimit, settings.duty_limit),
            (R::OverRangeTrip, settings.over_range_trip),
        ] {
            self.set(register, value);
        }
        self.bench.set("operation", WRITE_REGISTER & 3);
        self.bench.set("address", R::Control.address());
        self.bench.set("data", bits);
        self.bench.set("request", true);
        self.tick();
        self.bench.set("request", false);
        self.until("enable");
        assert_eq!(self.clock, self.accessed + TO_LIGHT, "first light");
        self.clock
    }

    /// Number of clocks until the LEDs are dark, with the current one.
    fn lit_clocks(&mut self) -> u64 {
        let from = self.clock;
        while self.bench.is("enable") {
            self.tick();
            assert!(self.clock - from < 5000, "never dark");
        }
        self.clock - from
    }

    /// The first bytes of the next frame; the frame is then released.
    fn frame(&mut self, count: usize) -> Vec<u8> {
        self.until("frame_ready");
        self.access(READ_FRAME, 0, 0);
        let bytes = (0..count).map(|_| self.byte()).collect();
        self.set(R::Control, control::RELEASE.into());
        bytes
    }

    /// The next byte, which is taken.
    fn byte(&mut self) -> u8 {
        self.until("byte_valid");
        self.bench.set("byte_taken", true);
        let byte = self.bench.get("octet") as u8;
        self.tick();
        self.bench.set("byte_taken", false);
        byte
    }

    /// The sums of a run's first frame, of noise; the run's first light was at this clock.
    fn sums_of_noise(settings: &Settings, light: u64) -> Vec<[u64; 2]> {
        let mut sums = vec![[0; 2]; settings.patterns as usize];
        for t in 0..settings.frame_clocks() {
            let place = Place::of(settings, t).unwrap();
            if place.counts {
                let code = noise(light + t + settings.latency);
                sums[place.index as usize][usize::from(place.complement)] += code;
            }
        }
        sums
    }
}

fn noise(clock: u64) -> u64 {
    Dice::new(clock).range(0, 0x3FFF)
}

fn random(dice: &mut Dice) -> Settings {
    Settings { frames: 1, ..Settings::random(dice) }
}

fn a_sample_is_summed_with_what_was_lit_latency_clocks_before(project: &Project) {
    let mut engine = Engine::new(project);
    engine.code = noise;
    let dice = &mut Dice::new(38);
    for _ in 0..25 {
        let settings = random(dice);
        let light = engine.start(&settings);
        let bytes = engine.frame(frame_bytes(settings.patterns as u16));
        let frame = FpgaFrame::parse(&bytes).unwrap();
        let expected = Engine::sums_of_noise(&settings, light);
        let seen: Vec<_> = frame.sums().map(|sums| [sums.positive, sums.negative]).collect();
        assert_eq!(seen, expected, "{settings:?}");
    }
}

fn a_frame_says_when_its_first_slot_was_lit(project: &Project) {
    let mut engine = Engine::new(project);
    let dice = &mut Dice::new(39);
    for _ in 0..15 {
        // Frames that take longer than the read of a header.
        let settings = Settings { patterns: 60, dwell: 9, blank: 0, frames: 2, ..random(dice) };
        let light = engine.start(&settings);
        let shown = [(); 2].map(|()| {
            let header = engine.frame(HEADER_BYTES);
            FpgaFrame::parse_header(&header).unwrap().clock
        });
        assert_eq!(shown[1] - shown[0], settings.frame_clocks(), "{settings:?}");
        // The host reads the clock of its access; a run begins 14 clocks after its access.
        engine.read(R::ClockLow);
        let read_at = engine.accessed;
        let now = u64::from(engine.read(R::ClockLow)) - (engine.accessed - read_at);
        assert_eq!(now - shown[0], read_at - (light - TO_LIGHT) - 14, "{settings:?}");
        engine.clocks(100);
    }
}

fn over_range_counts_from_the_first_light_on(project: &Project) {
    let mut engine = Engine::new(project);
    let dice = &mut Dice::new(40);
    for _ in 0..20 {
        engine.reset();
        let trip = dice.range(1, 40);
        let settings =
            Settings { patterns: 10, dwell: 9, frames: 0, over_range_trip: trip, ..random(dice) };
        engine.bench.set("over_range", true);
        engine.start(&settings);
        assert_eq!(engine.lit_clocks(), settings.latency + trip + TO_DARK, "{settings:?}");
        assert_eq!(engine.read(R::Fault), FaultCode::OverRange as u32);
    }
}

fn leds_are_lit_for_the_watchdogs_clocks_after_any_access(project: &Project) {
    let mut engine = Engine::new(project);
    let dice = &mut Dice::new(41);
    for _ in 0..10 {
        engine.reset();
        let watchdog = dice.range(60, 400);
        engine.start(&Settings { watchdog, frames: 0, ..random(dice) });
        for _ in 0..12 {
            engine.clocks(dice.range(0, watchdog - 30));
            match dice.range(0, 2) {
                0 => drop(engine.read(R::Status)),
                1 => engine.set(R::Scratch, 1),
                // An address without a register.
                _ => drop(engine.access(READ_REGISTER, 0x900, 0)),
            }
            assert!(engine.bench.is("enable"), "dark though fed, watchdog {watchdog}");
        }
        engine.lit_clocks();
        assert_eq!(engine.clock - engine.accessed, watchdog, "dark");
        assert_eq!(engine.read(R::Fault), FaultCode::Watchdog as u32);
    }
}

fn light_costs_what_the_register_map_says(project: &Project) {
    let mut engine = Engine::new(project);
    let dice = &mut Dice::new(42);
    for _ in 0..25 {
        engine.reset();
        let limit = dice.range(0, 60);
        let settings =
            Settings { patterns: dice.range(1, 3), frames: 0, duty_limit: limit, ..random(dice) };
        engine.start(&settings);
        // In natural order index 0 is pattern 0, which lights all LEDs; its complement lights none.
        let cost = |t| match Place::of(&settings, t).unwrap() {
            Place { index: 0, complement: false, .. } => 2,
            Place { index: 0, complement: true, .. } => 0,
            _ => 1,
        };
        let mut spent = 0;
        let trips = (0..).find(|&t| {
            spent += cost(t);
            spent > limit
        });
        assert_eq!(engine.lit_clocks(), trips.unwrap() + 1 + TO_DARK, "{settings:?}");
        assert_eq!(engine.read(R::Fault), FaultCode::Duty as u32);
    }
}

fn a_run_of_packets_sends_them_whole_and_a_burst_stays_a_burst(project: &Project) {
    let mut engine = Engine::new(project);
    engine.code = noise;
    let dice = &mut Dice::new(43);
    for round in 0..12 {
        let settings = Settings { packets: true, frames: 0, raw_length: 40, ..random(dice) };
        let (run, time) = (dice.next() as u16, dice.next() >> 1);
        engine.set(R::Run, run.into());
        engine.set(R::TimeLow, time);
        engine.set(R::TimeHigh, time >> 32);
        engine.read(R::ClockLow);
        let read_at = engine.accessed;
        let light = engine.start(&settings);
        engine.until("frame_ready");
        engine.access(READ_FRAME, 0, 0);
        let mut packet = Vec::new();
        while !packet.ends_with(&[0]) {
            packet.push(engine.byte());
        }
        engine.set(R::Control, control::RELEASE.into());
        packet.pop();
        let opened: DeviceMessage<'_> = open(&mut packet).unwrap();
        let DeviceMessage::Frame(frame) = opened else { panic!("{opened:?}") };
        let shown = light - TO_LIGHT + 14;
        let expected = (run, 0, time + (shown - read_at) / 125);
        assert_eq!((frame.run, frame.sequence, frame.device_time_us), expected, "{settings:?}");
        let sums = Engine::sums_of_noise(&settings, light);
        let differences =
            sums.iter().map(|[positive, negative]| *positive as i64 - *negative as i64);
        assert!(frame.samples.iter().eq(differences), "{settings:?}");

        // Neither goes on in the other when it is abandoned.
        engine.frame(3);
        engine.set(R::Control, control::STOP.into());
        engine.clocks(20);
        let light = engine.begin(&settings, control::START_RAW);
        engine.until("raw_ready");
        engine.access(READ_RAW, 0, 0);
        for t in 0..if round % 2 == 0 { settings.raw_length } else { 3 } {
            let word = u16::from_le_bytes([engine.byte(), engine.byte()]);
            assert_eq!(u64::from(word), noise(light + t), "{settings:?}");
        }
    }
}

fn a_delivered_frame_can_be_asked_for_its_sum_and_its_over_range_samples(project: &Project) {
    let mut engine = Engine::new(project);
    engine.code = noise;
    let dice = &mut Dice::new(46);
    for round in 0..16 {
        let over = round % 2 == 0;
        let packets = dice.once_in(2);
        let settings = Settings { packets, over_range_trip: 0, ..random(dice) };
        engine.bench.set("over_range", over);
        let light = engine.start(&settings);
        engine.until("frame_ready");
        // A frame of four clocks is complete with the access that has started it, and a host's next access takes longer.
        engine.clocks(2);
        let sums = Engine::sums_of_noise(&settings, light);
        let total: u64 = sums.iter().flatten().sum();
        let over_range = if over { settings.frame_clocks() } else { 0 };
        let expected = [total as u32, (total >> 32) as u32, over_range as u32];
        let read = |engine: &mut Engine| {
            [R::SumLow, R::SumHigh, R::OverRange].map(|register| engine.read(register))
        };
        assert_eq!(read(&mut engine), expected, "{settings:?}");
        engine.set(R::Control, control::RELEASE.into());
        assert_eq!(read(&mut engine), [0; 3], "released");
        engine.clocks(100);
    }
}

fn packets_by_the_parallel_port_are_whole_whatever_the_host_reads(project: &Project) {
    let mut engine = Engine::new(project);
    engine.code = noise;
    engine.parallel = true;
    let dice = &mut Dice::new(47);
    for _ in 0..12 {
        let settings = Settings { packets: true, frames: 2, ..random(dice) };
        let light = engine.start(&settings);
        engine.sent.clear();
        let ends = |sent: &[u8]| sent.windows(4).filter(|window| *window == [0; 4]).count();
        while ends(&engine.sent) < 3 {
            assert!(!engine.bench.is("frame_ready"), "the frame is not the host's");
            assert!(!engine.bench.is("byte_valid"), "nor are its bytes");
            engine.bench.set("parallel_ready", !dice.once_in(4));
            engine.bench.set("byte_taken", dice.once_in(2));
            engine.tick();
            match dice.range(0, 300) {
                0 => _ = engine.access(READ_FRAME, 0, 0),
                1 => engine.set(R::Control, control::RELEASE.into()),
                _ => {}
            }
            assert!(engine.clock - light < 9000, "never sent: {:x?}", engine.sent);
        }
        engine.bench.set("byte_taken", false);
        let packets: Vec<_> = engine.sent.split(|&byte| byte == 0).collect();
        let packets: Vec<_> = packets.into_iter().filter(|bytes| !bytes.is_empty()).collect();
        for (number, packet) in packets.iter().enumerate() {
            let mut packet = packet.to_vec();
            let opened: DeviceMessage<'_> = open(&mut packet).unwrap();
            let DeviceMessage::Frame(frame) = opened else { panic!("{opened:?}") };
            assert_eq!(frame.sequence as usize, number);
            if number == 0 {
                let sums = Engine::sums_of_noise(&settings, light);
                let differences = sums.iter().map(|[plus, minus]| *plus as i64 - *minus as i64);
                assert!(frame.samples.iter().eq(differences), "{settings:?}");
            }
        }
        assert_eq!(packets.len(), 2);
        engine.clocks(50);
    }
}
