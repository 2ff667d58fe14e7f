//! Packets that come by the FPGA's parallel port: out of the ring, into the link, each counted once.
//!
//! The FPGA takes its frames back by itself, so nothing is released. Frames that came to nothing on the way
//! (overwritten in the ring, damaged, cut) show as numbers that are missing: those of them that the FPGA has not lost
//! itself count as damaged.
//!
//! # Invariant
//! Each packet of the run is sent or counted once, and no packet of another run is
//! (`tests::streamed::whatever_happens_to_the_ring_every_frame_is_counted_once`).

use super::{Counters, Path, Run};
use crate::ring::Found;
use crate::{FpgaBus, Micros, PacketSink};
use nirspi_wire::samples::Width;

impl Run {
    /// Takes at most one packet out of the ring; true if there was one. A packet for which the link has no room is
    /// dropped, so that the next one finds the ring with room.
    #[inline(never)]
    pub(super) fn take_streamed(
        &mut self,
        now: Micros,
        path: Path<'_>,
        width: Width,
        bus: &mut impl FpgaBus,
        sink: &mut impl PacketSink,
    ) -> bool {
        let Path { counters, meter, scratch, may_send } = path;
        let Some(found) = bus.ring().and_then(|ring| ring.next(self.patterns, width)) else {
            return false;
        };
        let is_next = self.is_next(&found, counters, bus);
        let mut room = if is_next && may_send { sink.claim(found.room_bytes()) } else { None };
        let place = match (&mut room, bus.ring()) {
            (Some(room), Some(ring)) => Some(ring.copy(&found, room)),
            _ => None,
        };
        // A new look at the channel: it may have come round.
        let is_there = bus.ring().is_some_and(|ring| ring.take(&found));
        if !is_next || !is_there {
            return true;
        }
        self.last_sequence = Some(found.sequence);
        self.last_frame = now;
        counters.advance(found.sequence.wrapping_add(1), counters.lost);
        let count = match (room, place) {
            (Some(room), Some(place)) => {
                if let Some(packet) = room.get(place.clone()) {
                    meter.look(now, (packet, self.patterns), scratch, bus);
                }
                sink.commit(place);
                &mut counters.sent
            }
            _ => &mut counters.dropped,
        };
        *count = count.wrapping_add(1);
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
