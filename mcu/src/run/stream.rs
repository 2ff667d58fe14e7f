//! Packets that come by the FPGA's parallel port: out of the ring to the host without a copy, each counted once.
//!
//! The FPGA takes its frames back by itself, so nothing is released. While the host is slower than the FPGA, the ring is
//! full, the FPGA waits and loses frames, which it counts itself. Frames that came to nothing on the way (damaged, cut)
//! show as numbers that are missing: those of them that the FPGA has not lost count as damaged.
//!
//! # Invariant
//! - Each packet of the run is sent or counted once, and no packet of another run is
//!   (`tests::streamed::whatever_happens_to_the_ring_every_frame_is_counted_once`).
//! - A packet for which the link has no place stays in the ring. When the ring is full, the FPGA waits
//!   (`tests::streamed::packets_wait_in_the_ring_for_a_place_of_the_link`).

use super::{Counters, Path, Run};
use crate::meter::Meter;
use crate::ring::Found;
use crate::{FpgaBus, Micros, PacketSink};

/// Most bytes of packets that go to the host in one transfer. With fewer the processor has more transfers to begin; with
/// more the ring has less room, because a transfer's bytes are free when all of them have been sent.
const LOAN_BYTES: u32 = 20 * 1024;

/// Most packets that one poll takes, so that short ones do not keep the camera from its other work.
const MOST_PACKETS: u32 = 64;

/// Packets that follow each other in the ring, and will go to the host together. They count as sent.
struct Stretch {
    first: Found,
    last: Found,
    packets: u32,
}

impl Stretch {
    fn takes(&self, found: &Found) -> bool {
        found.follows && self.first.bytes_to(found) <= LOAN_BYTES
    }

    /// Lends the stretch to the link. One that begins in a word that is lent is dropped: bytes have been lost before it.
    fn send(self, counters: &mut Counters, bus: &mut impl FpgaBus, sink: &mut impl PacketSink) {
        let Self { first, last, packets } = self;
        let lend = |ring: &mut crate::Ring| ring.lend((&first, &last), |loan| sink.lend(loan));
        if !bus.ring().is_some_and(lend) {
            counters.sent = counters.sent.wrapping_sub(packets);
            counters.dropped = counters.dropped.wrapping_add(packets);
        }
    }
}

impl Run {
    /// Takes the packets that have come out of the ring; true if there was one. Packets stay there while the link has no
    /// place for them, or a reply waits.
    #[inline(never)]
    pub(super) fn take_streamed(
        &mut self,
        now: Micros,
        path: Path<'_>,
        bus: &mut impl FpgaBus,
        sink: &mut impl PacketSink,
    ) -> bool {
        let Path { counters, meter, scratch, may_send } = path;
        bus.look();
        let mut waits = bus.ring().is_some_and(|ring| ring.is_full());
        let mut stretch: Option<Stretch> = None;
        let mut packets = 0;
        while packets < MOST_PACKETS
            && let Some(found) = bus.ring().and_then(|ring| ring.next(self.patterns, self.width))
        {
            if let Some(whole) = stretch.take_if(|before| !before.takes(&found)) {
                whole.send(counters, bus, sink);
            }
            if stretch.is_none() && (!may_send || sink.claim(0).is_none()) {
                waits = true;
                break;
            }
            packets = packets.wrapping_add(1);
            let is_next = self.is_next(&found, counters, bus);
            if let Some(ring) = bus.ring() {
                ring.take(&found);
            }
            if !is_next {
                if let Some(whole) = stretch.take() {
                    whole.send(counters, bus, sink);
                }
                continue;
            }
            self.last_sequence = Some(found.sequence);
            self.last_frame = now;
            counters.advance(found.sequence.wrapping_add(1), counters.lost);
            counters.sent = counters.sent.wrapping_add(1);
            let is_looked_at =
                meter.wants(now) && self.look(&found, now, (meter, scratch), bus, sink);
            let before = stretch.take();
            let packets = before.as_ref().map_or(0, |before| before.packets).wrapping_add(1);
            let first = before.map_or(found, |before| before.first);
            stretch = Some(Stretch { first, last: found, packets });
            if is_looked_at {
                // That took as long as many packets: the rest has time until the next poll.
                break;
            }
        }
        if let Some(stretch) = stretch {
            stretch.send(counters, bus, sink);
        }
        if waits {
            // The camera waits for the host: that no frame goes through does not mean that the FPGA has stalled.
            (self.last_frame, self.last_full) = (now, Some(now));
        }
        packets > 0
    }

    /// Shows the signal meter a packet, copied into a free place of the link. False if the link has no free place.
    fn look(
        &self,
        found: &Found,
        now: Micros,
        (meter, scratch): (&mut Meter, &mut [u8]),
        bus: &mut impl FpgaBus,
        sink: &mut impl PacketSink,
    ) -> bool {
        let Some(room) = sink.claim(found.room_bytes()) else { return false };
        let place = bus.ring().map(|ring| ring.copy(found, room));
        let Some(packet) = place.and_then(|place| room.get(place)) else { return false };
        meter.look(now, (packet, self.patterns), scratch, bus);
        true
    }

    /// Whether this is a packet of the run that has not come yet. Its numbers may be damaged: where others are missing
    /// before it, the FPGA is asked how many frames it has made.
    fn is_next(&self, found: &Found, counters: &mut Counters, bus: &mut impl FpgaBus) -> bool {
        if found.run != counters.run {
            return false;
        }
        let expected = self.last_sequence.map_or(0, |last| last.wrapping_add(1));
        let missing = found.sequence.wrapping_sub(expected);
        if missing == 0 {
            return true;
        }
        if counters.update(bus).is_err() || missing >= counters.made.wrapping_sub(expected) {
            return false;
        }
        counters.count_gone(found.sequence);
        true
    }
}
