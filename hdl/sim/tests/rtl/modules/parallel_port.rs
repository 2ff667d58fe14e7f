//! Tests of the port that sends packets on eight lines, period by period.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_hdl_model::on_lines;

laws![
    the_bytes_of_a_packet_go_out_once_and_in_order_whatever_the_receiver_does,
    a_period_has_a_byte_if_and_only_if_there_is_one_and_the_receiver_is_ready,
    a_frame_is_opened_once_and_given_back_behind_its_last_zero,
    a_start_cuts_the_packet_and_the_next_begins_with_a_zero,
    a_port_that_is_off_stands_still,
];

/// The port, a packer and a receiver.
struct Rig {
    bench: Bench,
    /// Frames that wait, as packets. That of the packer is the first one.
    frames: Vec<Vec<u8>>,
    /// Bytes that the packer has given of the first, once it has been opened.
    given: Option<usize>,
    /// Clocks until the packer has its next byte, and the most that it takes.
    pause: u64,
    pace: u64,
    ready: bool,
    on: bool,
    restart: bool,
    /// Bytes that the receiver took.
    received: Vec<u8>,
    /// Frames opened and given back.
    opened: usize,
    given_back: usize,
    /// Levels of the strobe in halves of clocks, and the lines with `enable`, of each clock so far.
    strobe: Vec<u8>,
    lines: Vec<Option<u8>>,
    /// Whether the receiver was ready and the packer had a byte, in each clock.
    asked: Vec<(bool, bool)>,
}

impl Rig {
    fn new(project: &Project) -> Self {
        Self {
            bench: Bench::new(project, "parallel_port"),
            frames: Vec::new(),
            given: None,
            pause: 0,
            pace: 2,
            ready: true,
            on: true,
            restart: false,
            received: Vec::new(),
            opened: 0,
            given_back: 0,
            strobe: Vec::new(),
            lines: Vec::new(),
            asked: Vec::new(),
        }
    }

    fn tick(&mut self, dice: &mut Dice) {
        let next = self.given.and_then(|at| self.frames[0].get(at).copied());
        let valid = next.is_some() && self.pause == 0;
        self.pause = self.pause.saturating_sub(1);
        self.bench.set("on", self.on);
        self.bench.set("restart", self.restart);
        self.bench.set("ready", self.ready);
        self.bench.set("frame", !self.frames.is_empty());
        self.bench.set("octet", if valid { next.unwrap() } else { 0xEE });
        self.bench.set("valid", valid);
        let strobe = self.bench.get("strobe") as u8;
        let byte = self.bench.is("enable").then(|| self.bench.get("lines") as u8);
        assert!(byte.is_some() || self.bench.get("lines") == 0);
        self.strobe.push(strobe);
        self.lines.push(byte);
        // What rises within a clock takes the lines of that clock.
        if strobe == 0b01 {
            self.received.extend(byte);
        }
        self.asked.push((self.ready, valid));
        if self.bench.is("open") {
            assert!(!self.frames.is_empty() && self.on && !self.restart);
            (self.given, self.pause) = (Some(0), dice.range(0, 20));
            self.opened += 1;
        }
        if self.bench.is("taken") {
            assert!(
                valid && self.ready,
                "a byte taken that is not there, or while the receiver is not ready"
            );
            self.given = self.given.map(|at| at + 1);
            self.pause = dice.range(2, self.pace);
        }
        if self.bench.is("give_back") {
            assert_eq!(self.given, Some(self.frames[0].len()), "given back before its end");
            self.given = None;
            self.frames.remove(0);
            self.given_back += 1;
        }
        self.bench.tick();
    }

    fn until_sent(&mut self, dice: &mut Dice, mut ready: impl FnMut(&mut Dice) -> bool) {
        for _ in 0..60_000 {
            if self.frames.is_empty() {
                self.ready = true;
                (0..6).for_each(|_| self.tick(dice));
                return;
            }
            self.ready = ready(dice);
            self.tick(dice);
        }
        panic!("never sent");
    }
}

fn packet(dice: &mut Dice) -> Vec<u8> {
    let length = dice.range(0, 60);
    (0..length).map(|_| dice.range(1, 255) as u8).chain([0]).collect()
}

fn the_bytes_of_a_packet_go_out_once_and_in_order_whatever_the_receiver_does(project: &Project) {
    let dice = &mut Dice::new(51);
    let mut rig = Rig::new(project);
    for round in 0..300 {
        rig.pace = dice.pick(&[2, 3, 9, 30]);
        rig.frames = (0..dice.range(1, 3)).map(|_| packet(dice)).collect();
        let expected: Vec<u8> = rig.frames.iter().flat_map(|packet| on_lines(packet)).collect();
        rig.received.clear();
        let chance = dice.pick(&[256, 255, 128, 30, 12]);
        let mut level = false;
        rig.until_sent(dice, |dice| {
            // One level for a while, or another one in each clock.
            if round % 2 == 0 || dice.once_in(30) {
                level = dice.range(0, 255) < chance;
            }
            level
        });
        assert_eq!(rig.received, expected, "round {round}");
    }
}

fn a_period_has_a_byte_if_and_only_if_there_is_one_and_the_receiver_is_ready(project: &Project) {
    let dice = &mut Dice::new(52);
    let mut rig = Rig::new(project);
    let (mut with, mut without) = (0, 0);
    for _ in 0..60 {
        rig.pace = dice.pick(&[2, 3, 12]);
        rig.frames = vec![packet(dice)];
        (rig.strobe, rig.lines, rig.asked) = (Vec::new(), Vec::new(), Vec::new());
        let chance = dice.range(1, 4);
        rig.until_sent(dice, |dice| dice.once_in(chance));
        let begins = rig.strobe.windows(2).position(|pair| pair == [0b11, 0]).unwrap() + 1;
        let periods = (rig.strobe.len() - begins) / 3;
        for period in (begins..).step_by(3).take(periods) {
            assert_eq!(rig.strobe[period..][..3], [0b00, 0b01, 0b11], "rises in the middle");
            let byte = rig.lines[period];
            assert_eq!(rig.lines[period..][..3], [byte; 3], "the lines stand for the period");
            let (ready, valid) = rig.asked[period - 1];
            match byte {
                Some(byte) => {
                    assert!(ready && (byte == 0 || valid), "sent without need: {byte:#x}");
                }
                None => assert!(!(ready && valid), "a byte was there, and the receiver ready"),
            }
            with += u64::from(byte.is_some());
            without += u64::from(byte.is_none());
        }
    }
    assert!(with > 500 && without > 500, "{with}, {without}");
}

fn a_frame_is_opened_once_and_given_back_behind_its_last_zero(project: &Project) {
    let dice = &mut Dice::new(53);
    let mut rig = Rig::new(project);
    for _ in 0..50 {
        let frames = dice.range(1, 3) as usize;
        rig.frames = (0..frames).map(|_| packet(dice)).collect();
        (rig.opened, rig.given_back) = (0, 0);
        rig.received.clear();
        let length = on_lines(&rig.frames[0]).len();
        while rig.given_back == 0 {
            rig.tick(dice);
            assert_eq!(rig.opened, 1);
        }
        // The last byte is at the pins, and the strobe has not risen yet.
        assert_eq!(rig.received.len(), length - 1);
        assert_eq!(rig.lines.last(), Some(&Some(0)));
        rig.until_sent(dice, |_| true);
        assert_eq!((rig.opened, rig.given_back), (frames, frames));
    }
}

fn a_start_cuts_the_packet_and_the_next_begins_with_a_zero(project: &Project) {
    let dice = &mut Dice::new(54);
    let mut rig = Rig::new(project);
    for _ in 0..100 {
        rig.frames = vec![packet(dice)];
        let expected = on_lines(&rig.frames[0]);
        rig.received.clear();
        let clocks = dice.range(0, 200);
        // The start may come with the frame.
        for _ in 0..dice.pick(&[0, clocks, clocks]) {
            rig.ready = !dice.once_in(3);
            rig.tick(dice);
        }
        rig.restart = true;
        rig.tick(dice);
        (rig.restart, rig.given) = (false, None);
        rig.frames.clear();
        (0..dice.range(3, 20)).for_each(|_| rig.tick(dice));
        assert!(expected.starts_with(&rig.received), "{:?}", rig.received);
        rig.received.clear();
        (0..20).for_each(|_| rig.tick(dice));
        assert!(rig.received.is_empty(), "bytes of a run that is over");
        let next = packet(dice);
        rig.frames = vec![next.clone()];
        rig.until_sent(dice, |dice| dice.once_in(2));
        assert_eq!(rig.received, on_lines(&next));
    }
}

fn a_port_that_is_off_stands_still(project: &Project) {
    let dice = &mut Dice::new(55);
    let mut rig = Rig::new(project);
    for _ in 0..40 {
        rig.frames = vec![packet(dice)];
        (0..dice.range(20, 60)).for_each(|_| rig.tick(dice));
        rig.restart = true;
        rig.tick(dice);
        (rig.restart, rig.given, rig.on) = (false, None, false);
        // The period under way ends as it began.
        (0..4).for_each(|_| rig.tick(dice));
        let last: Vec<u8> = rig.strobe.iter().rev().take(6).rev().copied().collect();
        let cuts = last.windows(2).any(|pair| matches!(pair, [0b01, 0] | [0, 0b11]));
        assert!(!cuts, "{last:?}");
        (rig.opened, rig.received) = (0, Vec::new());
        rig.strobe.clear();
        (0..30).for_each(|_| rig.tick(dice));
        assert!(rig.strobe.iter().all(|&strobe| strobe == 0), "{:?}", rig.strobe);
        assert!(rig.opened == 0 && rig.received.is_empty());
        rig.on = true;
        rig.until_sent(dice, |_| true);
    }
}
