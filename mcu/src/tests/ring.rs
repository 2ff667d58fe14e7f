//! Tests of the ring against a list of packets, between an FPGA that keeps to its grants and a host that reads at any
//! pace.

use super::*;
use nirspi_wire::packet::seal;
use nirspi_wire::ready::Head;
use nirspi_wire::{FrameFlags, ready};
use proptest::prelude::*;
use std::boxed::Box;
use std::collections::VecDeque;
use std::vec::Vec;

const WORDS: usize = 256;
const BYTES: usize = 4 * WORDS;
/// Packets that the link has room for.
const PLACES: usize = 3;

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

/// The lines of the FPGA: what it sends, and where each packet begins and ends in that.
#[derive(Default)]
struct Lines {
    bytes: Vec<u8>,
    packets: Vec<Range<usize>>,
}

impl Lines {
    fn new(packets: impl Iterator<Item = Vec<u8>>) -> Self {
        let mut lines = Self::default();
        for packet in packets {
            let begin = lines.bytes.len() + 1;
            lines.packets.push(begin..begin + packet.len());
            lines.bytes.extend([&[0], &packet[..], &[0; 3]].concat());
        }
        lines
    }
}

/// The ring between the FPGA and the host.
struct Bench {
    ring: Ring,
    memory: &'static RingMemory<WORDS>,
    /// What the ring has counted before.
    before: u32,
    bytes: Vec<u8>,
    /// Bytes that the FPGA has sent, and bytes in memory.
    sent: usize,
    written: usize,
    /// Bytes that the FPGA may send.
    granted: usize,
    /// What is on its way to the host, and what it has to be.
    loans: VecDeque<(Loan, Vec<u8>)>,
}

impl Bench {
    /// A ring that has counted so many rounds, with these bytes to come.
    fn after(rounds: u32, bytes: Vec<u8>) -> Self {
        let memory: &'static RingMemory<WORDS> = Box::leak(Box::new(RingMemory::new()));
        memory.words.iter().for_each(|word| word.store(0x5555_5555, Ordering::Relaxed));
        let before = rounds.wrapping_mul(BYTES as u32);
        memory.returned.store(before, Ordering::Relaxed);
        let ring = Ring { written: before, taken: before, lent: before, ..Ring::new(memory) };
        let loans = VecDeque::new();
        let mut bench =
            Self { ring, memory, before, bytes, sent: 0, written: 0, granted: 0, loans };
        bench.look();
        bench
    }

    fn of(bytes: &[u8]) -> Self {
        Self::after(0, bytes.to_vec())
    }

    /// The FPGA sends so many bytes if it may, and all but the last few of them get into memory.
    fn send(&mut self, bytes: usize, behind: usize) {
        let bytes = bytes.min(self.granted).min(self.bytes.len() - self.sent);
        self.granted -= bytes;
        self.sent += bytes;
        while self.sent - self.written >= 4.max(behind) {
            let word = self.bytes[self.written..][..4].try_into().unwrap();
            self.memory.words[self.written / 4 % WORDS]
                .store(u32::from_le_bytes(word), Ordering::Relaxed);
            self.written += 4;
        }
    }

    fn look(&mut self) {
        self.ring.came(self.written % BYTES);
        let Micros(grant) = self.ring.grant();
        // The timer is exact to two microseconds, and some bytes come after the line has fallen.
        self.granted =
            if grant == 0 { 4 } else { (grant as usize + 2) * BYTES_PER_MICRO as usize + 4 };
    }

    /// Takes up to so many packets that follow each other; returns their numbers and whether the link got them.
    fn take(&mut self, patterns: u16, most: usize) -> (Vec<u32>, bool) {
        let mut found: Vec<Found> = Vec::new();
        while found.len() < most
            && let Some(next) = self.ring.next(patterns, Width::Bits32)
            && (found.is_empty() || next.follows)
        {
            self.ring.take(&next);
            found.push(next);
        }
        let numbers = found.iter().map(|found| found.sequence).collect();
        let (Some(first), Some(last)) = (found.first(), found.last()) else {
            return (numbers, false);
        };
        let place = |at: u32| at.wrapping_sub(self.before) as usize;
        let (begin, at, end) =
            (place(first.at & !3), place(first.at), place(last.at.wrapping_add(last.length)));
        let expected = [&[0; 3][..at - begin], &self.bytes[at..end]].concat();
        let loans = &mut self.loans;
        let has_room = loans.len() < PLACES;
        let is_lent = self.ring.lend((first, last), |loan| {
            if has_room {
                loans.push_back((loan, expected));
            }
            has_room
        });
        (numbers, is_lent)
    }

    /// The host has the next bytes of what was lent first. Whether they are what the FPGA has sent.
    fn fetch(&mut self) -> bool {
        let Some((loan, expected)) = self.loans.front_mut() else { return true };
        let (words, length) = loan.next();
        assert!(length > 0 && words.len() * 4 >= length);
        let got = words.iter().flat_map(|word| word.load(Ordering::Relaxed).to_le_bytes());
        let is_same = got.take(length).eq(expected.drain(..length));
        loan.sent(length);
        if loan.is_over() {
            assert_eq!(expected, &[]);
            self.loans.pop_front();
        }
        is_same
    }

    /// All of it comes and goes.
    fn drain(&mut self, patterns: u16) -> Vec<u32> {
        let mut numbers = Vec::new();
        for _ in 0..10 + 40 * self.bytes.len() / BYTES {
            self.send(usize::MAX, 0);
            self.look();
            loop {
                let (more, _) = self.take(patterns, 2);
                if more.is_empty() {
                    break;
                }
                numbers.extend(more);
            }
            while !self.loans.is_empty() {
                assert!(self.fetch());
            }
        }
        numbers
    }
}

#[derive(Debug, Clone)]
enum Step {
    Send(usize, usize),
    Look,
    Take(usize),
    Fetch,
    Restart,
    GiveBack,
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let bytes = prop_oneof![2 => 0..150usize, 2 => 0..900usize, 1 => 900..3000usize];
    let step = prop_oneof![
        6 => (bytes, 0..=IN_FLIGHT as usize).prop_map(|(bytes, behind)| Step::Send(bytes, behind)),
        5 => Just(Step::Look),
        6 => (1..5usize).prop_map(Step::Take),
        5 => Just(Step::Fetch),
        1 => Just(Step::Restart),
        1 => Just(Step::GiveBack),
    ];
    prop::collection::vec(step, 1..200)
}

fn samples() -> impl Strategy<Value = i32> {
    prop_oneof![Just(0), -3..300, any::<i32>()]
}

proptest! {
    #[test]
    fn every_packet_is_lent_once_and_stays_until_it_is_back(
        steps in steps(),
        frames in prop::collection::vec(prop::collection::vec(samples(), 20), 100..200),
        rounds in prop_oneof![Just(0u32), Just(0u32.wrapping_sub(1)), 4_194_302..4_194_304u32],
    ) {
        let packets: Vec<_> =
            frames.iter().zip(0..).map(|(samples, sequence)| packet(sequence, samples)).collect();
        let lines = Lines::new(packets.iter().cloned());
        let mut bench = Bench::after(rounds, lines.bytes.clone());
        // The packet that comes next, and the place where that one begins at the earliest.
        let (mut next, mut from) = (0, 0);
        for step in steps {
            match step {
                Step::Send(bytes, behind) => bench.send(bytes, behind),
                Step::Look => bench.look(),
                Step::Take(most) => {
                    let (numbers, _) = bench.take(20, most);
                    for number in numbers {
                        while lines.packets[next].start <= from && from > 0 {
                            next += 1;
                        }
                        from = 0;
                        prop_assert_eq!(number as usize, next);
                        next += 1;
                    }
                }
                Step::Fetch => prop_assert!(bench.fetch(), "it has changed"),
                Step::GiveBack => {
                    bench.loans.iter_mut().for_each(|(loan, _)| loan.give_back());
                    bench.loans.clear();
                }
                Step::Restart => {
                    bench.look();
                    bench.ring.restart();
                    from = bench.written;
                }
            }
        }
        // Nothing stands still: whatever has happened, the rest comes.
        while !bench.loans.is_empty() {
            prop_assert!(bench.fetch(), "it has changed");
        }
        while lines.packets.get(next).is_some_and(|packet| packet.start <= from && from > 0) {
            next += 1;
        }
        let last = lines.bytes.len() / 4 * 4;
        let whole = lines.packets.iter().take_while(|packet| packet.end <= last).count() as u32;
        prop_assert_eq!(bench.drain(20), (next as u32..whole.max(next as u32)).collect::<Vec<_>>());
    }

    #[test]
    fn a_cut_packet_costs_no_other(
        frames in prop::collection::vec(
            (prop::collection::vec(samples(), 70), prop::option::weighted(0.3, (any::<prop::sample::Index>(), 1..300usize))),
            1..40,
        ),
        shift in 0..4usize,
    ) {
        let mut bytes = [7; 4][..shift].to_vec();
        let mut intact = Vec::new();
        for ((samples, damage), sequence) in frames.iter().zip(0..) {
            let mut packet = packet(sequence, samples);
            match damage {
                Some((at, lost)) => {
                    let at = at.index(packet.len() - 1);
                    let end = (at + lost).min(packet.len() - 1);
                    packet.drain(at..end);
                }
                None => intact.push(packet.clone()),
            }
            // A start cuts a packet without a zero behind it.
            let behind: &[u8] = if damage.is_some() && sequence % 2 == 0 { &[] } else { &[0; 3] };
            let end = packet.len() - usize::from(behind.is_empty());
            bytes.extend([&[0], &packet[..end], behind].concat());
        }
        bytes.extend([0; 4]);
        let mut bench = Bench::after(0, bytes);
        let mut got = Vec::new();
        while bench.sent < bench.bytes.len() {
            bench.send(300, 0);
            bench.look();
            while let Some(found) = bench.ring.next(70, Width::Bits32) {
                let mut room = std::vec![0; found.room_bytes()];
                let place = bench.ring.copy(&found, &mut room);
                let bytes = room[place].to_vec();
                bench.ring.take(&found);
                let is_lent = bench.ring.lend((&found, &found), |mut loan| {
                    // The host has nothing but the packet.
                    let mut host = Vec::new();
                    while !loan.is_over() {
                        let (words, length) = loan.next();
                        host.extend(words.iter().flat_map(|word| word.load(Ordering::Relaxed).to_le_bytes()).take(length));
                        loan.sent(length);
                    }
                    let zeros = host.len() - bytes.len();
                    assert!(zeros < 4 && host[..zeros].iter().all(|byte| *byte == 0));
                    assert_eq!(&host[zeros..], bytes);
                    true
                });
                prop_assert!(is_lent);
                got.push(bytes);
            }
        }
        got.retain(|bytes| intact.contains(bytes));
        prop_assert_eq!(got, intact);
    }
}

/// Both together are no longer than a packet may be.
#[test]
fn what_is_left_of_a_cut_packet_is_not_taken_for_the_beginning_of_the_next() {
    for left in 1..=2 {
        let (cut, whole) = (packet(0, &[5; 150]), packet(1, &[0; 150]));
        let mut bench = Bench::of(&[&[0], &cut[..left], &[0], &whole[..], &[0; 7]].concat());
        bench.send(usize::MAX, 0);
        bench.look();
        let found = bench.ring.next(150, Width::Bits32).unwrap();
        let mut room = std::vec![0; found.room_bytes()];
        let place = bench.ring.copy(&found, &mut room);
        assert_eq!(room[place], whole, "{left} bytes left");
    }
}

#[test]
fn bytes_that_were_there_before_the_first_look_are_no_packet() {
    let packets = [packet(0, &[5; 4]), packet(1, &[5; 4])];
    let mut bench = Bench::of(&Lines::new(packets.iter().cloned()).bytes);
    bench.send(packets[0].len() + 4, 0);
    bench.look();
    bench.ring.restart();
    assert!(bench.take(4, 1).0.is_empty());
    bench.send(usize::MAX, 0);
    bench.look();
    assert_eq!(bench.take(4, 1).0, [1]);
}

/// The FPGA may send until the ring is full but for the margin, and again what comes back.
#[test]
fn a_grant_ends_where_the_ring_would_be_full() {
    let packets = (0..30).map(|sequence| packet(sequence, &[5; 20]));
    let mut bench = Bench::of(&Lines::new(packets).bytes);
    let free = |bench: &Bench| bench.ring.grant().0 * u64::from(BYTES_PER_MICRO);
    let all = BYTES as u64 - u64::from(MARGIN);
    assert!((all - 41..=all).contains(&free(&bench)));
    for _ in 0..30 {
        if bench.ring.is_full() {
            break;
        }
        bench.send(100, 0);
        bench.look();
        bench.take(20, 1);
    }
    assert!(bench.ring.is_full(), "none of it has come back");
    assert!(bench.written + MARGIN as usize <= BYTES + 2 * 42 + 4);
    assert!(bench.fetch());
    bench.look();
    // A packet and what surrounds it, if all that is sent was looked at.
    let one = free(&bench);
    assert!((70..=130).contains(&one), "{one}");
    while !bench.loans.is_empty() {
        assert!(bench.fetch());
    }
    bench.look();
    let rest = free(&bench);
    assert!(rest > 500, "what was dropped is free too: {rest}");
}

/// An FPGA that does not wait: what comes after that is right again.
#[test]
fn an_overrun_is_forgotten() {
    let packets = (0..40).map(|sequence| packet(sequence, &[5; 20]));
    let mut bench = Bench::of(&Lines::new(packets).bytes);
    for _ in 0..9 {
        bench.send(130, 0);
        bench.granted = 1000;
        bench.ring.came(bench.written % BYTES);
    }
    assert_eq!(bench.take(20, 1).0, []);
    bench.look();
    let got = bench.drain(20);
    assert!(got.len() > 25 && got.is_sorted_by(|a, b| a + 1 == *b), "{got:?}");
}

/// Bytes have been lost between two packets, so that the second begins in a word that USB still reads.
#[test]
fn a_word_that_is_lent_is_left_alone() {
    let both = [packet(0, &[5; 20]), packet(1, &[5; 20])];
    for shift in 0..4 {
        let bytes = [&[0; 4][..=shift], &both[0], &both[1], &[0; 7]].concat();
        let shares = !(shift + 1 + both[0].len()).is_multiple_of(4);
        let mut bench = Bench::of(&bytes);
        bench.send(usize::MAX, 0);
        bench.look();
        assert_eq!(bench.take(20, 1), (std::vec![0], true));
        assert_eq!(bench.take(20, 1), (std::vec![1], !shares), "{shift}");
        assert!(bench.fetch());
    }
}

/// The longest packets have room in a ring of the reference board, and in a place of the link.
#[test]
fn a_packet_needs_at_most_six_bytes_of_room_more_than_it_has() {
    for at in 0..4 {
        let length = *ready::packet_lengths(1024, Width::Bits32).end() as u32;
        let found = Found { at, length, follows: false, run: 0, sequence: 0 };
        assert!(found.room_bytes() <= length as usize + 6);
        assert!(found.room_bytes() <= ready::MAX_READ_BYTES);
    }
}

#[test]
fn room_and_distance_of_packets_are_counted_in_bytes_and_words() {
    let found = |at, length| Found { at, length, follows: true, run: 3, sequence: 0 };
    // Whole words, from the one in which the packet begins.
    assert_eq!(found(1_000, 50).room_bytes(), 52);
    assert_eq!(found(1_001, 50).room_bytes(), 52);
    assert_eq!(found(1_003, 50).room_bytes(), 56);
    assert_eq!(found(u32::MAX, 1).room_bytes(), 4);
    assert_eq!(found(1_000, 50).bytes_to(&found(1_100, 60)), 160);
    assert_eq!(found(u32::MAX - 9, 4).bytes_to(&found(10, 5)), 25);
}

#[test]
fn a_loan_has_a_second_piece_where_the_memory_ends() {
    let memory: &'static RingMemory<WORDS> = Box::leak(Box::new(RingMemory::new()));
    let size = BYTES as u32;
    for (begin, end, expected) in [
        (8, 20, &[(2, 12)][..]),
        (size - 8, size, &[(WORDS - 2, 8)][..]),
        (size - 8, size + 13, &[(WORDS - 2, 8), (0, 13)][..]),
        (16, 16, &[][..]),
    ] {
        let loan = Loan { words: &memory.words, returned: &memory.returned, begin, end };
        let pieces = loan.pieces().map(|(words, length)| (WORDS - words.len(), length));
        assert_eq!(pieces.take(3).collect::<Vec<_>>(), expected);
    }
}

/// A link that says nothing of loans.
struct Plain;

impl crate::PacketSink for Plain {
    fn claim(&mut self, _length: usize) -> Option<&mut [u8]> {
        None
    }

    fn commit(&mut self, _part: Range<usize>) {}
}

#[test]
fn a_link_that_says_nothing_of_loans_takes_none() {
    let memory: &'static RingMemory<WORDS> = Box::leak(Box::new(RingMemory::new()));
    let loan = Loan { words: &memory.words, returned: &memory.returned, begin: 0, end: 8 };
    assert!(!crate::PacketSink::lend(&mut Plain, loan));
}

/// Lengths of packets differ by their blocks, so a packet may be as long as the shortest and not be there whole.
#[test]
fn a_packet_is_waited_for_until_its_end_has_come() {
    let whole = packet(7, &[0x0101_0101; 150]);
    let lengths = ready::packet_lengths(150, Width::Bits32);
    assert!(*lengths.start() + 1 < whole.len() && whole.len() <= *lengths.end());
    for lead in 1..=4 {
        let mut bench = Bench::of(&[&[0; 4][..lead], &whole[..], &[0; 7]].concat());
        let mut numbers = Vec::new();
        while bench.written + 4 <= bench.bytes.len() {
            bench.send(4, 0);
            bench.look();
            numbers.extend(bench.take(150, 1).0);
        }
        assert_eq!(numbers, [7], "{lead} zeros before");
    }
}

/// The firmware would count such a packet as forwarded, and the host as damaged.
#[test]
fn a_packet_that_has_lost_bytes_is_passed_over_and_the_next_one_is_found() {
    let shortest = *ready::packet_lengths(20, Width::Bits32).start();
    for length in [shortest - 30, shortest - 4, shortest - 2, shortest - 1] {
        let sound = packet(0, &[0x0101_0101; 20]);
        let lost = sound.len() - length;
        let cut = [&sound[..50], &sound[50 + lost..]].concat();
        let mut bench = Bench::of(&Lines::new([cut, packet(1, &[5; 20])].into_iter()).bytes);
        bench.send(usize::MAX, 0);
        bench.look();
        assert_eq!(bench.take(20, 1).0, [1], "{length} bytes");
    }
}

/// Two packets whose zeros between them were lost, for example.
#[test]
fn a_packet_that_is_longer_than_any_is_passed_over() {
    let longest = *ready::packet_lengths(20, Width::Bits32).end();
    for extra in 1..=6 {
        for lead in 1..=4 {
            let sound = packet(0, &[0x0101_0101; 20]);
            let more = longest + extra - sound.len();
            let long = [&sound[..50], &[7; 6][..more], &sound[50..]].concat();
            let next = packet(1, &[5; 20]);
            let bytes = [&[0; 4][..lead], &long, &[0; 3], &next, &[0; 7]].concat();
            let mut bench = Bench::of(&bytes);
            bench.send(usize::MAX, 0);
            bench.look();
            assert_eq!(bench.take(20, 1).0, [1], "{extra} bytes, {lead} zeros before");
        }
    }
}
