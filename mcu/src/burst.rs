//! A raw burst: ADC samples of the first clocks of a sweep, sent in pieces.
//!
//! A piece waits while the link has no room. Waiting is safe: the FPGA keeps the samples, and the
//! LEDs are off again after at most 33 microseconds.
//!
//! # Invariant
//! A burst arrives whole, or an event says that it does not
//! (`tests::frames::pieces_of_a_burst_wait_for_room_and_are_given_up_in_the_end`).

use crate::configure::Setup;
use crate::packets::{STREAM_HEADER_BYTES, send};
use crate::{FpgaBus, Limits, Micros, PacketSink, fpga};
use nirspi_wire::register::{RAW_SAMPLES_MAX, Register, control};
use nirspi_wire::samples::Words;
use nirspi_wire::{DeviceMessage, Fault, Raw, Refusal};

/// Samples in one piece: half of a frame's length on the link.
pub const RAW_PIECE_SAMPLES: u16 = 1024;

/// Longest time that the FPGA may take to record a burst.
const BURST_PATIENCE: Micros = Micros(100_000);

/// Longest time that a piece waits for room.
const PIECE_PATIENCE: Micros = Micros(500_000);

#[derive(Debug)]
#[cfg_attr(test, derive(Clone))]
pub(crate) struct Burst {
    samples: u16,
    sent: u16,
    /// Time when the burst started; after the first piece, time when the last piece was sent.
    since: Micros,
    /// The FPGA has recorded the burst, so the LEDs are off.
    recorded: bool,
}

/// Outcome of one step of a burst.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step {
    /// The FPGA still records, or the link has no room.
    Waiting,
    /// A piece was sent; more pieces follow.
    Sent,
    /// The last piece was sent.
    Done,
    /// The rest of the burst is given up.
    Dropped,
    /// The FPGA did not record the burst in time; LEDs may be on.
    Stalled,
}

/// Outcome of sending one piece.
enum Piece {
    Sent,
    /// The FPGA's samples have not been transferred yet, or the link is full.
    NotNow,
    Lost,
}

/// Refuses a burst that is empty, or longer than the FPGA records.
pub(crate) fn check(samples: u16) -> Result<(), Refusal> {
    if (1..=RAW_SAMPLES_MAX).contains(&samples) {
        Ok(())
    } else {
        Err(Refusal::RawLength { max: RAW_SAMPLES_MAX })
    }
}

impl Burst {
    /// `RawBurst`: checks that the FPGA still holds `setup`, and starts the one sweep that is recorded.
    ///
    /// [`Refusal::Fault`] if the FPGA did not take the start; LEDs may then be on.
    pub fn start(
        now: Micros,
        samples: u16,
        setup: &Setup,
        limits: &Limits,
        bus: &mut impl FpgaBus,
    ) -> Result<Self, Refusal> {
        check(samples)?;
        fpga::verify(bus, setup, limits)
            .and_then(|()| Ok(fpga::write(bus, Register::RawLength, samples.into())?))
            .map_err(|_| fpga::health(bus).err().unwrap_or(Fault::FpgaConfiguration))
            .and_then(|()| fpga::start(bus, control::START_RAW))
            .map_err(Refusal::Fault)?;
        Ok(Self { samples, sent: 0, since: now, recorded: false })
    }

    /// What the rest of the burst depends on, with ages for times.
    #[cfg(test)]
    pub fn key(&self, age: impl Fn(Micros) -> u64) -> [u64; 4] {
        [self.samples.into(), self.sent.into(), age(self.since), self.recorded.into()]
    }

    /// Sends at most one piece.
    pub fn step(
        &mut self,
        now: Micros,
        may_send: bool,
        bus: &mut impl FpgaBus,
        sink: &mut impl PacketSink,
    ) -> Step {
        if !self.recorded {
            if bus.raw_ready() {
                self.recorded = true;
                self.since = now;
            } else if now.since(self.since) > BURST_PATIENCE {
                return Step::Stalled;
            } else {
                return Step::Waiting;
            }
        }
        let waited = now.since(self.since);
        let piece = match bus.raw() {
            Ok(None) => Piece::NotNow,
            Ok(Some(bytes)) => self.send_piece(now, bytes, may_send, sink),
            Err(_) => Piece::Lost,
        };
        match piece {
            Piece::Sent if self.sent < self.samples => Step::Sent,
            Piece::Sent => Step::Done,
            Piece::NotNow if waited <= PIECE_PATIENCE => Step::Waiting,
            Piece::NotNow | Piece::Lost => Step::Dropped,
        }
    }

    fn send_piece(
        &mut self,
        now: Micros,
        bytes: &[u8],
        may_send: bool,
        sink: &mut impl PacketSink,
    ) -> Piece {
        if bytes.len() != usize::from(self.samples).saturating_mul(2) {
            return Piece::Lost;
        }
        let length = self.samples.saturating_sub(self.sent).min(RAW_PIECE_SAMPLES);
        let start = usize::from(self.sent).saturating_mul(2);
        let piece = bytes.get(start..).and_then(|rest| rest.get(..usize::from(length) << 1));
        let Some(Ok(samples)) = piece.map(Words::from_le_bytes) else {
            return Piece::Lost;
        };
        let payload = (usize::from(length) << 1).saturating_add(STREAM_HEADER_BYTES);
        let raw = Raw { first_clock: self.sent, total: self.samples, samples };
        if !may_send || !send(&DeviceMessage::Raw(raw), payload, sink) {
            return Piece::NotNow;
        }
        self.sent = self.sent.saturating_add(length);
        self.since = now;
        Piece::Sent
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::configure;
    use crate::tests::fake_fpga::FakeFpga;
    use crate::tests::support::{Link, SMALL};
    use std::vec;

    #[test]
    fn a_burst_waits_for_the_fpga_then_for_room_and_goes_piece_by_piece() {
        let (mut bus, mut link, limits) = (FakeFpga::default(), Link::default(), Limits::default());
        let setup = configure::check(&SMALL, &limits).unwrap();
        fpga::set(&mut bus, &setup, &limits).unwrap();
        let samples = RAW_PIECE_SAMPLES + 1;
        let mut burst = Burst::start(Micros(0), samples, &setup, &limits, &mut bus).unwrap();
        bus.raw = None;
        assert_eq!(burst.step(Micros(1), true, &mut bus, &mut link), Step::Waiting);
        assert_eq!(burst.step(Micros(200_000), true, &mut bus, &mut link), Step::Stalled);

        bus.raw = Some(vec![0; 2 * usize::from(samples)]);
        assert_eq!(burst.step(Micros(2), false, &mut bus, &mut link), Step::Waiting);
        assert_eq!(burst.step(Micros(3), true, &mut bus, &mut link), Step::Sent);
        assert_eq!(burst.step(Micros(1_000_000), false, &mut bus, &mut link), Step::Dropped);
        assert_eq!(burst.step(Micros(4), true, &mut bus, &mut link), Step::Done);
        assert_eq!(link.packets.len(), 2);
    }
}
