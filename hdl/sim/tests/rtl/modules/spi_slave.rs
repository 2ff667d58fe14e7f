//! Tests of the host port, bit by bit, as defined in `nirspi_wire::host_port`.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::host_port::{
    DUMMY_CYCLES, QUAD, READ_FRAME, READ_RAW, READ_REGISTER, WRITE_REGISTER, check,
};
use std::collections::VecDeque;

laws![
    a_write_goes_on_once_with_its_last_bit,
    a_write_with_wrong_bits_does_nothing,
    a_read_gives_the_answer_after_the_dummy_cycles,
    a_stream_gives_the_bytes_of_its_own_epoch_and_zeros_beyond,
    a_transfer_cut_short_leaves_nothing_behind,
    an_unknown_opcode_does_nothing,
    a_read_of_a_packet_by_the_other_port_is_one_access_and_drives_nothing,
];

/// Clocks from an access to its answer: within the dummy cycles, at a third of `sck`'s half period.
const ANSWER_CLOCKS: u32 = 30;

/// Operation, address and data of an access that reaches the engine.
type Access = [u64; 3];

/// The host, and the engine behind the port.
struct Rig {
    bench: Bench,
    quad: bool,
    /// Clocks of half a period of `sck`.
    half: u32,
    fifo: VecDeque<u64>,
    sent: Vec<Access>,
    /// The value of a register, and the clocks until the answer.
    value: u64,
    answer_in: u32,
    /// Bits that the wires invert on the way to the FPGA: of the address, and of value and check.
    wrong_address: u64,
    wrong: [u64; 2],
}

impl Rig {
    fn new(project: &Project) -> Self {
        let bench = Bench::new(project, "spi_slave");
        let fifo = VecDeque::new();
        let sent = Vec::new();
        let (quad, half, value, answer_in) = (false, 3, 0, 0);
        let (wrong_address, wrong) = (0, [0; 2]);
        Self { bench, quad, half, fifo, sent, value, answer_in, wrong_address, wrong }
    }

    fn clock(&mut self) {
        self.answer_in = self.answer_in.saturating_sub(1);
        self.bench.set("back", self.answer_in == 1);
        self.bench.set("value", if self.answer_in == 1 { self.value } else { 0 });
        self.bench.set("empty", self.fifo.is_empty());
        self.bench.set("fifo_data", self.fifo.front().copied().unwrap_or(0x1FF));
        let pops = self.bench.is("pop");
        self.bench.tick();
        if pops {
            self.fifo.pop_front();
        }
        if self.bench.is("send") {
            self.sent.push(["operation", "address", "data"].map(|port| self.bench.get(port)));
            self.answer_in = ANSWER_CLOCKS;
        }
    }

    fn clocks(&mut self, count: u32) {
        for _ in 0..count {
            self.clock();
        }
    }

    /// One period of `sck`; returns the lines and the driven levels when the host samples.
    fn sck(&mut self, lines: u64) -> [u64; 2] {
        self.bench.set("lines_in", lines);
        self.bench.set("sck", false);
        self.clocks(self.half);
        let seen = ["lines_out", "drive"].map(|port| self.bench.get(port));
        self.bench.set("sck", true);
        self.clocks(self.half);
        seen
    }

    /// Sends the lowest bits of a word, for at most so many periods.
    fn send(&mut self, word: u64, bits: u32, quad: bool, periods: &mut u32) {
        let step = if quad { 4 } else { 1 };
        for sent in (step..=bits).step_by(step as usize) {
            if *periods == 0 {
                return;
            }
            *periods -= 1;
            // Lines that the port ignores carry noise.
            let noise = if quad { 0 } else { 0xE };
            let value = (word >> (bits - sent)) & if quad { 0xF } else { 1 };
            let [_, drive] = self.sck(value | noise);
            assert_eq!(drive, 0, "driven against the host");
        }
    }

    fn receive(&mut self, bits: u32) -> u64 {
        (0..bits / if self.quad { 4 } else { 1 }).fold(0, |word, _| {
            let [lines, drive] = self.sck(0);
            assert_eq!(drive, if self.quad { 0xF } else { 2 });
            if self.quad { word << 4 | lines } else { word << 1 | lines >> 1 & 1 }
        })
    }

    /// Sends opcode, address and a write's data, cut short after so many periods.
    fn begin(&mut self, opcode: u8, address: u64, data: Option<u64>, mut periods: u32) {
        self.bench.set("sck", false);
        self.bench.set("selected", true);
        let opcode = opcode | if self.quad { QUAD } else { 0 };
        self.send(opcode.into(), 8, false, &mut periods);
        self.send(address ^ self.wrong_address, 16, self.quad, &mut periods);
        if let Some(data) = data {
            let check = u64::from(check(address as u16, data as u32));
            let [wrong_data, wrong_check] = self.wrong;
            self.send(data ^ wrong_data, 32, self.quad, &mut periods);
            self.send(check ^ wrong_check, 16, self.quad, &mut periods);
        }
    }

    fn dummy(&mut self) {
        for _ in 0..DUMMY_CYCLES {
            let [_, drive] = self.sck(0xF);
            assert_eq!(drive, 0, "driven in a dummy cycle");
        }
    }

    fn end(&mut self) {
        self.bench.set("sck", false);
        self.clocks(self.half);
        self.bench.set("selected", false);
        self.clock();
        assert_eq!(self.bench.get("drive"), 0, "driven though not selected");
        self.clocks(4);
    }

    /// Changes the host: its lines, and how much slower than the limit `sck` is.
    fn vary(&mut self, dice: &mut Dice) {
        self.quad = dice.once_in(2);
        self.half = dice.pick(&[3, 3, 4]);
    }

    /// Accesses that have reached the engine since the last call.
    fn sent(&mut self) -> Vec<Access> {
        std::mem::take(&mut self.sent)
    }

    fn write(&mut self, dice: &mut Dice) {
        let (address, data) = (dice.range(0, 0xFFFF), dice.range(0, 0xFFFF_FFFF));
        self.begin(WRITE_REGISTER, address, Some(data), u32::MAX);
        // The access takes effect before the host deselects the FPGA, and only once, however long
        // the selection lasts.
        assert_eq!(self.sent(), [[u64::from(WRITE_REGISTER & 3), address, data]]);
        for _ in 0..dice.range(0, 40) {
            self.sck(0xF);
        }
        self.end();
        assert!(self.sent().is_empty());
    }

    fn read(&mut self, dice: &mut Dice) {
        let address = dice.range(0, 0xFFFF);
        self.value = dice.range(0, 0xFFFF_FFFF);
        self.begin(READ_REGISTER, address, None, u32::MAX);
        let [[operation, at, _]] = self.sent()[..] else { panic!("not one access") };
        assert_eq!([operation, at], [u64::from(READ_REGISTER & 3), address]);
        self.dummy();
        assert_eq!(self.receive(32), self.value);
        assert_eq!(self.receive(16), u64::from(check(address as u16, self.value as u32)));
        self.end();
    }

    /// A stream that begins while bytes of an earlier epoch are still in the FIFO.
    fn stream(&mut self, dice: &mut Dice) {
        let epoch = dice.range(0, 1);
        let of_epoch = |epoch: u64, dice: &mut Dice, count| -> Vec<u64> {
            (0..count).map(|_| epoch << 8 | dice.range(0, 0xFF)).collect()
        };
        self.fifo.extend(of_epoch(1 - epoch, dice, 9));
        self.bench.set("epoch", epoch);
        let opcode = dice.pick(&[READ_FRAME, READ_RAW]);
        self.begin(opcode, 0, None, u32::MAX);
        let [[operation, ..]] = self.sent()[..] else { panic!("not one access") };
        assert_eq!(operation, u64::from(opcode & 3));
        let count = dice.range(1, 20);
        let bytes = of_epoch(epoch, dice, count);
        self.fifo.extend(&bytes);
        self.dummy();
        for &byte in &bytes {
            assert_eq!(self.receive(8), byte & 0xFF);
        }
        assert_eq!(self.receive(8), 0, "beyond the end");
        self.end();
        assert!(self.fifo.is_empty());
    }
}

fn a_write_goes_on_once_with_its_last_bit(project: &Project) {
    let mut rig = Rig::new(project);
    let dice = &mut Dice::new(33);
    for _ in 0..40 {
        rig.vary(dice);
        rig.write(dice);
    }
}

fn a_write_with_wrong_bits_does_nothing(project: &Project) {
    let mut rig = Rig::new(project);
    let dice = &mut Dice::new(38);
    for _ in 0..60 {
        rig.vary(dice);
        let wrong = (0..3).fold(0u64, |wrong, _| wrong | 1 << dice.range(0, 63));
        rig.wrong_address = wrong >> 48;
        rig.wrong = [wrong >> 16 & 0xFFFF_FFFF, wrong & 0xFFFF];
        rig.begin(
            WRITE_REGISTER,
            dice.range(0, 0xFFFF),
            Some(dice.range(0, 0xFFFF_FFFF)),
            u32::MAX,
        );
        rig.end();
        assert!(rig.sent().is_empty(), "{wrong:#x}");
        (rig.wrong_address, rig.wrong) = (0, [0; 2]);
        rig.write(dice);
    }
}

fn a_read_gives_the_answer_after_the_dummy_cycles(project: &Project) {
    let mut rig = Rig::new(project);
    let dice = &mut Dice::new(34);
    for _ in 0..40 {
        rig.vary(dice);
        rig.read(dice);
    }
}

fn a_stream_gives_the_bytes_of_its_own_epoch_and_zeros_beyond(project: &Project) {
    let mut rig = Rig::new(project);
    let dice = &mut Dice::new(35);
    for _ in 0..40 {
        rig.vary(dice);
        rig.stream(dice);
    }
}

fn a_transfer_cut_short_leaves_nothing_behind(project: &Project) {
    let mut rig = Rig::new(project);
    let dice = &mut Dice::new(36);
    for _ in 0..60 {
        rig.vary(dice);
        let all = 8 + if rig.quad { 4 + 12 } else { 16 + 48 };
        let periods = dice.range(0, all - 1) as u32;
        // A transfer cut off one bit before its end is cut off like any other.
        let periods = if dice.once_in(3) { all as u32 - 1 } else { periods };
        rig.begin(WRITE_REGISTER, 0x1234, Some(0xFFFF_FFFF), periods);
        rig.end();
        assert!(rig.sent().is_empty(), "carried out after {periods} of {all} periods");
        rig.vary(dice);
        match dice.range(0, 2) {
            0 => rig.write(dice),
            1 => rig.read(dice),
            _ => rig.stream(dice),
        }
    }
}

fn an_unknown_opcode_does_nothing(project: &Project) {
    let mut rig = Rig::new(project);
    let dice = &mut Dice::new(37);
    for opcode in 0..=255 {
        if (WRITE_REGISTER..=READ_RAW).contains(&(opcode & !QUAD)) {
            continue;
        }
        rig.begin(opcode & !QUAD, 0, Some(0), u32::MAX);
        rig.dummy();
        rig.end();
        assert!(rig.sent().is_empty(), "{opcode:#x}");
    }
    rig.write(dice);
}

/// What this port sees of a faster `sck` may look like any opcode. Of its edges it sees as many as there are, or fewer:
/// at most four of the address before it hears of the read.
fn a_read_of_a_packet_by_the_other_port_is_one_access_and_drives_nothing(project: &Project) {
    let mut rig = Rig::new(project);
    let dice = &mut Dice::new(39);
    for round in 0..80 {
        rig.vary(dice);
        let seen = dice.range(0, 11) as u32;
        let opcode = dice.pick(&[WRITE_REGISTER, READ_REGISTER, READ_FRAME, READ_RAW]);
        assert!(rig.bench.is("beginning"));
        let busy = dice.range(0, 40) as u32;
        rig.quad |= seen > 8;
        rig.begin(opcode, dice.range(0, 0xFFFF), Some(0), seen);
        let young = 2 * rig.half * seen < 25;
        assert_eq!(rig.bench.is("beginning"), seen < 8 && young, "after {seen} edges");
        rig.bench.set("idle", false);
        rig.bench.set("packet", true);
        rig.clocks(busy);
        assert!(rig.sent().is_empty(), "an access before this one is under way");
        rig.bench.set("idle", true);
        for _ in 0..dice.range(10, 60) {
            let [_, drive] = rig.sck(dice.range(0, 0xF));
            assert_eq!(drive, 0, "round {round}: driven by both ports");
        }
        let accesses: Vec<_> = rig.sent().iter().map(|&[operation, ..]| operation).collect();
        assert_eq!(accesses, [u64::from(READ_FRAME & 3)], "round {round}");
        // The pin ends both: that of the other port at once, that of this port some clocks later. Edges that come in
        // between do nothing.
        rig.bench.set("packet", false);
        for _ in 0..dice.range(1, 60) {
            let [_, drive] = rig.sck(dice.range(0, 0xF));
            assert_eq!(drive, 0, "round {round}: driven after the read");
        }
        rig.end();
        assert!(rig.sent().is_empty());
        rig.vary(dice);
        rig.write(dice);
    }
}
