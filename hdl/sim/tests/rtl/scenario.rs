//! Random runs of the camera: settings, actions of the host, accidents.
//!
//! A scenario depends on its seed alone, and never on an answer of the RTL.

use crate::rig::{Port, Rig};
use nirspi_wire::host_port::{READ_FRAME, READ_RAW};
use nirspi_wire::register::{DUTY_LIMIT_MAX, Design, ORDER_TABLE, Register as R, control, mode};

/// Random numbers (SplitMix64).
pub struct Dice(u64);

impl Dice {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// From `low` to `high`, both included.
    pub fn range(&mut self, low: u64, high: u64) -> u64 {
        low + self.next() % (high - low + 1)
    }

    /// True once in `n`.
    pub fn once_in(&mut self, n: u64) -> bool {
        self.next().is_multiple_of(n)
    }

    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.range(0, from.len() as u64 - 1) as usize]
    }
}

/// Clocks of the ADC that a frame may take at most.
const FRAME_CLOCKS: u64 = 6000;

/// What packets carry beside their frames: some registers of it, and the base of the clock.
fn stamp(rig: &mut Rig, dice: &mut Dice) {
    for register in [R::Run, R::TimeLow, R::TimeHigh] {
        if !dice.once_in(4) {
            rig.set(register, (dice.next() >> dice.range(0, 63)) as u32);
        }
    }
    if !dice.once_in(4) {
        rig.read(R::ClockLow.address());
    }
}

/// Writes settings with these bits of `Mode`, of which one set in sixteen is invalid; returns the number of clocks of
/// a frame.
fn set_up(rig: &mut Rig, dice: &mut Dice, more: u32) -> u64 {
    let patterns = match dice.range(0, 9) {
        0..=3 => dice.range(1, 3),
        4..=8 => dice.range(1, 24),
        _ => dice.range(1, 1024),
    };
    let dwell = if dice.once_in(3) { 1 } else { dice.range(1, 9) };
    let dwell = if dice.once_in(12) { dice.range(1, FRAME_CLOCKS / patterns) } else { dwell };
    let dwell = dwell.min(FRAME_CLOCKS / patterns).max(1);
    let sweeps = dice.range(1, (FRAME_CLOCKS / (patterns * dwell)).clamp(1, 5));
    let differential = dice.once_in(2);
    let mut bits = more | if differential { mode::DIFFERENTIAL } else { 0 };
    bits |= if dice.once_in(2) { mode::ALTERNATING } else { 0 };
    bits |= match dice.range(0, 3) {
        0 => 0,
        1 => mode::ORDER_SEQUENCY,
        2 => mode::ORDER_TABLE,
        _ => mode::ORDER_TABLE | mode::ORDER_SEQUENCY,
    };
    bits |= if dice.once_in(8) { mode::TEST_SOURCE } else { 0 };
    if bits & mode::ORDER_TABLE != 0 {
        for i in 0..patterns.min(24) {
            let entry = if dice.once_in(8) { 0 } else { dice.next() as u32 };
            rig.write(ORDER_TABLE + i as u16, entry);
        }
    }
    rig.set(R::Mode, bits);
    rig.set(R::Patterns, patterns as u32);
    rig.set(R::Dwell, dwell as u32);
    rig.set(R::Blank, if dice.once_in(3) { 0 } else { dice.range(0, dwell - 1) as u32 });
    rig.set(
        R::Latency,
        if dice.once_in(4) { dice.pick(&[0, 1, 63]) } else { dice.range(0, 63) as u32 },
    );
    rig.set(R::Sweeps, sweeps as u32);
    rig.set(R::Frames, if dice.once_in(3) { 0 } else { dice.range(1, 20) as u32 });
    rig.set(R::RawLength, if dice.once_in(8) { 4096 } else { dice.range(1, 200) as u32 });
    let frame = patterns * dwell * sweeps * if differential { 2 } else { 1 };
    let watchdog = if dice.once_in(6) { dice.range(1, 3000) as u32 } else { 20_000 };
    rig.set(R::Watchdog, watchdog);
    let spent = dice.range(0, 2 * frame) as u32;
    rig.set(
        R::DutyLimit,
        if dice.once_in(6) { dice.pick(&[0, 1, 2, spent]) } else { DUTY_LIMIT_MAX },
    );
    let trip = dice.range(1, 40) as u32;
    rig.set(R::OverRangeTrip, if dice.once_in(4) { trip } else { 0 });
    if dice.once_in(16) {
        let (register, value) = dice.pick(&[
            (R::Mode, 1 << 6),
            (R::Patterns, 1025),
            (R::Patterns, 0),
            (R::Dwell, 0),
            (R::Dwell, 1 << 16),
            (R::Blank, dwell as u32),
            (R::Latency, 64),
            (R::Sweeps, 0),
            (R::RawLength, 4097),
            (R::RawLength, 0),
            (R::Watchdog, 0),
            (R::Watchdog, 125_000_001),
            (R::DutyLimit, DUTY_LIMIT_MAX + 1),
        ]);
        rig.set(register, value);
    }
    frame
}

/// Reads what the signal meter asks of a delivered frame, if there is one.
fn measures(rig: &mut Rig) {
    for register in [R::SumLow, R::SumHigh, R::OverRange] {
        rig.read(register.address());
    }
}

/// An action of the host, or an accident, during a run.
fn deed(rig: &mut Rig, dice: &mut Dice, frame: u64) {
    match dice.range(0, 25) {
        0..=3 => rig.wait_adc(dice.range(0, 2 * frame + 100)),
        4 => rig.wait_adc(dice.range(0, 100)),
        5..=9 => {
            rig.stream(false, usize::MAX);
            measures(rig);
            if !dice.once_in(5) {
                rig.set(R::Control, control::RELEASE);
            }
        }
        10 => rig.stream(false, dice.range(1, 60) as usize),
        11 => rig.stream(true, if dice.once_in(3) { usize::MAX } else { 40 }),
        12..=14 => {
            let register = dice.pick(R::ALL);
            rig.read(register.address());
        }
        15 => {
            rig.read(dice.pick(&[
                ORDER_TABLE,
                ORDER_TABLE + 3,
                ORDER_TABLE + 1023,
                0x800,
                0x17,
                6,
            ]));
        }
        16 => rig.set(R::Control, dice.range(0, 31) as u32),
        17 => rig.set(R::Control, control::RELEASE),
        18 => rig.write(ORDER_TABLE + dice.range(0, 5) as u16, dice.next() as u32),
        19 => {
            let register =
                dice.pick(&[R::Patterns, R::Dwell, R::Blank, R::Sweeps, R::Mode, R::Latency]);
            rig.set(register, dice.range(0, 8) as u32);
        }
        20 if dice.once_in(2) => rig.write_cut_short(R::Control.address(), control::STOP),
        20 => {
            let register = dice.pick(&[R::Control, R::Dwell, R::Sweeps, R::Scratch]);
            rig.write_damaged(
                register.address(),
                dice.next() as u32,
                [(); 3].map(|()| dice.next()),
            );
        }
        21 if dice.once_in(3) => {
            rig.interlock(false);
            rig.wait(dice.range(0, 60) as u32);
            rig.interlock(true);
            rig.wait(dice.range(0, 60) as u32);
        }
        21 => rig.write(dice.pick(&[0, 1, 2, 5, 0x800, 0xFFFF]), dice.next() as u32),
        22 | 23 => rig.set(R::Control, control::START),
        _ => rig.set(R::Control, control::CLEAR_FAULT | control::START),
    }
}

/// Configures, starts, runs and reads out one scenario.
pub fn run(rig: &mut Rig, seed: u64) {
    act(rig, seed, 0, |_| {});
}

/// The same with frames that are sent as packets, but where an action of the host has ended that. After every eighth
/// scenario, a run sends frames as they are.
pub fn packets(rig: &mut Rig, seed: u64) {
    packets_with(rig, seed, mode::PACKETS);
}

/// The same with samples of 24 bits, but in every eighth scenario. Half of the reads are clocked by `sck`.
pub fn narrow_packets(rig: &mut Rig, seed: u64) {
    rig.by_sck = seed % 4 >= 2;
    let width = if seed % 8 == 3 { 0 } else { mode::NARROW };
    packets_with(rig, seed ^ 1 << 20, mode::PACKETS | width);
    rig.by_sck = false;
}

/// The same with these bits of `Mode`.
pub fn packets_with(rig: &mut Rig, seed: u64, bits: u32) {
    let mut dice = Dice::new(!seed);
    act(rig, seed, bits, |rig| {
        if dice.once_in(3) {
            stamp(rig, &mut dice);
        }
    });
    if seed % 8 == 7 {
        let start = control::STOP | control::CLEAR_FAULT | control::START;
        for (register, value) in [(R::Mode, 0), (R::Patterns, 9), (R::Dwell, 3), (R::Blank, 0)] {
            rig.set(register, value);
        }
        rig.set(R::Sweeps, 1);
        rig.set(R::Control, start);
        rig.wait_adc(300);
        rig.stream(false, usize::MAX);
    }
}

/// A scenario with these bits of `Mode`, and what comes before the start and before each action. Every eighth is without
/// light.
fn act(rig: &mut Rig, seed: u64, more: u32, mut before: impl FnMut(&mut Rig)) {
    let dice = &mut Dice::new(seed);
    rig.port = Port {
        host_ps: dice.pick(&[10_000, 8_000, 7_000, 13_000]),
        half: dice.pick(&[3, 3, 4]),
        quad: !dice.once_in(8),
        glitches: seed % 2 == 1,
    };
    rig.over_range_rate = dice.pick(&[0, 1, 8, 64, 255]);
    rig.interlock(!dice.once_in(32));
    let more = more | if seed % 8 == 6 { mode::UNLIT } else { 0 };
    let frame = set_up(rig, dice, more);
    before(rig);
    let start = if dice.once_in(5) { control::START_RAW } else { control::START };
    rig.set(R::Control, control::STOP | control::CLEAR_FAULT | start);
    for _ in 0..dice.range(1, 12) {
        before(rig);
        deed(rig, dice, frame);
        if rig.mismatch.is_some() {
            return;
        }
    }
    rig.interlock(true);
    rig.wait_adc(dice.range(0, frame + 100));
    for register in
        [R::Status, R::Fault, R::FramesMade, R::FramesLost, R::ClockLow, R::ClockHigh, R::Writes]
    {
        rig.read(register.address());
    }
    rig.stream(false, usize::MAX);
    measures(rig);
    rig.stream(true, 100);
}

/// Short frames and a host that is slow by turns: none, one or two frames wait while a third is made, some come again,
/// and some are lost.
pub fn slow_readers(rig: &mut Rig, seed: u64) {
    let narrow = if seed % 16 >= 8 { mode::NARROW } else { 0 };
    slow_readers_with(rig, seed, if seed % 4 < 2 { 0 } else { mode::PACKETS | narrow });
}

/// The same with these bits of `Mode`.
pub fn slow_readers_with(rig: &mut Rig, seed: u64, bits: u32) {
    let dice = &mut Dice::new(!seed);
    rig.port =
        Port { host_ps: dice.range(8_420, 11_390), half: 3, quad: true, glitches: seed % 2 == 1 };
    rig.over_range_rate = 2;
    rig.interlock(true);
    let (patterns, dwell, sweeps) = (dice.range(1, 6), dice.range(10, 120), dice.range(1, 3));
    let halves = dice.range(1, 2);
    let frame = patterns * dwell * sweeps * halves;
    stamp(rig, dice);
    rig.set(R::Mode, bits | if halves == 2 { mode::DIFFERENTIAL } else { 0 });
    for (register, value) in [(R::Patterns, patterns), (R::Dwell, dwell), (R::Sweeps, sweeps)] {
        rig.set(register, value as u32);
    }
    rig.set(R::Blank, dice.range(0, 9) as u32);
    rig.set(R::Latency, dice.range(0, 63) as u32);
    rig.set(R::Frames, if dice.once_in(2) { 0 } else { dice.range(2, 12) as u32 });
    rig.set(R::Watchdog, 1_000_000);
    rig.set(R::DutyLimit, DUTY_LIMIT_MAX);
    rig.set(R::OverRangeTrip, 0);
    rig.set(R::Control, control::STOP | control::CLEAR_FAULT | control::START);
    for _ in 0..dice.range(6, 14) {
        match dice.range(0, 9) {
            0..=2 => rig.wait_adc(dice.range(0, 3 * frame)),
            3 => rig.stream(false, dice.range(1, 40) as usize),
            // The frame comes again unless it is released.
            4 => rig.stream(false, usize::MAX),
            // The FPGA does not take this release, so the frame comes again too.
            5 => rig.write_damaged(
                R::Control.address(),
                control::RELEASE,
                [(); 3].map(|()| dice.next()),
            ),
            // The second release is one of the frame behind, or of nothing.
            6 => (0..dice.range(1, 3)).for_each(|_| rig.set(R::Control, control::RELEASE)),
            _ => {
                rig.stream(false, usize::MAX);
                measures(rig);
                rig.set(R::Control, control::RELEASE);
            }
        }
        rig.read(R::FramesMade.address());
        rig.read(R::FramesLost.address());
        if rig.mismatch.is_some() {
            return;
        }
    }
    rig.set(R::Control, control::STOP);
    for _ in 0..3 {
        rig.stream(false, usize::MAX);
        measures(rig);
        rig.set(R::Control, control::RELEASE);
    }
}

/// The scenarios of packets, of slow readers and of long blocks, with reads that `sck` clocks.
pub fn packets_by_sck(rig: &mut Rig, seed: u64) {
    rig.by_sck = true;
    match seed % 8 {
        0..4 => packets(rig, seed),
        // Those of packets.
        4..7 => slow_readers(rig, seed | 2),
        _ => long_blocks(rig, seed),
    }
    (rig.by_sck, rig.tilt) = (false, 0);
}

/// Patterns, dwell and complements with which a sum is used again after 1 to 6 clocks, and after
/// many.
const RETURNS: [(u64, u64, bool); 10] = [
    (1, 1, false),
    (2, 1, false),
    (1, 1, true),
    (1, 2, false),
    (3, 1, false),
    (2, 1, true),
    (5, 1, false),
    (3, 1, true),
    (7, 1, false),
    (2, 300, true),
];

/// Frames of few patterns with sums of about `2^sum_bits`.
pub fn long_sums(rig: &mut Rig, seed: u64) {
    let dice = &mut Dice::new(seed);
    rig.interlock(true);
    rig.fade = 13;
    rig.set(R::Watchdog, 1_000_000);
    rig.set(R::OverRangeTrip, 0);
    let (patterns, dwell, differential) = RETURNS[(seed % RETURNS.len() as u64) as usize];
    let samples = dice.range(1, (5 << rig.variant.sum_bits) / 8192);
    rig.set(R::Dwell, dwell as u32);
    rig.set(R::Blank, 0);
    rig.set(R::Sweeps, samples.div_ceil(dwell) as u32);
    rig.set(R::Patterns, patterns as u32);
    rig.set(
        R::Mode,
        if differential { mode::DIFFERENTIAL | mode::ORDER_TABLE } else { mode::ORDER_TABLE },
    );
    rig.set(R::Latency, dice.range(0, 63) as u32);
    rig.set(R::Frames, 3);
    rig.set(R::DutyLimit, DUTY_LIMIT_MAX);
    rig.write(ORDER_TABLE, 5);
    rig.write(ORDER_TABLE + 1, 6);
    rig.set(R::Control, control::STOP | control::CLEAR_FAULT | control::RELEASE | control::START);
    for _ in 0..3 {
        rig.wait_adc(dice.range(2, 9) * samples + 300);
        rig.stream(false, usize::MAX);
        rig.set(R::Control, control::RELEASE);
    }
}

/// Packets of many patterns whose differences have one sign, so that most bytes are not zero and blocks of COBS are
/// as long as they can be.
pub fn long_blocks(rig: &mut Rig, seed: u64) {
    let dice = &mut Dice::new(seed);
    rig.port.host_ps = dice.range(8_420, 11_390);
    rig.interlock(true);
    let (patterns, dwell) = (dice.range(65, 300), dice.range(1, 4));
    rig.tilt = 2 * dwell;
    stamp(rig, dice);
    let narrow = if seed % 16 >= 8 { mode::NARROW } else { 0 };
    rig.set(R::Mode, mode::DIFFERENTIAL | mode::PACKETS | narrow);
    rig.set(R::Patterns, patterns as u32);
    rig.set(R::Dwell, dwell as u32);
    rig.set(R::Blank, 0);
    rig.set(R::Sweeps, 1);
    rig.set(R::Frames, 0);
    rig.set(R::Latency, dice.range(0, 63) as u32);
    rig.set(R::Watchdog, 1_000_000);
    rig.set(R::OverRangeTrip, 0);
    rig.set(R::DutyLimit, DUTY_LIMIT_MAX);
    rig.set(R::Control, control::STOP | control::CLEAR_FAULT | control::RELEASE | control::START);
    for _ in 0..2 {
        rig.wait_adc(2 * patterns * dwell + 200);
        rig.stream(false, usize::MAX);
        rig.set(R::Control, control::RELEASE);
    }
}

/// A run that spends its light budget at about the end of a duty window.
pub fn across_a_window(rig: &mut Rig, seed: u64) {
    let dice = &mut Dice::new(seed);
    rig.interlock(true);
    rig.set(R::Watchdog, 1_000_000);
    rig.set(R::Patterns, dice.range(1, 5) as u32);
    rig.set(R::Mode, if dice.once_in(2) { mode::DIFFERENTIAL } else { 0 });
    rig.set(R::DutyLimit, dice.range(200, 3000) as u32);
    for _ in 0..dice.range(3, 8) {
        rig.set(R::Control, control::STOP | control::CLEAR_FAULT | control::START);
        rig.wait_adc(dice.range(0, 1500));
        rig.read(R::Fault.address());
        rig.read(R::ClockLow.address());
        rig.read(R::ClockHigh.address());
        rig.stream(false, usize::MAX);
    }
}

/// The ADC's clock goes away in a run, in the middle of an access or between accesses, and comes back.
pub fn clock_lost(rig: &mut Rig, seed: u64) {
    let dice = &mut Dice::new(seed);
    rig.port.host_ps = dice.range(8_500, 11_390);
    rig.interlock(true);
    rig.check_clocks();
    for round in 0..12 {
        rig.set(R::Patterns, dice.range(1, 8) as u32);
        rig.set(R::Scratch, dice.next() as u32);
        let start = (R::Control.address(), control::START);
        let scratch = (R::Scratch.address(), dice.next() as u32);
        let (address, value) = dice.pick(&[start, scratch]);
        rig.set(R::Control, start.1);
        rig.wait_adc(dice.range(0, 400));
        if dice.once_in(3) {
            rig.stream(false, dice.range(1, 40) as usize);
        }
        match dice.range(0, 2) {
            0 => rig.lose_adc_clock(),
            _ => rig.write_and_lose_adc_clock(address, value, dice.range(0, 30) as u32),
        }
        rig.wait(dice.range(20, 300) as u32);
        for _ in 0..dice.range(1, 5) {
            let register = dice.pick(R::ALL);
            rig.write(register.address(), value);
            rig.read(dice.pick(R::ALL).address());
            rig.read(ORDER_TABLE + dice.range(0, 1023) as u16);
        }
        rig.stream_zeros(dice.pick(&[READ_FRAME, READ_RAW]), 5);
        rig.packet_undriven();
        if round % 6 == 0 {
            rig.check_clocks();
        }
        rig.bring_adc_clock_back(dice.pick(&[Design::Camera, Design::BringUp]));
        rig.wait_adc(dice.range(5, 200));
        for &register in R::ALL {
            rig.read(register.address());
        }
    }
}
