//! The ring in memory into which a DMA channel writes what the FPGA's parallel port sends, and out of which USB sends
//! it.
//!
//! No byte is copied. The FPGA's packets lie in the ring as they are on the host's link, with zeros between them, which
//! are empty packets there. So a stretch of successive packets is lent to the link as it is ([`Loan`]), and comes back
//! when the host has it.
//!
//! The channel goes round and round and never waits, so the FPGA must: it sends while the line `parallel_ready` is
//! high. At each look at the channel the ring says for how long the line may stay high from then on
//! ([`Ring::grant`]): until the free part of the ring could be full. A timer lets the line fall, so nothing is
//! overwritten however late the next look comes.
//!
//! # Invariant
//! - What is lent stays as it is until it comes back, and what has not been taken stays too, while the FPGA keeps to
//!   the grants (`tests::every_packet_is_lent_once_and_stays_until_it_is_back`).
//! - Each packet is taken at most once, in order. What a start or a fault has cut costs no other packet
//!   (`tests::a_cut_packet_costs_no_other`).

use crate::Micros;
use core::ops::Range;
use core::sync::atomic::{AtomicU32, Ordering, fence};
use nirspi_wire::ADC_HZ;
use nirspi_wire::ready::{self, NUMBER_BYTES};
use nirspi_wire::samples::Width;

/// The parallel port sends a byte in three clocks of 8 ns: 41.7 bytes in a microsecond at most.
const BYTES_PER_MICRO: u32 = 42;

const _: () = assert!(BYTES_PER_MICRO * 3_000_000 >= ADC_HZ);

/// Bytes that may be on their way into memory when the channel says where it writes next.
const IN_FLIGHT: u32 = 64;

/// Bytes that stay free beyond a grant: those in flight; four that the FPGA may send after the line has fallen
/// (`docs/log/gateware.md`, Parallel port); those of the two microseconds to which a timer is exact; and as many again.
const MARGIN: u32 = 256;

const _: () = assert!(MARGIN >= IN_FLIGHT + 4 + 2 * BYTES_PER_MICRO);

/// The memory of a ring of four-byte words.
#[derive(Debug)]
pub struct RingMemory<const WORDS: usize> {
    words: [AtomicU32; WORDS],
    /// The first byte of the ring that is still lent.
    returned: AtomicU32,
}

impl<const WORDS: usize> RingMemory<WORDS> {
    /// Memory of zeros.
    #[must_use]
    pub const fn new() -> Self {
        Self { words: [const { AtomicU32::new(0) }; WORDS], returned: AtomicU32::new(0) }
    }

    /// Where the DMA channel writes: round and round, from the first word on.
    pub const fn words(&self) -> &[AtomicU32; WORDS] {
        &self.words
    }
}

impl<const WORDS: usize> Default for RingMemory<WORDS> {
    fn default() -> Self {
        Self::new()
    }
}

/// What has come into a ring, and what of it has been taken and lent. Bytes are numbered from power-up, modulo 2^32.
#[derive(Debug)]
pub struct Ring {
    words: &'static [AtomicU32],
    returned: &'static AtomicU32,
    /// The byte that the channel writes next, as of the last look: a multiple of four.
    written: u32,
    /// The first byte that has not been taken.
    taken: u32,
    /// The end of what was lent last. Everything lent has come back if `returned` is the same.
    lent: u32,
    /// The byte before `taken` is a zero, so the next other byte begins a packet.
    is_between: bool,
    /// Nothing but zeros lies between the packet that was taken last and `taken`.
    follows: bool,
}

/// A packet in the ring.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Found {
    at: u32,
    length: u32,
    /// Nothing but zeros lies between the packet before and this one.
    pub follows: bool,
    /// Number of the run, and of the frame in it, as the packet says. No checksum has been looked at.
    pub run: u16,
    pub sequence: u32,
}

impl Found {
    /// Room that [`Ring::copy`] needs: whole words of the ring.
    pub fn room_bytes(&self) -> usize {
        let bytes = (self.at & 3).saturating_add(self.length);
        bytes.next_multiple_of(4) as usize
    }

    /// Bytes from the first one of this packet to the last one of that, which comes after it.
    pub fn bytes_to(&self, last: &Self) -> u32 {
        last.at.wrapping_add(last.length).wrapping_sub(self.at)
    }
}

/// Bytes of a ring on their way to the host: whole packets with zeros between them. They stay as they are until they
/// are given back.
#[derive(Debug, Clone)]
pub struct Loan {
    words: &'static [AtomicU32],
    returned: &'static AtomicU32,
    /// A multiple of four.
    begin: u32,
    end: u32,
}

impl Loan {
    /// The bytes to send next: so many, of these words. Where the loan goes on at the beginning of the ring's memory,
    /// these are the bytes before.
    #[must_use]
    pub fn next(&self) -> (&'static [AtomicU32], usize) {
        let size = bytes_of(self.words);
        let at = self.begin & size.wrapping_sub(1);
        let length = self.end.wrapping_sub(self.begin).min(size.wrapping_sub(at));
        (self.words.get(at as usize / 4..).unwrap_or(&[]), length as usize)
    }

    /// The bytes of the whole loan, in the pieces that [`next`](Self::next) gives one after the other.
    pub fn pieces(&self) -> impl Iterator<Item = (&'static [AtomicU32], usize)> {
        let mut rest = self.clone();
        core::iter::from_fn(move || {
            let (words, length) = rest.next();
            rest.begin = rest.begin.wrapping_add(length as u32);
            (length > 0).then_some((words, length))
        })
    }

    /// Gives back so many bytes, which have been sent: all that [`next`](Self::next) gave.
    pub fn sent(&mut self, bytes: usize) {
        self.begin = self.begin.wrapping_add(bytes as u32);
        // What was read of them was read before.
        fence(Ordering::SeqCst);
        self.returned.store(self.begin, Ordering::Release);
    }

    /// Bytes that have not been given back.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        self.end.wrapping_sub(self.begin) as usize
    }

    /// Whether all of it has been given back.
    #[must_use]
    pub const fn is_over(&self) -> bool {
        self.begin == self.end
    }

    /// Gives back what has not been sent. Loans come back in the order in which they were made.
    pub fn give_back(&mut self) {
        self.sent(self.bytes());
    }
}

const fn bytes_of(words: &[AtomicU32]) -> u32 {
    (words.len() as u32).wrapping_mul(4)
}

impl Ring {
    /// A ring in this memory, which a DMA channel fills from the first word on.
    #[must_use]
    pub const fn new<const WORDS: usize>(memory: &'static RingMemory<WORDS>) -> Self {
        // Bytes are numbered modulo 2^32, and a round must divide that.
        const { assert!(WORDS.is_power_of_two() && 4 * WORDS > 2 * MARGIN as usize) };
        Self {
            words: &memory.words,
            returned: &memory.returned,
            written: 0,
            taken: 0,
            lent: 0,
            is_between: false,
            follows: false,
        }
    }

    /// Bytes of a round.
    const fn size(&self) -> u32 {
        bytes_of(self.words)
    }

    /// Notes that the channel writes next at this byte of the memory. A channel at the end of the memory may say so, or
    /// that it is at the beginning.
    ///
    /// An FPGA that sends beyond its [grant](Self::grant) has overwritten something: the ring then forgets what has
    /// not been taken. The host finds by CRC-32 what was lent and has changed.
    pub fn came(&mut self, place: usize) {
        // What was in memory when the channel's place was read is read after it.
        fence(Ordering::SeqCst);
        let new = (place as u32).wrapping_sub(self.written) & self.size().wrapping_sub(1) & !3;
        self.written = self.written.wrapping_add(new);
        if self.used() > self.size().saturating_sub(IN_FLIGHT) {
            self.restart();
        }
    }

    /// For how long the FPGA may send, from the time on at which the channel's place was read for
    /// [`came`](Self::came): until what it sends could reach bytes that are lent or have not been taken.
    #[must_use]
    pub fn grant(&self) -> Micros {
        let free = self.size().saturating_sub(self.used()).saturating_sub(MARGIN);
        Micros(u64::from(free / BYTES_PER_MICRO))
    }

    /// Whether the FPGA waits for room.
    pub(crate) fn is_full(&self) -> bool {
        self.grant() == Micros(0)
    }

    fn has_lent(&self) -> bool {
        self.returned.load(Ordering::Acquire) != self.lent
    }

    /// Bytes that must stay.
    fn used(&self) -> u32 {
        let returned = self.returned.load(Ordering::Acquire);
        let first = if returned == self.lent { self.taken } else { returned };
        self.written.wrapping_sub(first)
    }

    /// Forgets all that has come until the last look and was not lent. What comes is looked at from its first zero on:
    /// the FPGA sends one before each packet.
    pub(crate) const fn restart(&mut self) {
        self.taken = self.written;
        self.is_between = false;
        self.follows = false;
    }

    /// Finds the next packet that is there whole. Bytes before it that are no packet of so many patterns are taken.
    ///
    /// Of a packet only its beginning and its end are looked at: a packet that misses bytes has a zero in one of these
    /// places, because zeros stand on both sides of each packet.
    pub(crate) fn next(&mut self, patterns: u16, width: Width) -> Option<Found> {
        let lengths = ready::packet_lengths(patterns, width);
        let (shortest, longest) = (*lengths.start() as u32, *lengths.end() as u32);
        loop {
            if !self.is_between {
                self.follows = false;
                let there = self.written.wrapping_sub(self.taken);
                let zero = self.zero_in(self.taken, there);
                self.is_between = zero.is_some();
                self.taken = self.taken.wrapping_add(zero.unwrap_or(there));
            }
            self.skip_zeros();
            let there = self.written.wrapping_sub(self.taken);
            if there < shortest {
                return None;
            }
            let last = shortest.saturating_sub(1);
            let behind = self.taken.wrapping_add(last);
            let end = self.zero_in(behind, there.min(longest).saturating_sub(last));
            // What is left of a cut packet and a whole one after it are together as long as a packet only if the first
            // is shorter than the lengths differ.
            let differ = longest.saturating_sub(shortest).saturating_add(1);
            let starts = self.zero_in(self.taken, differ).is_some();
            let is_cut = starts || end == Some(0) && self.byte(behind.wrapping_sub(1)) == 0;
            match end {
                Some(end) if !is_cut => return Some(self.found(shortest.saturating_add(end))),
                None if !is_cut && there < longest => return None,
                // What was cut, or has lost its end, goes up to the next zero.
                _ => self.is_between = false,
            }
        }
    }

    /// The packet of this length that begins at `taken`.
    fn found(&self, length: u32) -> Found {
        let words = [0, 4, 8].map(|at| self.four(self.taken.wrapping_add(at)).to_le_bytes());
        let mut beginning = [0; NUMBER_BYTES];
        for (to, byte) in beginning.iter_mut().zip(words.as_flattened()) {
            *to = *byte;
        }
        let (run, sequence) = ready::numbers(&beginning);
        Found { at: self.taken, length, follows: self.follows, run, sequence }
    }

    /// Takes zeros, up to the last that has come.
    fn skip_zeros(&mut self) {
        while self.taken != self.written {
            let offset = self.taken & 3;
            let rest = self.word(self.taken).wrapping_shr(offset << 3);
            let zeros = (rest.trailing_zeros() >> 3).min(4_u32.saturating_sub(offset));
            self.taken = self.taken.wrapping_add(zeros);
            if rest != 0 {
                break;
            }
        }
    }

    /// Where the first zero is among so many bytes from this one on, counted from there. Four bytes are looked at at a
    /// time.
    fn zero_in(&self, at: u32, bytes: u32) -> Option<u32> {
        const ONES: u32 = 0x0101_0101;
        let offset = at & 3;
        let mut begin = 0_u32.wrapping_sub(offset);
        // Bytes before the first are no zeros.
        let mut word = self.word(at) | !u32::MAX.wrapping_shl(offset << 3);
        loop {
            // The lowest of these bits is that of the first zero.
            let zeros = word.wrapping_sub(ONES) & !word & ONES << 7;
            if zeros != 0 {
                let found = begin.wrapping_add(zeros.trailing_zeros() >> 3);
                return Some(found).filter(|found| *found < bytes);
            }
            begin = begin.wrapping_add(4);
            if begin >= bytes {
                return None;
            }
            word = self.word(at.wrapping_add(begin));
        }
    }

    /// The index of the word that has this byte.
    fn index(&self, at: u32) -> usize {
        (at & self.size().wrapping_sub(1)) as usize / 4
    }

    /// The word that has this byte.
    fn word(&self, at: u32) -> u32 {
        self.words.get(self.index(at)).map_or(0, |word| word.load(Ordering::Relaxed))
    }

    /// Four bytes from this one on.
    fn four(&self, at: u32) -> u32 {
        let shift = (at & 3) << 3;
        let two = u64::from(self.word(at.wrapping_add(3))) << 32 | u64::from(self.word(at));
        // The second word is the first again where `at` is a multiple of four, and is shifted out then.
        two.wrapping_shr(shift) as u32
    }

    fn byte(&self, at: u32) -> u8 {
        self.word(at).wrapping_shr((at & 3) << 3) as u8
    }

    /// Copies the words that hold this packet into `room` of [`Found::room_bytes`], and returns where the packet lies
    /// there. Only packets that have not been lent may be copied.
    pub(crate) fn copy(&self, found: &Found, room: &mut [u8]) -> Range<usize> {
        let (to, _) = room.as_chunks_mut();
        let cut = self.words.split_at_checked(self.index(found.at));
        let (first, last) = cut.unwrap_or((self.words, &[]));
        for (to, word) in to.iter_mut().zip(last.iter().chain(first)) {
            *to = word.load(Ordering::Relaxed).to_le_bytes();
        }
        let begin = found.at as usize % 4;
        begin..begin.saturating_add(found.length as usize)
    }

    /// Takes the packet that [`next`](Self::next) has found. It stays where it is at least until the FPGA's next
    /// grant.
    pub(crate) const fn take(&mut self, found: &Found) {
        self.taken = found.at.wrapping_add(found.length);
        self.follows = true;
    }

    /// Lends what lies from the first of these packets to the last, all of which have been taken and follow each
    /// other. False: the link has no room for it, and the bytes are free.
    pub(crate) fn lend(
        &mut self,
        (first, last): (&Found, &Found),
        send: impl FnOnce(Loan) -> bool,
    ) -> bool {
        // USB begins to read at a multiple of four.
        let begin = first.at & !3;
        if !self.has_lent() {
            self.lent = begin;
            self.returned.store(begin, Ordering::Release);
        } else if self.lent.wrapping_sub(begin) < 4 && self.lent != begin {
            // Bytes have been lost between two packets: this one begins in a word that is lent.
            return false;
        }
        // The bytes before the packet are zeros, but for what a start has cut.
        if let Some(word) = self.words.get(self.index(begin)) {
            let before = u32::MAX.wrapping_shl((first.at & 3) << 3);
            word.fetch_and(before, Ordering::Relaxed);
        }
        let end = last.at.wrapping_add(last.length);
        // What the link reads was written before.
        fence(Ordering::SeqCst);
        let loan = Loan { words: self.words, returned: self.returned, begin, end };
        let is_lent = send(loan);
        if is_lent {
            self.lent = end;
        }
        is_lent
    }
}

#[cfg(test)]
#[path = "tests/ring.rs"]
mod tests;
