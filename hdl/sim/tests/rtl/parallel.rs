//! The receiver at the parallel port: takes bytes where the strobe rises, and compares them with what the golden model
//! sends.
//!
//! The model says what is sent, not when. Checked of the time is that a byte begins only if the receiver was ready
//! [`TO_BYTE`] clocks before, that the lines stand for the whole period, and that bytes come while the receiver is ready.

use crate::pins::Parallel;
use crate::project::Project;
use crate::rig::{Rig, loss_and_width};
use crate::scenario::{self, Dice};
use nirspi_wire::{
    ADC_HZ,
    register::{Design, Register as R, control, mode},
    samples::Width,
};
use std::collections::VecDeque;

/// Clocks from the level of `parallel_ready` to the first clock of a byte that begins for that level.
const TO_BYTE: u32 = 3;
/// Most clocks without a byte in a packet while the receiver is ready: the lead of `packer`, or a long block.
const PATIENCE: u32 = 600;
/// Clocks from the core's pins to the microcontroller's FIFO: two registers on the board's way out, and pads and wires.
const TO_FIFO: usize = 4;
/// Bytes of the microcontroller's FIFO, and of which on it is not ready.
const FIFO: u64 = 32;
const NEARLY_FULL: u64 = FIFO - 4;

/// When the receiver is ready.
#[derive(Debug, Clone, Copy)]
pub enum Pace {
    Always,
    Never,
    /// In each clock, with this chance of 256.
    Chance(u8),
    /// For up to so many clocks, and then not for up to so many.
    Turns(u64, u64),
    /// While the FIFO has room. A DMA channel takes a word of the FIFO in eight clocks while there is room in a ring, and
    /// USB takes so many bytes of the ring in 1000 clocks.
    Ring {
        bytes: u64,
        usb: u64,
    },
}

pub struct Receiver {
    pub pace: Pace,
    dice: Dice,
    level: bool,
    /// Clocks for which the level still stays.
    stays: u64,
    /// Levels of the clocks before, the last one lowest.
    levels: u64,
    /// The port in the clock before.
    before: Option<Parallel>,
    /// Bytes of the packet under way, and those of the model.
    bytes: usize,
    expected: Vec<u8>,
    /// Clocks without a byte of the packet under way.
    silent: u32,
    /// Bytes on their way into the FIFO, clock by clock.
    on_the_way: VecDeque<bool>,
    fifo: u64,
    dma_in: u64,
    /// Thousandths of a byte.
    ring: u64,
    /// Most bytes that were in the FIFO.
    pub fullest: u64,
}

impl Receiver {
    pub fn new(seed: u64, pace: Pace) -> Self {
        Self {
            pace,
            dice: Dice::new(seed),
            level: false,
            stays: 0,
            levels: 0,
            before: None,
            bytes: 0,
            expected: Vec::new(),
            silent: 0,
            on_the_way: VecDeque::from([false; TO_FIFO]),
            fifo: 0,
            dma_in: 0,
            ring: 0,
            fullest: 0,
        }
    }

    /// The FPGA has been reset.
    pub fn forget(&mut self) {
        *self =
            Self { before: Some(Parallel::default()), ..Self::new(self.dice.next(), self.pace) };
    }

    /// The level of this clock.
    fn next_level(&mut self) -> bool {
        let dice = &mut self.dice;
        match self.pace {
            Pace::Always => true,
            Pace::Never => false,
            Pace::Chance(chance) => dice.range(0, 255) < chance.into(),
            Pace::Turns(ready, busy) => {
                let turns = self.stays == 0;
                self.stays = match (turns, self.level) {
                    (false, _) => self.stays - 1,
                    (true, true) => dice.range(0, busy - 1),
                    (true, false) => dice.range(0, ready - 1),
                };
                self.level != turns
            }
            Pace::Ring { bytes, usb } => {
                self.dma_in = self.dma_in.saturating_sub(1);
                if self.dma_in == 0 && self.fifo >= 4 && self.ring + 4000 <= 1000 * bytes {
                    (self.fifo, self.ring, self.dma_in) = (self.fifo - 4, self.ring + 4000, 8);
                }
                self.ring = self.ring.saturating_sub(usb);
                self.fifo < NEARLY_FULL
            }
        }
    }
}

impl Rig {
    /// What the receiver sees in this clock, before its edge; sets the level of this clock. True when the last byte of a
    /// packet begins.
    pub(crate) fn parallel_clock(&mut self) -> bool {
        let Some(mut receiver) = self.receiver.take() else { return false };
        let port = self.pins.parallel();
        let Parallel { strobe, enable, lines } = port;
        let before = receiver.before.unwrap_or(port);
        let follows = match before.strobe {
            0b00 => strobe == 0b01 || strobe == 0b00 && !before.enable,
            0b01 => strobe == 0b11,
            _ => strobe == 0b00,
        };
        let follows = follows || receiver.before.is_none();
        self.expect(
            "the strobe's levels follow",
            &(before.strobe, strobe, follows),
            &(before.strobe, strobe, true),
        );
        if strobe != 0 {
            self.expect("lines in a period", &(enable, lines), &(before.enable, before.lines));
        }
        if !enable {
            self.expect("lines without a byte", &lines, &0);
        }
        receiver.silent += 1;
        if !receiver.level || receiver.bytes == 0 {
            receiver.silent = 0;
        }
        let mut sent = false;
        if strobe == 0 && enable {
            let ready = receiver.levels >> (TO_BYTE - 1) & 1;
            self.expect("a byte for a ready receiver", &ready, &1);
            sent = self.take_byte(&mut receiver, lines);
            receiver.silent = 0;
        }
        if receiver.silent > PATIENCE {
            self.expect("clocks without a byte", &receiver.silent, &PATIENCE);
        }
        receiver.on_the_way.push_back(strobe == 0b01 && enable);
        receiver.fifo += u64::from(receiver.on_the_way.pop_front() == Some(true));
        if matches!(receiver.pace, Pace::Ring { .. }) {
            receiver.fullest = receiver.fullest.max(receiver.fifo);
            self.expect("the FIFO's room is enough", &(receiver.fifo <= FIFO), &true);
        } else {
            receiver.fifo = 0;
        }
        let level = receiver.next_level();
        if level != receiver.level {
            self.pins.receives(level);
        }
        receiver.level = level;
        receiver.levels = receiver.levels << 1 | u64::from(level);
        receiver.before = Some(port);
        self.receiver = Some(receiver);
        sent
    }

    /// A byte of a packet; true for the last.
    fn take_byte(&mut self, receiver: &mut Receiver, byte: u8) -> bool {
        if receiver.bytes == 0 {
            receiver.expected = self.model.outgoing().unwrap_or_default();
        }
        let at = receiver.bytes;
        let of = receiver.expected.len();
        let what = format!("byte {at} of {of} of a packet by the parallel port");
        self.expect(&what, &Some(&byte), &receiver.expected.get(at));
        receiver.bytes += 1;
        if receiver.bytes < of {
            return false;
        }
        receiver.bytes = 0;
        self.seen_so_far.sent += 1;
        let packet = receiver.expected.iter().skip(1).take(of.saturating_sub(4));
        let packet: Vec<u8> = packet.copied().collect();
        if !packet.is_empty() {
            let (is_after_loss, width) = loss_and_width(&packet);
            self.seen_so_far.sent_after_loss += u64::from(is_after_loss);
            self.seen_so_far.narrow += u64::from(width == Width::Bits24);
        }
        true
    }

    /// A start forgets the packet under way. True if there was one.
    pub(crate) fn cut(&mut self) -> bool {
        self.receiver.as_mut().is_some_and(|receiver| std::mem::take(&mut receiver.bytes) > 0)
    }

    /// Ends the run and takes all that the port still has.
    fn drain(&mut self) {
        self.set(R::Control, control::STOP);
        self.receiver.as_mut().unwrap().pace = Pace::Always;
        for _ in 0..80 {
            if self.model.outgoing().is_none() {
                return;
            }
            self.wait_adc(500);
        }
        self.expect("frames that never left", &1, &0);
    }
}

/// Random scenarios of packets and of slow readers, whose packets leave by the parallel port to a receiver of any pace.
/// The host's reads of frames and its releases go on meanwhile, and find nothing.
pub fn random(rig: &mut Rig, seed: u64) {
    let dice = &mut Dice::new(seed ^ 0x5051);
    let pace = match seed % 9 {
        0 => Pace::Always,
        1 => Pace::Chance(dice.range(1, 255) as u8),
        2 => Pace::Turns(3, dice.range(1, 40)),
        3 => Pace::Turns(dice.range(1, 400), dice.range(1, 400)),
        4 => Pace::Turns(2000, 4000),
        5 => Pace::Ring { bytes: dice.range(8, 300), usb: dice.range(20, 400) },
        6 => Pace::Ring { bytes: 4096, usb: dice.range(100, 300) },
        7 => Pace::Turns(dice.range(1, 6), dice.range(1, 6)),
        _ => Pace::Never,
    };
    rig.receiver = Some(Receiver::new(seed, pace));
    rig.by_sck = dice.once_in(4);
    let narrow = if dice.once_in(2) { mode::NARROW } else { 0 };
    let bits = mode::PACKETS | mode::PARALLEL | narrow;
    match seed % 3 {
        0 => scenario::slow_readers_with(rig, seed, bits),
        _ => scenario::packets_with(rig, seed, bits),
    }
    for _ in 0..dice.range(0, 3) {
        rig.set(R::Control, control::STOP | control::CLEAR_FAULT | control::START);
        rig.wait_adc(dice.range(1, 1500));
    }
    if rig.mismatch.is_none() {
        rig.drain();
        for register in [R::FramesMade, R::FramesLost, R::SumLow, R::OverRange] {
            rig.read(register.address());
        }
    }
    if seed % 8 == 5 {
        // A start without `PACKETS` is refused.
        rig.set(R::Mode, mode::PARALLEL);
        rig.set(R::Control, control::CLEAR_FAULT | control::START);
        rig.read(R::Status.address());
    }
    rig.by_sck = false;
    rig.receiver = None;
    rig.pins.receives(false);
}

/// The ADC's clock goes away in a packet or between two, and comes back; the next run's packets are whole.
pub fn clock_lost(rig: &mut Rig, seed: u64) {
    let dice = &mut Dice::new(seed);
    rig.receiver = Some(Receiver::new(seed, Pace::Turns(200, 20)));
    rig.interlock(true);
    for _ in 0..6 {
        rig.wait_adc(100);
        for (register, value) in [(R::Patterns, 24), (R::Dwell, 3), (R::Blank, 0), (R::Frames, 3)] {
            rig.set(register, value);
        }
        rig.set(R::Mode, mode::PACKETS | mode::PARALLEL);
        rig.set(R::Control, control::START);
        rig.wait_adc(dice.range(200, 900));
        if dice.once_in(2) {
            rig.drain();
        }
        rig.lose_adc_clock();
        rig.wait(dice.range(20, 300) as u32);
        rig.bring_adc_clock_back(Design::Camera);
    }
    rig.receiver = None;
    rig.pins.receives(false);
}

/// Clocks of one second.
const SECOND: u64 = ADC_HZ as u64;

/// Waits until a packet has been sent. Returns the number of packets sent, and the clock.
fn end_of_a_packet(rig: &mut Rig) -> (u64, u64) {
    let sent = rig.seen_so_far.sent;
    while rig.seen_so_far.sent == sent && rig.mismatch.is_none() {
        rig.wait_adc(1);
    }
    (rig.seen_so_far.sent, rig.clock)
}

/// Frames of 1024 patterns and complements in a second, by this receiver, and frames lost of those made.
fn frames_per_second(pace: Pace, bits: u32) -> (u64, u32, u32) {
    let mut rig = Rig::new(&Project::read(), 7);
    rig.receiver = Some(Receiver::new(1, pace));
    rig.interlock(true);
    rig.wait_adc(100);
    let bits = mode::DIFFERENTIAL | mode::ORDER_SEQUENCY | mode::PACKETS | mode::PARALLEL | bits;
    rig.set(R::Mode, bits);
    rig.set(R::Watchdog, SECOND as u32);
    rig.set(R::Control, control::START);
    // The FIFO, the ring and the banks fill up.
    rig.wait_adc(150_000);
    let (first, from) = end_of_a_packet(&mut rig);
    rig.wait_adc(500_000);
    let (last, to) = end_of_a_packet(&mut rig);
    let made = rig.read(R::FramesMade.address());
    let lost = rig.read(R::FramesLost.address());
    let fullest = rig.receiver.as_ref().unwrap().fullest;
    println!(
        "{} frames in {} clocks, {lost} of {made} lost, {fullest} bytes in the FIFO",
        last - first,
        to - from
    );
    assert_eq!(rig.mismatch, None);
    (SECOND * (last - first) / (to - from), lost, made)
}

/// What USB 2.0 hosts take, as measured by others: 33 MB/s.
const OF_USB: Pace = Pace::Ring { bytes: 4096, usb: 264 };

/// The port is not what limits the frames.
#[test]
fn a_receiver_of_33_megabytes_a_second_gets_7900_frames_a_second() {
    let (frames, lost, made) = frames_per_second(OF_USB, 0);
    println!("{frames} frames/s");
    assert!((7900..8030).contains(&frames), "{frames}");
    // 12 207 frames are made in a second.
    assert!((30..40).contains(&(100 * lost / made)), "{lost} of {made} lost");
}

#[test]
fn a_receiver_of_33_megabytes_a_second_gets_10_500_frames_of_24_bits() {
    let (frames, ..) = frames_per_second(OF_USB, mode::NARROW);
    println!("{frames} frames/s");
    assert!((10_500..10_650).contains(&frames), "{frames}");
}

/// The port's own limit: a byte in three clocks, and the lead of `packer`.
#[test]
fn a_receiver_that_is_always_ready_gets_9600_frames_a_second() {
    let (frames, ..) = frames_per_second(Pace::Always, 0);
    println!("{frames} frames/s");
    assert!((9600..10_100).contains(&frames), "{frames}");
}

#[test]
fn a_receiver_that_is_always_ready_gets_every_frame_of_24_bits() {
    let (frames, lost, made) = frames_per_second(Pace::Always, mode::NARROW);
    println!("{frames} frames/s");
    assert!((12_200..12_210).contains(&frames), "{frames}");
    assert!(lost == 0, "{lost} of {made} lost");
}
