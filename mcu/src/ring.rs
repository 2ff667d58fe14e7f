//! The ring in memory into which a DMA channel writes what the FPGA's parallel port sends.
//!
//! The channel goes round and round and never waits, so the microcontroller's port always takes bytes. It does not matter
//! at how many free bytes the port's hardware would ask the FPGA to wait. Bytes that the firmware does not take within
//! one round are overwritten: the ring then forgets all that has come, and begins again behind the next zero.
//!
//! The channel says where in the ring it writes next, and not how often it went round. Time tells: the FPGA cannot send
//! a whole round between two looks that are less than a round's time apart. After a longer pause the ring counts as
//! overrun.
//!
//! # Invariant
//! A packet that is taken was in the ring whole while it was copied, and each packet is taken at most once, in order
//! (`tests::every_packet_comes_once_and_whole_and_only_an_overrun_loses_any`). What a start or a fault has cut costs
//! no other packet (`tests::a_cut_packet_costs_no_other`).

use crate::Micros;
use core::ops::Range;
use core::sync::atomic::{AtomicU32, Ordering, fence};
use nirspi_wire::ready::{self, NUMBER_BYTES};
use nirspi_wire::samples::Width;

/// The parallel port sends a byte in three clocks of 8 ns: 41.7 bytes in a microsecond at most.
const BYTES_PER_MICRO: u64 = 42;

/// Longest time between a board's look at the clock and its look at the channel, both of which it makes for
/// [`Ring::came`].
const LOOK: Micros = Micros(16);

/// Bytes that may be on their way into memory when the channel says where it writes next.
const IN_FLIGHT: u32 = 64;

/// A ring of four-byte words, and what of it has been taken. Bytes are numbered from power-up, modulo 2^32.
#[derive(Debug)]
pub struct Ring {
    words: &'static [AtomicU32],
    /// The byte that the channel writes next, as of the last look.
    written: u32,
    /// The first byte that has not been taken.
    taken: u32,
    looked: Micros,
    /// The byte before `taken` is a zero, so the next other byte begins a packet.
    is_between: bool,
}

/// A packet in the ring.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Found {
    at: u32,
    length: u32,
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
}

impl Ring {
    /// A ring in this memory, which a DMA channel fills from the first word on.
    #[must_use]
    pub const fn new<const WORDS: usize>(words: &'static [AtomicU32; WORDS]) -> Self {
        // Bytes are numbered modulo 2^32, and a round must divide that.
        const { assert!(WORDS.is_power_of_two() && 4 * WORDS > 2 * IN_FLIGHT as usize) };
        Self { words, written: 0, taken: 0, looked: Micros(0), is_between: false }
    }

    /// Bytes of a round.
    const fn size(&self) -> u32 {
        (self.words.len() as u32).wrapping_mul(4)
    }

    /// Notes that the channel writes next at this byte of the memory. A channel at the end of the memory may say so, or
    /// that it is at the beginning. `now` is the time of this look, and the channel's place was read at most 16 us
    /// later.
    pub fn came(&mut self, now: Micros, place: usize) {
        // What was in memory when the channel's place was read is read after it.
        fence(Ordering::SeqCst);
        let size = self.size();
        let new = (place as u32).wrapping_sub(self.written) & size.wrapping_sub(1);
        let pause = now.since(self.looked).0.saturating_add(LOOK.0);
        let most = pause.saturating_mul(BYTES_PER_MICRO);
        self.looked = now;
        self.written = self.written.wrapping_add(new);
        let waits = self.written.wrapping_sub(self.taken);
        if most >= size.into() || waits > size.saturating_sub(IN_FLIGHT) {
            self.restart();
        }
    }

    /// Forgets all that has come until the last look. What comes is looked at from its first zero on: the FPGA sends
    /// one before each packet.
    pub(crate) const fn restart(&mut self) {
        self.taken = self.written;
        self.is_between = false;
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
                self.skip(|byte| byte != 0);
                self.is_between = self.written != self.taken;
            }
            self.skip(|byte| byte == 0);
            let there = self.written.wrapping_sub(self.taken);
            if there < shortest {
                return None;
            }
            let is_zero = |at: &u32| self.byte(self.taken.wrapping_add(*at)) == 0;
            let last = shortest.saturating_sub(1);
            let end = (last..there.min(longest)).find(is_zero);
            // What is left of a cut packet and a whole one after it are together as long as a packet only if the first
            // is shorter than the lengths differ.
            let starts = (0..=longest.saturating_sub(shortest)).any(|at| is_zero(&at));
            let is_cut = starts || end.is_some_and(|end| is_zero(&end.saturating_sub(1)));
            match end {
                Some(end) if !is_cut => return Some(self.found(end.saturating_add(1))),
                None if !is_cut && there < longest => return None,
                // What was cut, or has lost its end, goes up to the next zero.
                _ => self.is_between = false,
            }
        }
    }

    /// The packet of this length that begins at `taken`.
    fn found(&self, length: u32) -> Found {
        let mut beginning = [0; NUMBER_BYTES];
        for (to, at) in beginning.iter_mut().zip(0..) {
            *to = self.byte(self.taken.wrapping_add(at));
        }
        let (run, sequence) = ready::numbers(&beginning);
        Found { at: self.taken, length, run, sequence }
    }

    /// Takes bytes while they are like that, up to the last that has come.
    fn skip(&mut self, is_like: impl Fn(u8) -> bool) {
        while self.taken != self.written && is_like(self.byte(self.taken)) {
            self.taken = self.taken.wrapping_add(1);
        }
    }

    /// The word that has this byte.
    fn word(&self, at: u32) -> usize {
        (at & self.size().wrapping_sub(1)) as usize / 4
    }

    fn byte(&self, at: u32) -> u8 {
        let word = self.words.get(self.word(at)).map_or(0, |word| word.load(Ordering::Relaxed));
        word.wrapping_shr((at & 3) << 3) as u8
    }

    /// Copies the words that hold this packet into `room` of [`Found::room_bytes`], and returns where the packet lies
    /// there. Whether it was still there, [`take`](Self::take) says after another look.
    pub(crate) fn copy(&self, found: &Found, room: &mut [u8]) -> Range<usize> {
        let (to, _) = room.as_chunks_mut();
        let cut = self.words.split_at_checked(self.word(found.at));
        let (first, last) = cut.unwrap_or((self.words, &[]));
        let length = last.len().min(to.len());
        if let Some((front, rest)) = to.split_at_mut_checked(length) {
            load(last, front);
            load(first, rest);
        }
        // The channel's place is read after these words.
        fence(Ordering::SeqCst);
        let begin = found.at as usize % 4;
        begin..begin.saturating_add(found.length as usize)
    }

    /// Takes the packet. False: the channel has written over the packet meanwhile, or a start has made the ring forget
    /// it.
    pub(crate) fn take(&mut self, found: &Found) -> bool {
        let is_there = self.is_between && self.taken == found.at;
        if is_there {
            self.taken = self.taken.wrapping_add(found.length);
        }
        is_there
    }
}

/// Words to a turn of the copying loop.
const TURN: usize = 8;

/// Fills `to` with words of `from`, of which there are at least as many.
fn load(from: &[AtomicU32], to: &mut [[u8; 4]]) {
    let (turns, rest) = to.as_chunks_mut::<TURN>();
    let (words, last) = from.as_chunks::<TURN>();
    for (to, from) in turns.iter_mut().zip(words) {
        for (to, from) in to.iter_mut().zip(from) {
            *to = from.load(Ordering::Relaxed).to_le_bytes();
        }
    }
    let done = turns.len();
    let from = words.get(done).map_or(last, <[AtomicU32; TURN]>::as_slice);
    for (to, from) in rest.iter_mut().zip(from) {
        *to = from.load(Ordering::Relaxed).to_le_bytes();
    }
}

#[cfg(test)]
#[path = "tests/ring.rs"]
mod tests;
