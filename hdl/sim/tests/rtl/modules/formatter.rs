//! Tests of frames and bursts as bytes.

use super::bundles::{HEADER, Settings};
use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::fpga::{Header, Sums};
use nirspi_wire::{FrameFlags, crc32};

laws![
    a_frame_has_the_bytes_that_wire_lays_down_and_no_more,
    a_burst_is_its_words_low_byte_first,
    whatever_is_opened_ends_what_was_going_on,
];

/// A bank and a burst behind the module, with the clocks that they need to answer.
struct Rig<'d> {
    bench: Bench,
    dice: &'d mut Dice,
    sums: Vec<u64>,
    words: Vec<u64>,
    sums_asked: [u64; 3],
    words_asked: [u64; 2],
}

impl<'d> Rig<'d> {
    fn new(project: &Project, dice: &'d mut Dice) -> Self {
        let bench = Bench::new(project, "formatter");
        let sums = (0..2048).map(|_| dice.next() >> 16).collect();
        let words = (0..4096).map(|_| dice.range(0, 0xFFFF)).collect();
        Self { bench, dice, sums, words, sums_asked: [0; 3], words_asked: [0; 2] }
    }

    /// One clock; returns the byte of this clock.
    fn tick(&mut self, taken: bool) -> Option<u8> {
        self.bench.set("sum_word", self.sums[self.sums_asked[2] as usize]);
        self.bench.set("raw_word", self.words[self.words_asked[1] as usize]);
        self.bench.set("taken", taken);
        let [a, b, _] = self.sums_asked;
        self.sums_asked = [self.bench.get("sum_address"), a, b];
        self.words_asked = [self.bench.get("raw_address"), self.words_asked[0]];
        let byte = (self.bench.is("valid") && taken).then(|| self.bench.get("octet") as u8);
        self.bench.tick();
        byte
    }

    fn open(&mut self, what: &str) {
        self.bench.set(what, true);
        // The engine sets `open_none` together with either of the others.
        self.bench.set("open_none", true);
        self.tick(false);
        self.bench.set(what, false);
        self.bench.set("open_none", false);
    }

    /// Bytes until none has come for long; the host sometimes makes them wait.
    fn bytes(&mut self, at_most: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut idle = 0;
        while idle < 60 && bytes.len() < at_most {
            let taken = !self.dice.once_in(4);
            let byte = self.tick(taken);
            idle = if byte.is_some() { 0 } else { idle + 1 };
            bytes.extend(byte);
        }
        bytes
    }

    /// Gives the module a frame; returns the expected bytes.
    fn frame(&mut self, patterns: u64, differential: bool) -> Vec<u8> {
        let settings = Settings {
            patterns,
            differential,
            sweeps: self.dice.next() >> 32,
            ..Settings::default()
        };
        let header = Header {
            patterns: patterns as u16,
            flags: FrameFlags(self.dice.next() as u16),
            sequence: self.dice.next() as u32,
            sweeps: settings.sweeps as u32,
            over_range: self.dice.next() as u32,
            lost: self.dice.next() as u32,
            clock: self.dice.next(),
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
        let mut bytes = header.to_bytes().to_vec();
        for index in 0..patterns as usize {
            let negative = if differential { self.sums[1024 + index] } else { 0 };
            bytes.extend(Sums { positive: self.sums[index], negative }.to_bytes());
        }
        bytes.extend(crc32(&bytes).to_le_bytes());
        bytes
    }
}

fn a_frame_has_the_bytes_that_wire_lays_down_and_no_more(project: &Project) {
    let dice = &mut Dice::new(21);
    let mut rig = Rig::new(project, dice);
    for (patterns, differential) in [(1, true), (1, false), (2, true), (37, false), (1024, true)] {
        let expected = rig.frame(patterns, differential);
        rig.open("open_frame");
        assert!(rig.bytes(usize::MAX) == expected, "{patterns} patterns, {differential}");
    }
}

fn a_burst_is_its_words_low_byte_first(project: &Project) {
    let dice = &mut Dice::new(22);
    let mut rig = Rig::new(project, dice);
    for raw_length in [1, 2, 50, 4096] {
        let settings = Settings { raw: true, raw_length, ..Settings::default() };
        rig.bench.set_fields("settings", &settings.fields());
        rig.open("open_raw");
        let expected: Vec<u8> = rig.words[..raw_length as usize]
            .iter()
            .flat_map(|&word| (word as u16).to_le_bytes())
            .collect();
        assert!(rig.bytes(usize::MAX) == expected, "{raw_length} samples");
    }
}

fn whatever_is_opened_ends_what_was_going_on(project: &Project) {
    let dice = &mut Dice::new(23);
    let mut rig = Rig::new(project, dice);
    for _ in 0..40 {
        let expected = rig.frame(9, true);
        let abandoned = rig.dice.range(0, 150) as usize;
        rig.open("open_frame");
        assert!(rig.bytes(abandoned) == expected[..abandoned.min(expected.len())]);
        let again = rig.dice.once_in(2);
        rig.open(if again { "open_frame" } else { "open_none" });
        assert!(rig.bytes(usize::MAX) == if again { expected } else { Vec::new() });
    }
}
