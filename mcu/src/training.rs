//! A packet of known words at the start: whether packets come whole over the packet port, before a run needs them.
//!
//! The packet port is clocked by `sck` itself, at several times the speed of the registers, and a board samples it at a phase
//! of its own. Registers that answer say nothing of that. So the firmware has the FPGA send one packet of its test
//! generator, without light, and compares every sample and the checksum. The words have every change of the four lines
//! from one period of `sck` to the next (`tests::training::the_packet_has_every_change_of_the_four_lines`).
//!
//! The packet is asked for as soon as the FPGA answers and nothing forbids a start, and again after gateware was loaded and
//! after the FPGA was absent. Commands wait meanwhile, which takes a millisecond.
//!
//! # Invariant
//! Nothing of the packet reaches the host, and the configuration stays as it was
//! (`tests::training::nothing_of_the_packet_reaches_the_host_and_the_settings_stay`).

use crate::configure::Setup;
use crate::test_frame::{GENERATOR, GENERATOR_FLAGS, PATIENCE, begin, expected_sums};
use crate::{FpgaBus, Limits, Micros, PacketSink, fpga};
use nirspi_wire::ready::{self, Reader};
use nirspi_wire::register::mode;
use nirspi_wire::samples::Width;

const WIDTH: Width = Width::Bits24;

const SETUP: Setup = Setup { mode: GENERATOR.mode | mode::PACKETS | mode::NARROW, ..GENERATOR };

/// Number of attempts at the packet. The FPGA keeps it until it is released, and one wrong bit is no wrong phase.
const ATTEMPTS: u8 = 3;

/// Whether the port is known to be sound.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Port {
    /// No packet was compared yet; the next is asked for from this time on.
    Unknown(Micros),
    Sound,
}

/// A packet on its way.
#[derive(Debug)]
#[cfg_attr(test, derive(Clone))]
pub(crate) struct Training {
    since: Micros,
    /// Attempts that gave another packet, or none.
    damaged: u8,
}

/// How the training has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    Sound,
    /// Each attempt gave another packet, or none.
    Damaged,
    /// The packet was not there in time.
    Late,
}

/// Asks for the packet; true if the FPGA accepted the start.
pub(crate) fn start(bus: &mut impl FpgaBus, now: Micros, limits: &Limits) -> bool {
    // The number of no run.
    fpga::stamp(bus, 0, now).is_ok() && begin(bus, &SETUP, limits)
}

/// Whether these bytes of a read hold the packet.
fn is_whole(read: &[u8]) -> bool {
    let place = ready::packet_in(read, SETUP.patterns, WIDTH);
    let Some(packet) = place.and_then(|place| read.get(place)) else { return false };
    let mut reader = Reader::new(packet, SETUP.patterns);
    reader.sequence == 0
        && reader.flags == GENERATOR_FLAGS
        && expected_sums().all(|sums| sums.difference() == i64::from(reader.sample()))
        && reader.is_intact()
}

impl Training {
    pub fn new(now: Micros) -> Self {
        Self { since: now, damaged: 0 }
    }

    /// What the rest of the training depends on, with ages for times.
    #[cfg(test)]
    pub fn key(&self, age: impl Fn(Micros) -> u64) -> [u64; 2] {
        [age(self.since), self.damaged.into()]
    }

    /// Looks for the packet, which a board transfers into the link's room like that of a run. `None` while it may still
    /// come.
    pub fn step(
        &mut self,
        now: Micros,
        bus: &mut impl FpgaBus,
        sink: &mut impl PacketSink,
    ) -> Option<Verdict> {
        let late = (now.since(self.since) > PATIENCE).then_some(Verdict::Late);
        if !bus.frame_ready() {
            return late;
        }
        let Some(room) = sink.claim(ready::fast_read_bytes(SETUP.patterns, WIDTH)) else {
            return late;
        };
        match bus.packet(room) {
            Ok(false) => return late,
            Ok(true) if is_whole(room) => return Some(Verdict::Sound),
            Ok(true) | Err(_) => {}
        }
        self.damaged = self.damaged.saturating_add(1);
        (self.damaged >= ATTEMPTS).then_some(Verdict::Damaged)
    }
}
