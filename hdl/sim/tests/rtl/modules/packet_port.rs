//! Tests of the reads that `sck` clocks, bit by bit, as defined in `nirspi_wire::host_port`.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::host_port::{DUMMY_CYCLES, QUAD, READ_FRAME, READ_PACKET};
use std::collections::VecDeque;

laws![
    a_read_gives_the_bytes_of_its_own_access_without_a_gap,
    a_slow_engine_leaves_zeros_between_its_bytes_and_loses_none,
    another_opcode_and_one_that_may_not_begin_read_nothing,
    a_read_that_is_cut_short_leaves_nothing_behind,
];

/// Period of the ADC's clock.
const ADC_PS: u64 = 8_000;

/// Clocks of `sck` before the first bits of a byte.
const LEAD: usize = 8 + 4 + DUMMY_CYCLES as usize;

/// Pins on one side, the engine on the other.
struct Rig {
    bench: Bench,
    now_ps: u64,
    adc_ps: u64,
    half_ps: u64,
    /// Clocks from the opcode until the access takes effect, while a read waits for that.
    access_in: Option<u32>,
    /// Clocks from that opcode to that effect.
    delay: u32,
    /// The access took effect.
    accessed: bool,
    /// Bytes that the engine has for this access. Before the access it offers bytes of an earlier one.
    bytes: VecDeque<u8>,
    /// Clocks between two bytes of the engine.
    pace: u64,
    since: u64,
    was_full: bool,
}

impl Rig {
    fn new(project: &Project) -> Self {
        let mut bench = Bench::new(project, "packet_port");
        bench.reset("clk_adc", "rst_adc");
        bench.reset("clk_sck", "rst_sck");
        bench.set("may_begin", true);
        Self {
            bench,
            now_ps: 0,
            adc_ps: 0,
            half_ps: 10_000,
            access_in: None,
            delay: 10,
            accessed: false,
            bytes: VecDeque::new(),
            pace: 1,
            since: 0,
            was_full: false,
        }
    }

    fn adc_clock(&mut self) {
        if self.access_in.is_none() && !self.accessed && self.bench.is("reads") {
            self.access_in = Some(self.delay);
        }
        let access = self.access_in == Some(0);
        self.access_in = self.access_in.and_then(|clocks| clocks.checked_sub(1));
        let stale = !self.accessed;
        let next = if stale { Some(0xEE) } else { self.bytes.front().copied() };
        let valid = next.is_some() && (stale || self.since >= self.pace);
        self.bench.set("access", access);
        self.bench.set("octet", next.unwrap_or(0));
        self.bench.set("byte_valid", valid);
        let full = self.bench.is("full");
        self.was_full |= full;
        self.since += 1;
        if valid && !stale && self.bench.is("takes") && !full {
            self.bytes.pop_front();
            self.since = 0;
        }
        self.accessed |= access;
        self.bench.edge("clk_adc");
    }

    fn wait(&mut self, ps: u64) {
        self.now_ps += ps;
        while self.adc_ps <= self.now_ps {
            self.adc_ps += ADC_PS;
            self.adc_clock();
        }
    }

    /// One period of `sck`; returns the lines before the rising edge, if they are driven.
    fn sck(&mut self, line: u8) -> Option<u8> {
        self.bench.set("line", line);
        self.wait(self.half_ps);
        let lines = self.bench.is("drives").then(|| self.bench.get("lines_out") as u8);
        self.bench.edge("clk_sck");
        self.wait(self.half_ps);
        lines
    }

    /// The port is not selected any more, for at least so long as a microcontroller takes to begin the next access.
    fn end(&mut self) {
        self.bench.reset("clk_sck", "rst_sck");
        assert!(!self.bench.is("drives") && !self.bench.is("reads"), "the lines are let go");
        (self.accessed, self.access_in) = (false, None);
        self.bytes.clear();
        self.wait(20_000);
    }

    /// So many clocks of a read, which may end early. Returns the levels that the port drives after the lead.
    fn read(&mut self, opcode: u8, clocks: usize) -> Vec<Option<u8>> {
        let bits = (0..8).rev().map(|bit| opcode >> bit & 1).chain(std::iter::repeat(0));
        let lines: Vec<_> = bits.take(clocks).map(|line| self.sck(line)).collect();
        assert!(lines.iter().take(LEAD).all(Option::is_none), "driven before its time");
        lines.into_iter().skip(LEAD).collect()
    }

    /// Whole bytes of a read of a packet.
    fn packet(&mut self, bytes: usize) -> Vec<u8> {
        let lines = self.read(READ_PACKET | QUAD, LEAD + 2 * bytes);
        let lines: Vec<u8> = lines.into_iter().map(|lines| lines.expect("driven")).collect();
        lines.chunks_exact(2).map(|pair| pair[0] << 4 | pair[1]).collect()
    }
}

fn bytes(dice: &mut Dice, count: u64) -> VecDeque<u8> {
    (0..count).map(|_| dice.range(1, 255) as u8).collect()
}

fn a_read_gives_the_bytes_of_its_own_access_without_a_gap(project: &Project) {
    let dice = &mut Dice::new(41);
    let mut rig = Rig::new(project);
    for _ in 0..120 {
        let any = dice.range(8_334, 40_000);
        rig.half_ps = dice.pick(&[8_334, 9_375, any]);
        rig.delay = dice.range(6, 60) as u32;
        let count = dice.range(0, 120);
        rig.bytes = bytes(dice, count);
        let expected = Vec::from(rig.bytes.clone());
        let found = rig.packet(count as usize + 60);
        rig.end();
        let zeros = found.iter().take_while(|&&byte| byte == 0).count();
        let zeros = if count == 0 { 0 } else { zeros };
        assert!(found[zeros..].starts_with(&expected), "{found:x?}, expected {expected:x?}");
        assert!(found[zeros + expected.len()..].iter().all(|&byte| byte == 0), "{found:x?}");
    }
    assert!(rig.was_full);
}

fn a_slow_engine_leaves_zeros_between_its_bytes_and_loses_none(project: &Project) {
    let dice = &mut Dice::new(42);
    let mut rig = Rig::new(project);
    let mut gaps = 0;
    for _ in 0..40 {
        rig.half_ps = dice.range(8_334, 30_000);
        rig.pace = dice.range(1, 20);
        rig.bytes = bytes(dice, 50);
        let expected = Vec::from(rig.bytes.clone());
        let found = rig.packet(700);
        rig.end();
        let begin = found.iter().position(|&byte| byte != 0).expect("a byte");
        gaps += found[begin..][..50].iter().filter(|&&byte| byte == 0).count();
        assert_eq!(found.into_iter().filter(|&byte| byte != 0).collect::<Vec<_>>(), expected);
    }
    assert!(gaps > 100, "{gaps}");
}

fn another_opcode_and_one_that_may_not_begin_read_nothing(project: &Project) {
    let mut rig = Rig::new(project);
    let wanted = READ_PACKET | QUAD;
    let others = (0..8).map(|bit| (wanted ^ 1 << bit, true));
    for (opcode, may_begin) in others.chain([(READ_FRAME | QUAD, true), (wanted, false)]) {
        rig.bench.set("may_begin", may_begin);
        rig.bytes = VecDeque::from([1, 2, 3]);
        let lines = rig.read(opcode, LEAD + 30);
        assert!(lines.iter().all(Option::is_none) && !rig.bench.is("reads"), "{opcode:#x}");
        assert!(!rig.bench.is("takes"), "bytes go the other way");
        rig.end();
    }
    // The opcode counts only in the first eight clocks of an access.
    rig.bench.set("may_begin", true);
    for late in 1..40 {
        (0..late).for_each(|_| _ = rig.sck(0));
        let lines = rig.read(wanted, LEAD + 10);
        assert!(lines.iter().all(Option::is_none), "{late} clocks late");
        rig.end();
    }
}

fn a_read_that_is_cut_short_leaves_nothing_behind(project: &Project) {
    let dice = &mut Dice::new(43);
    let mut rig = Rig::new(project);
    for _ in 0..150 {
        rig.half_ps = dice.range(8_334, 20_000);
        rig.delay = dice.range(6, 30) as u32;
        rig.bytes = std::iter::repeat_n(0xDD, 60).collect();
        let clocks = dice.range(0, 150) as usize;
        rig.read(READ_PACKET | QUAD, clocks);
        rig.end();
        rig.bytes = bytes(dice, 20);
        rig.bytes.iter_mut().for_each(|byte| *byte &= 0x7F);
        rig.bytes.iter_mut().for_each(|byte| *byte |= 1);
        let expected = Vec::from(rig.bytes.clone());
        let found = rig.packet(80);
        rig.end();
        let found: Vec<_> = found.into_iter().filter(|&byte| byte != 0).collect();
        assert_eq!(found, expected, "after {clocks} clocks");
    }
}
