//! Tests of the ring against a simple model, with a DMA channel that moves at any moment.

use super::*;
use nirspi_wire::packet::seal;
use nirspi_wire::ready::Head;
use nirspi_wire::{FrameFlags, ready};
use proptest::prelude::*;
use std::boxed::Box;
use std::vec::Vec;

const WORDS: usize = 256;
const BYTES: u64 = 4 * WORDS as u64;

/// A packet of the FPGA with these samples.
fn packet(sequence: u32, samples: &[i32]) -> Vec<u8> {
    let head = Head {
        run: 3,
        sequence,
        device_time_us: 0,
        sweeps: 1,
        flags: FrameFlags::default(),
        patterns: samples.len() as u16,
        width: Width::Bits32,
    };
    let mut payload = head.to_bytes().to_vec();
    payload.extend(samples.iter().flat_map(|sample| sample.to_le_bytes()));
    seal(&payload, &mut [0; 1024]).unwrap().to_vec()
}

/// The channel: moves whole words into the ring.
struct Dma {
    ring: Ring,
    words: &'static [AtomicU32; WORDS],
    /// Bytes of an unfinished word.
    fifo: Vec<u8>,
    /// Bytes in memory since power-up, now and at the last look.
    written: u64,
    seen: u64,
    now: Micros,
}

impl Dma {
    /// A channel whose ring has counted so many bytes.
    fn after(rounds: u32) -> Self {
        let words: &'static [AtomicU32; WORDS] =
            Box::leak(Box::new([const { AtomicU32::new(0x5555_5555) }; WORDS]));
        let mut ring = Ring::new(words);
        ring.written = rounds.wrapping_mul(BYTES as u32);
        ring.taken = ring.written;
        Self { ring, words, fifo: Vec::new(), written: 0, seen: 0, now: Micros(0) }
    }

    fn send(&mut self, bytes: &[u8]) {
        self.fifo.extend(bytes);
        let whole = self.fifo.len() / 4 * 4;
        for word in self.fifo.drain(..whole).collect::<Vec<_>>().chunks(4) {
            let value = u32::from_le_bytes(word.try_into().unwrap());
            self.words[self.written as usize / 4 % WORDS].store(value, Ordering::Relaxed);
            self.written += 4;
        }
    }

    /// Time stands still, but for a round: its time is shorter than what a look may take in a ring as small as this.
    fn look(&mut self) {
        if self.written - self.seen >= BYTES {
            self.now.0 += BYTES / BYTES_PER_MICRO;
        }
        self.seen = self.written;
        self.ring.came(self.now, (self.written % BYTES) as usize);
    }

    /// What the firmware does with a packet, while bytes come between its steps.
    fn take(&mut self, patterns: u16, meanwhile: [&[u8]; 2]) -> Option<(Found, Vec<u8>, bool)> {
        self.look();
        let found = self.ring.next(patterns, Width::Bits32)?;
        self.send(meanwhile[0]);
        let mut room = std::vec![0; found.room_bytes()];
        let place = self.ring.copy(&found, &mut room);
        self.send(meanwhile[1]);
        self.look();
        Some((found, room[place].to_vec(), self.ring.take(&found)))
    }
}

/// The lines of the FPGA: what it sends, and where each packet begins and ends in that.
struct Lines {
    bytes: Vec<u8>,
    packets: Vec<Range<u64>>,
    sent: usize,
}

impl Lines {
    fn new(packets: impl Iterator<Item = Vec<u8>>) -> Self {
        let mut lines = Self { bytes: Vec::new(), packets: Vec::new(), sent: 0 };
        for packet in packets {
            let begin = lines.bytes.len() as u64 + 1;
            lines.packets.push(begin..begin + packet.len() as u64);
            lines.bytes.extend([&[0], &packet[..], &[0; 3]].concat());
        }
        lines
    }

    fn next(&mut self, bytes: usize) -> &[u8] {
        let begin = self.sent;
        self.sent = (begin + bytes).min(self.bytes.len());
        &self.bytes[begin..self.sent]
    }
}

/// The ring as a list of packets.
#[derive(Default)]
struct Model {
    taken: u64,
    is_between: bool,
    next: usize,
    seen: u64,
}

impl Model {
    fn restart(&mut self, written: u64) {
        (self.taken, self.is_between) = (written, false);
    }

    /// An overrun forgets everything.
    fn look(&mut self, written: u64) {
        let is_round = written - self.seen >= BYTES;
        self.seen = written;
        if is_round || written - self.taken > BYTES - u64::from(IN_FLIGHT) {
            self.restart(written);
        }
    }

    /// The packet that is there whole. One that began before all was forgotten does not count.
    fn find(&mut self, written: u64, packets: &[Range<u64>]) -> Option<usize> {
        let first = |packet: &Range<u64>| packet.start >= self.taken + u64::from(!self.is_between);
        self.next += packets[self.next..].iter().position(first)?;
        let packet = &packets[self.next];
        // Before the first packet and behind each there are zeros.
        let zero = if self.next == 0 { 0 } else { packets[self.next - 1].end - 1 };
        self.is_between |= zero.max(self.taken) < written && self.taken < packet.start;
        self.taken = packet.start.min(written);
        (packet.end <= written).then_some(self.next)
    }
}

#[derive(Debug, Clone)]
enum Step {
    Send(usize),
    Take(usize, usize),
    Restart,
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let bytes = || prop_oneof![8 => 0..150usize, 2 => 0..900usize, 1 => 900..1500usize];
    let few = || prop_oneof![3 => Just(0usize), 3 => 1..100usize, 1 => 0..1200usize];
    let step = prop_oneof![
        4 => bytes().prop_map(Step::Send),
        6 => (few(), few()).prop_map(|(before, after)| Step::Take(before, after)),
        1 => Just(Step::Restart),
    ];
    prop::collection::vec(step, 1..150)
}

fn samples() -> impl Strategy<Value = i32> {
    prop_oneof![Just(0), -3..300, any::<i32>()]
}

proptest! {
    #[test]
    fn every_packet_comes_once_and_whole_and_only_an_overrun_loses_any(
        steps in steps(),
        frames in prop::collection::vec(prop::collection::vec(samples(), 20), 100..200),
        rounds in prop_oneof![Just(0u32), Just(0u32.wrapping_sub(1)), 4_194_302..4_194_304u32],
    ) {
        let packets: Vec<_> =
            frames.iter().zip(0..).map(|(samples, sequence)| packet(sequence, samples)).collect();
        let mut lines = Lines::new(packets.iter().cloned());
        let (mut dma, mut model) = (Dma::after(rounds), Model::default());
        let mut taken = 0;
        for step in steps {
            match step {
                Step::Send(bytes) => dma.send(lines.next(bytes)),
                Step::Restart => {
                    dma.look();
                    model.look(dma.written);
                    dma.ring.restart();
                    model.restart(dma.written);
                }
                Step::Take(before, after) => {
                    let meanwhile = [lines.next(before).to_vec(), lines.next(after).to_vec()];
                    let written = dma.written;
                    let got = dma.take(20, [&meanwhile[0], &meanwhile[1]]);
                    model.look(written);
                    let expected = model.find(written, &lines.packets);
                    prop_assert_eq!(got.as_ref().map(|got| got.0.sequence as usize), expected);
                    let Some((found, bytes, is_there)) = got else {
                        // What came meanwhile was not looked at.
                        dma.send(&meanwhile.concat());
                        continue;
                    };
                    model.look(dma.written);
                    let sequence = expected.unwrap();
                    prop_assert_eq!(is_there, model.taken == lines.packets[sequence].start);
                    if is_there {
                        prop_assert_eq!((found.run, &bytes), (3, &packets[sequence]));
                        (model.taken, model.next) = (lines.packets[sequence].end, sequence + 1);
                        taken += 1;
                    }
                }
            }
        }
        prop_assert!(taken <= packets.len());
    }

    #[test]
    fn a_cut_packet_costs_no_other(
        frames in prop::collection::vec(
            (prop::collection::vec(samples(), 70), prop::option::weighted(0.3, (any::<prop::sample::Index>(), 1..300usize))),
            1..40,
        ),
        shift in 0..4usize,
    ) {
        let mut dma = Dma::after(0);
        dma.send(&[7; 4][..shift]);
        let (mut intact, mut got) = (Vec::new(), Vec::new());
        for ((samples, damage), sequence) in frames.iter().zip(0..) {
            let mut bytes = packet(sequence, samples);
            match damage {
                Some((at, lost)) => {
                    let at = at.index(bytes.len() - 1);
                    let end = (at + lost).min(bytes.len() - 1);
                    bytes.drain(at..end);
                }
                None => intact.push(bytes.clone()),
            }
            // A start cuts a packet without a zero behind it.
            let behind: &[u8] = if damage.is_some() && sequence % 2 == 0 { &[] } else { &[0; 3] };
            dma.send(&[&[0], &bytes[..bytes.len() - usize::from(behind.is_empty())], behind].concat());
            while let Some((_, bytes, is_there)) = dma.take(70, [&[], &[]]) {
                prop_assert!(is_there);
                got.push(bytes);
            }
        }
        dma.send(&[0; 4]);
        got.extend(dma.take(70, [&[], &[]]).map(|(_, bytes, _)| bytes));
        got.retain(|bytes| intact.contains(bytes));
        prop_assert_eq!(got, intact);
    }
}

/// Both together are no longer than a packet may be.
#[test]
fn what_is_left_of_a_cut_packet_is_not_taken_for_the_beginning_of_the_next() {
    for left in 1..=2 {
        let (cut, whole) = (packet(0, &[5; 220]), packet(1, &[0; 220]));
        let mut dma = Dma::after(0);
        dma.send(&[&[0], &cut[..left], &[0], &whole[..], &[0; 7]].concat());
        let (_, bytes, is_there) = dma.take(220, [&[], &[]]).unwrap();
        assert!(is_there);
        assert_eq!(bytes, whole, "{left} bytes left");
    }
}

/// After so long without a look, the ring cannot tell how often the channel went round.
#[test]
fn a_pause_of_a_rounds_time_counts_as_an_overrun() {
    let round_us = BYTES / BYTES_PER_MICRO - LOOK.0;
    for (pause, is_found) in [(round_us - 1, true), (round_us + 1, false)] {
        let mut dma = Dma::after(0);
        dma.look();
        let samples = [5; 4];
        dma.send(&Lines::new([packet(0, &samples)].into_iter()).bytes);
        dma.now.0 = pause;
        assert_eq!(dma.take(4, [&[], &[]]).is_some(), is_found, "{pause} us");
    }
}

#[test]
fn bytes_that_were_there_before_the_first_look_are_no_packet() {
    let mut dma = Dma::after(0);
    dma.send(&Lines::new([packet(0, &[5; 4])].into_iter()).bytes);
    dma.look();
    dma.ring.restart();
    assert!(dma.take(4, [&[], &[]]).is_none());
    dma.send(&Lines::new([packet(1, &[5; 4])].into_iter()).bytes);
    assert_eq!(dma.take(4, [&[], &[]]).unwrap().0.sequence, 1);
}

/// The longest packets have room in a ring of the reference board, and in a place of the link.
#[test]
fn a_packet_needs_at_most_six_bytes_of_room_more_than_it_has() {
    for at in 0..4 {
        let length = *ready::packet_lengths(1024, Width::Bits32).end() as u32;
        let found = Found { at, length, run: 0, sequence: 0 };
        assert!(found.room_bytes() <= length as usize + 6);
        assert!(found.room_bytes() <= ready::MAX_READ_BYTES);
    }
}
