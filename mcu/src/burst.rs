//! A raw burst: plain ADC samples of the first clocks of a sweep, in pieces.
//!
//! The one law: a burst arrives whole, or an event says that it does not. Its pieces wait for room, since
//! the FPGA keeps the samples and the LEDs are off again after at most 33 microseconds.

use crate::camera::{Activity, Machine};
use crate::outbox::{STREAM_HEADER_BYTES, send};
use crate::{FpgaBus, Micros, PacketSink, fpga};
use nirspi_wire::register::{RAW_SAMPLES_MAX, Register, control};
use nirspi_wire::samples::Words;
use nirspi_wire::{DeviceMessage, EventKind, Fault, Raw, Refusal};

/// Samples in one piece: half of a frame's length on the link.
pub const RAW_PIECE_SAMPLES: u16 = 1024;

/// Longest time that the FPGA may take.
const BURST_PATIENCE: Micros = Micros(100_000);

/// Longest time that a piece waits for room.
const PIECE_PATIENCE: Micros = Micros(500_000);

#[derive(Debug)]
pub(crate) struct Burst {
    samples: u16,
    sent: u16,
    /// When it started, and then when the last piece was sent.
    since: Micros,
    /// The FPGA has recorded it, so the LEDs are off.
    recorded: bool,
}

impl Machine {
    /// `RawBurst`.
    pub(crate) fn start_burst(
        &mut self,
        now: Micros,
        samples: u16,
        bus: &mut impl FpgaBus,
    ) -> Result<(), Refusal> {
        let setup = self.ready_setup()?;
        if !(1..=RAW_SAMPLES_MAX).contains(&samples) {
            return Err(Refusal::RawLength { max: RAW_SAMPLES_MAX });
        }
        let started = fpga::verify(bus, &setup, &self.limits)
            .and_then(|()| Ok(fpga::write(bus, Register::RawLength, samples.into())?))
            .map_err(|_| fpga::identify(bus).err().unwrap_or(Fault::FpgaConfiguration))
            .and_then(|()| fpga::start(bus, control::START_RAW));
        if let Err(fault) = started {
            self.trip(now, fault, bus);
            return Err(Refusal::Fault(fault));
        }
        self.activity = Activity::Burst(Burst { samples, sent: 0, since: now, recorded: false });
        Ok(())
    }

    /// At most one piece.
    pub(crate) fn step_burst(
        &mut self,
        now: Micros,
        bus: &mut impl FpgaBus,
        sink: &mut impl PacketSink,
    ) -> bool {
        let may_send = self.may_stream();
        let Activity::Burst(burst) = &mut self.activity else { return false };
        if !burst.recorded {
            if bus.raw_ready() {
                burst.recorded = true;
                burst.since = now;
            } else if now.since(burst.since) > BURST_PATIENCE {
                self.trip(now, Fault::FpgaStalled, bus);
                return false;
            } else {
                return false;
            }
        }
        let waited = now.since(burst.since);
        let step = match bus.raw() {
            Ok(None) => Step::Wait,
            Ok(Some(bytes)) => burst.send_piece(now, bytes, may_send, sink),
            Err(_) => Step::Lost,
        };
        match step {
            Step::Sent if burst.sent < burst.samples => return true,
            Step::Wait if waited <= PIECE_PATIENCE => return false,
            Step::Sent => {}
            Step::Wait | Step::Lost => self.notify(now, EventKind::RawDropped),
        }
        self.activity = Activity::Resting;
        true
    }
}

enum Step {
    Sent,
    Wait,
    Lost,
}

impl Burst {
    fn send_piece(
        &mut self,
        now: Micros,
        bytes: &[u8],
        may_send: bool,
        sink: &mut impl PacketSink,
    ) -> Step {
        if bytes.len() != usize::from(self.samples).saturating_mul(2) {
            return Step::Lost;
        }
        let length = self.samples.saturating_sub(self.sent).min(RAW_PIECE_SAMPLES);
        let start = usize::from(self.sent).saturating_mul(2);
        let piece = bytes.get(start..).and_then(|rest| rest.get(..usize::from(length) << 1));
        let Some(Ok(samples)) = piece.map(Words::from_le_bytes) else {
            return Step::Lost;
        };
        let payload = (usize::from(length) << 1).saturating_add(STREAM_HEADER_BYTES);
        let raw = Raw { first_clock: self.sent, total: self.samples, samples };
        if !may_send || !send(&DeviceMessage::Raw(raw), payload, sink) {
            return Step::Wait;
        }
        self.sent = self.sent.saturating_add(length);
        self.since = now;
        Step::Sent
    }
}
