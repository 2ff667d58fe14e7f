//! Tests of packets as bytes, against the golden model.

use super::bundles::{HEADER, STAMP, Settings};
use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_hdl_model::{Stamp, packet};
use nirspi_wire::FrameFlags;
use nirspi_wire::fpga::{Header, Sums};
use nirspi_wire::samples::Width;

laws![
    a_packet_is_that_of_the_golden_model_and_nothing_follows_it,
    a_reader_may_wait_for_any_time,
    a_packet_begins_soon_and_then_has_no_gap,
    whatever_is_opened_ends_what_was_going_on,
];

/// Clocks in which the fastest host reads `FAST_LEAD_BYTES` zeros, 160 bytes of two periods of 16.7 ns each, less what
/// its access takes to cross to this clock. The fastest host of `LEAD_BYTES` zeros, 64 bytes of two periods of 68.3 ns
/// each, has more.
const LEAD_CLOCKS: u64 = 640;

/// A bank behind the module, with the clocks that it needs to answer.
struct Rig<'d> {
    bench: Bench,
    dice: &'d mut Dice,
    /// Positive sums, then negative sums.
    sums: Vec<u64>,
    asked: [u64; 3],
}

impl<'d> Rig<'d> {
    fn new(project: &Project, dice: &'d mut Dice) -> Self {
        let bench = Bench::new(project, "packer");
        Self { bench, dice, sums: vec![0; 2048], asked: [0; 3] }
    }

    /// One clock; returns the byte of this clock.
    fn tick(&mut self, taken: bool) -> Option<u8> {
        self.bench.set("sum_word", self.sums[self.asked[2] as usize]);
        self.bench.set("taken", taken);
        let [a, b, _] = self.asked;
        self.asked = [self.bench.get("sum_address"), a, b];
        let byte = (self.bench.is("valid") && taken).then(|| self.bench.get("octet") as u8);
        self.bench.tick();
        byte
    }

    fn begin(&mut self, what: &str) {
        self.bench.set(what, true);
        // The engine ends everything with each access to data.
        self.bench.set("close", true);
        self.tick(false);
        self.bench.set(what, false);
        self.bench.set("close", false);
    }

    /// Bytes until none has come for long; the reader lets one in `pace` wait.
    fn bytes(&mut self, at_most: usize, pace: u64) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut idle = 0;
        // A block of 254 bytes takes some 800 clocks.
        while idle < 1500 && bytes.len() < at_most {
            let taken = !self.dice.once_in(pace);
            let byte = self.tick(taken);
            idle = if byte.is_some() { 0 } else { idle + 1 };
            bytes.extend(byte);
        }
        bytes
    }

    /// A difference with many zeros, with none, or with any bytes.
    fn difference(&mut self, kind: u64) -> u32 {
        let bytes = [0; 4].map(|_| {
            let byte = self.dice.range(1, 0xFF) as u8;
            if kind == 0 && self.dice.once_in(2) { 0 } else { byte }
        });
        if kind == 2 { self.dice.next() as u32 } else { u32::from_le_bytes(bytes) }
    }

    /// Gives the module a frame; returns the expected bytes.
    fn frame(&mut self, patterns: u64, differential: bool, narrow: bool) -> Vec<u8> {
        let kind = self.dice.range(0, 2);
        for index in 0..patterns as usize {
            let wanted = self.difference(kind);
            let negative = self.dice.next() >> 16;
            let base = if differential { negative as u32 } else { 0 };
            let high = (self.dice.next() >> 48) << 32;
            self.sums[index] = high | u64::from(base.wrapping_add(wanted));
            self.sums[1024 + index] = negative;
        }
        let sweeps = if self.dice.once_in(2) { 1 } else { self.dice.next() >> 32 };
        let settings = Settings { patterns, differential, narrow, sweeps, ..Settings::default() };
        let any = self.dice.next() as u16;
        let rest = FrameFlags(any & !FrameFlags::DIFFERENTIAL.0);
        let run = self.dice.next() as u16;
        let clock = self.dice.next() >> self.dice.range(0, 40);
        let time_us = self.dice.next() >> self.dice.range(0, 40);
        let elapsed = self.dice.next() >> self.dice.range(0, 60);
        let header = Header {
            patterns: patterns as u16,
            flags: if differential { rest.with(FrameFlags::DIFFERENTIAL) } else { rest },
            sequence: self.dice.next() as u32,
            sweeps: settings.sweeps as u32,
            over_range: self.dice.next() as u32,
            lost: self.dice.next() as u32,
            clock: clock.wrapping_add(elapsed),
        };
        let values = [
            header.flags.0.into(),
            header.sequence.into(),
            header.over_range.into(),
            header.lost.into(),
            header.clock,
            // The sum of its samples, which no byte shows.
            self.dice.next(),
        ];
        let fields: Vec<_> = values.into_iter().zip(HEADER).collect();
        self.bench.set_fields("header", &fields);
        self.bench.set_fields("settings", &settings.fields());
        let fields: Vec<_> = [run.into(), clock, time_us].into_iter().zip(STAMP).collect();
        self.bench.set_fields("stamp", &fields);
        let (positive, negative) = self.sums.split_at(1024);
        let bank: Vec<Sums> = positive
            .iter()
            .zip(negative)
            .map(|(&positive, &negative)| Sums { positive, negative })
            .collect();
        let width = if narrow { Width::Bits24 } else { Width::Bits32 };
        packet(&header, &bank, &Stamp { run, clock, time_us }, width)
    }
}

fn a_packet_is_that_of_the_golden_model_and_nothing_follows_it(project: &Project) {
    let dice = &mut Dice::new(31);
    let mut rig = Rig::new(project, dice);
    let large =
        [(1024, true), (1024, false), (1023, true), (1024, true), (1024, false), (1023, true)];
    for scenario in 0..300 {
        let (patterns, differential) = match large.get(scenario) {
            Some(&pair) => pair,
            None => (rig.dice.range(1, 150), rig.dice.once_in(2)),
        };
        let narrow = if scenario < large.len() { scenario >= 3 } else { rig.dice.once_in(2) };
        let expected = rig.frame(patterns, differential, narrow);
        rig.begin("open");
        let found = rig.bytes(usize::MAX, 4);
        assert!(
            found == expected,
            "scenario {scenario}: {patterns} patterns, {differential}, narrow {narrow}"
        );
    }
}

fn a_reader_may_wait_for_any_time(project: &Project) {
    let dice = &mut Dice::new(32);
    let mut rig = Rig::new(project, dice);
    for scenario in 0..4 {
        let expected = rig.frame(1024, true, scenario % 2 == 1);
        rig.begin("open");
        let mut found = Vec::new();
        while found.len() < expected.len() {
            for _ in 0..rig.dice.range(0, 12_000) {
                rig.tick(false);
            }
            let at_most = (expected.len() - found.len()).min(1500);
            let more = rig.bytes(at_most, 1000);
            assert!(!more.is_empty(), "{} of {} bytes", found.len(), expected.len());
            found.extend(more);
        }
        assert!(found == expected);
    }
}

/// The fastest host takes a byte by two clocks of 60 MHz: six bytes in 25 clocks.
fn a_packet_begins_soon_and_then_has_no_gap(project: &Project) {
    const PACE: [u64; 6] = [4, 4, 4, 4, 4, 5];
    let dice = &mut Dice::new(34);
    let mut rig = Rig::new(project, dice);
    let mut longest = [0; 2];
    for scenario in 0..80 {
        let patterns = if scenario < 8 { 1024 } else { rig.dice.range(1, 200) };
        let narrow = scenario % 4 >= 2;
        let expected = rig.frame(patterns, scenario % 2 == 0, narrow);
        rig.begin("open");
        let mut wait = 0;
        while !rig.bench.is("valid") {
            rig.tick(false);
            wait += 1;
            assert!(wait < LEAD_CLOCKS, "{patterns} patterns: nothing yet");
        }
        let longest = &mut longest[usize::from(narrow)];
        *longest = wait.max(*longest);
        for (at, &byte) in expected.iter().enumerate() {
            assert_eq!(rig.tick(true), Some(byte), "byte {at} of {}", expected.len());
            for _ in 1..PACE[at % PACE.len()] {
                rig.tick(false);
            }
        }
    }
    println!("the longest waits were of {longest:?} clocks, with samples of 32 and of 24 bits");
}

fn whatever_is_opened_ends_what_was_going_on(project: &Project) {
    let dice = &mut Dice::new(33);
    let mut rig = Rig::new(project, dice);
    for _ in 0..60 {
        let narrow = rig.dice.once_in(2);
        let expected = rig.frame(90, true, narrow);
        let abandoned = rig.dice.range(0, 300) as usize;
        rig.begin("open");
        assert!(rig.bytes(abandoned, 4) == expected[..abandoned.min(expected.len())]);
        // At any moment of the work, too.
        for _ in 0..rig.dice.range(0, 200) {
            rig.tick(false);
        }
        let again = rig.dice.once_in(2);
        rig.begin(if again { "open" } else { "close" });
        assert!(rig.bytes(usize::MAX, 4) == if again { expected } else { Vec::new() });
    }
}
