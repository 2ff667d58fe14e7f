//! A run: frames from the FPGA to the link, and the count of every one of them.
//!
//! The one law: when a run has ended,
//! `frames_made = frames_sent + frames_dropped + fpga_frames_lost + fpga_frames_corrupt`.

use crate::camera::{Activity, Machine};
use crate::outbox::{Outcome, STREAM_HEADER_BYTES, send};
use crate::time::Anchor;
use crate::{FpgaBus, Micros, PacketSink, configure, fpga};
use nirspi_wire::fpga::{FpgaFrame, Header};
use nirspi_wire::register::{Register, control};
use nirspi_wire::{
    ConfigField, DeviceMessage, EventKind, Fault, Frame, PATTERNS, Refusal, RunLength, Samples,
};

/// Longest time that the end of a run waits for frames that the FPGA says it has made. A transfer of the
/// longest frame takes well under a millisecond.
const DRAIN_PATIENCE: Micros = Micros(100_000);

/// Bytes of the samples of the longest frame.
pub(crate) const SAMPLE_BYTES: usize = 4 * PATTERNS as usize;

/// Frames of this run or the last one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Counters {
    /// Number of the run since power-up; 0: none yet.
    pub run: u16,
    /// Completed by the FPGA.
    pub made: u32,
    /// Given to the link.
    pub sent: u32,
    /// Dropped whole: the link had no room.
    pub dropped: u32,
    /// Lost in the FPGA: not released in time.
    pub lost: u32,
    /// Damaged on the way from the FPGA.
    pub corrupt: u32,
}

impl Counters {
    /// Takes the FPGA's own counters, if it answers; one that has been reset meanwhile takes nothing back.
    pub fn read(&mut self, bus: &mut impl FpgaBus) -> Result<(), Fault> {
        fpga::identify(bus)?;
        let made = fpga::read(bus, Register::FramesMade).map_err(|_| fpga::SILENT)?;
        let lost = fpga::read(bus, Register::FramesLost).map_err(|_| fpga::SILENT)?;
        self.advance(made, lost);
        Ok(())
    }

    /// A frame that was ready could not be read: its number is unknown, that it was made is not.
    fn count_corrupt(&mut self) {
        if self.missing() == 0 {
            self.made = self.made.wrapping_add(1);
        }
        self.corrupt = self.corrupt.wrapping_add(1);
    }

    /// Frames that the FPGA has made and that have not come yet.
    pub fn missing(&self) -> u32 {
        let Self { made, sent, dropped, lost, corrupt, .. } = *self;
        let missing = [sent, dropped, lost, corrupt].into_iter().fold(made, u32::wrapping_sub);
        // More came than were made: an FPGA that cannot count.
        if missing < 1 << 31 { missing } else { 0 }
    }

    /// Both only ever grow, but wrap at 2^32.
    fn advance(&mut self, made: u32, lost: u32) {
        for (count, found) in [(&mut self.made, made), (&mut self.lost, lost)] {
            if found.wrapping_sub(*count) < 1 << 31 {
                *count = found;
            }
        }
    }
}

#[derive(Debug)]
pub(crate) struct Run {
    length: RunLength,
    patterns: u16,
    anchor: Anchor,
    stall_after: Micros,
    last_frame: Micros,
    last_sequence: Option<u32>,
    ending: Option<Ending>,
}

/// LEDs are off; frames may still be under way.
#[derive(Debug)]
struct Ending {
    since: Micros,
    /// Reply that waits for it.
    reply: Option<(u16, Outcome)>,
}

impl Run {
    /// LEDs are on.
    pub fn is_lit(&self) -> bool {
        self.ending.is_none()
    }

    pub fn is_complete(&self, made: u32) -> bool {
        matches!(self.length, RunLength::Frames(frames) if made >= frames)
    }

    /// LEDs have been switched off; `reply` is given once the last frame is through.
    pub fn end(&mut self, now: Micros, reply: Option<(u16, Outcome)>) {
        let ending = self.ending.get_or_insert(Ending { since: now, reply: None });
        if reply.is_some() {
            ending.reply = reply;
        }
    }
}

/// The header and packed samples of an intact frame of this many patterns.
fn assemble<'s>(
    bytes: &[u8],
    patterns: u16,
    scratch: &'s mut [u8],
) -> Option<(Header, Samples<'s>)> {
    let frame = FpgaFrame::parse(bytes).ok().filter(|frame| frame.header.patterns == patterns)?;
    let samples = Samples::pack(frame.sums().map(|sums| sums.difference()), scratch).ok()?;
    Some((frame.header, samples))
}

impl Machine {
    /// `Start`.
    pub(crate) fn start(
        &mut self,
        now: Micros,
        length: RunLength,
        bus: &mut impl FpgaBus,
    ) -> Result<(), Refusal> {
        let setup = self.ready_setup()?;
        // 0 in the FPGA's register is a run without end.
        let frames = match length {
            RunLength::Continuous => 0,
            RunLength::Frames(frames) => {
                configure::in_range(ConfigField::Frames, frames, 1, u32::MAX)
                    .map_err(Refusal::Configuration)?;
                frames
            }
        };
        let started = fpga::verify(bus, &setup, &self.limits)
            .and_then(|()| Ok(fpga::write(bus, Register::Frames, frames)?))
            .and_then(|()| Ok(fpga::clock(bus)?))
            .map_err(|_| fpga::identify(bus).err().unwrap_or(Fault::FpgaConfiguration))
            .and_then(|clock| {
                let started = fpga::start(bus, control::START)?;
                Ok((Anchor { clock, time: now }, started))
            });
        let (anchor, started) = match started {
            Ok(started) => started,
            Err(fault) => {
                self.trip(now, fault, bus);
                return Err(Refusal::Fault(fault));
            }
        };
        let frame_micros = setup.frame_clocks() / crate::CLOCKS_PER_MICRO;
        let stall_after = frame_micros.saturating_mul(self.limits.stall_frames.into());
        let run = Run {
            length,
            patterns: setup.patterns,
            anchor,
            stall_after: Micros(stall_after).max(self.limits.stall_min),
            last_frame: now,
            last_sequence: None,
            ending: None,
        };
        if started == fpga::Started::OverAlready {
            let mut counters = Counters::default();
            if counters.read(bus).is_err() || !run.is_complete(counters.made) {
                self.trip(now, Fault::FpgaStalled, bus);
                return Err(Refusal::Fault(Fault::FpgaStalled));
            }
        }
        self.counters = Counters { run: self.counters.run.wrapping_add(1), ..Counters::default() };
        self.release_pending = false;
        self.activity = Activity::Run(run);
        Ok(())
    }

    /// LEDs off; `reply` and `RunEnded` follow the last frame.
    pub(crate) fn end_run(
        &mut self,
        now: Micros,
        reply: Option<(u16, Outcome)>,
        bus: &mut impl FpgaBus,
    ) {
        self.leds_off(bus);
        if let Activity::Run(run) = &mut self.activity {
            run.end(now, reply);
        }
        self.wind_up(now, bus);
    }

    /// At most one frame, then the end of the run if it has come.
    pub(crate) fn step_run(
        &mut self,
        now: Micros,
        bus: &mut impl FpgaBus,
        sink: &mut impl PacketSink,
    ) -> bool {
        let worked = self.take_frame(now, bus, sink);
        let Activity::Run(run) = &self.activity else { return worked };
        if run.is_lit() && run.is_complete(self.counters.made) {
            self.end_run(now, None, bus);
        } else {
            if run.is_lit() && now.since(run.last_frame) > run.stall_after {
                self.trip(now, Fault::FpgaStalled, bus);
            }
            self.wind_up(now, bus);
        }
        worked
    }

    fn take_frame(
        &mut self,
        now: Micros,
        bus: &mut impl FpgaBus,
        sink: &mut impl PacketSink,
    ) -> bool {
        let may_send = self.may_stream();
        let absent = self.fpga_is_absent();
        let Activity::Run(run) = &mut self.activity else { return false };
        // After a release that failed, the line still stands for the frame that was taken before.
        if self.release_pending || absent || !bus.frame_ready() {
            return false;
        }
        let taken = match bus.frame() {
            Ok(None) => return false,
            Ok(Some(bytes)) => assemble(bytes, run.patterns, &mut self.scratch),
            Err(_) => None,
        };
        // The FPGA needs its buffer back before the next frame is complete; the link can wait.
        self.release_pending = fpga::control(bus, control::RELEASE).is_err();
        run.last_frame = now;
        let counters = &mut self.counters;
        let Some((header, samples)) = taken else {
            counters.count_corrupt();
            return true;
        };
        if run.last_sequence.replace(header.sequence) == Some(header.sequence) {
            // Its release before was lost on the bus.
            return true;
        }
        counters.advance(header.sequence.wrapping_add(1), header.lost);
        let payload = samples.len().saturating_mul(4).saturating_add(STREAM_HEADER_BYTES);
        let frame = DeviceMessage::Frame(Frame {
            run: counters.run,
            sequence: header.sequence,
            device_time_us: run.anchor.time_of(header.clock).0,
            sweeps: header.sweeps,
            flags: header.flags,
            samples,
        });
        let count = if may_send && send(&frame, payload, sink) {
            &mut counters.sent
        } else {
            &mut counters.dropped
        };
        *count = count.wrapping_add(1);
        true
    }

    /// Ends a run whose LEDs are off once its last frame is through.
    pub(crate) fn wind_up(&mut self, now: Micros, bus: &mut impl FpgaBus) {
        let absent = self.fpga_is_absent();
        let Activity::Run(Run { ending: Some(ending), .. }) = &mut self.activity else { return };
        if !absent {
            let unknown = self.off_pending || self.counters.read(bus).is_err();
            let more = unknown || self.counters.missing() > 0;
            if more && now.since(ending.since) <= DRAIN_PATIENCE {
                return;
            }
        }
        // What the FPGA made and never delivered did not survive the way from there.
        self.counters.corrupt = self.counters.corrupt.wrapping_add(self.counters.missing());
        let reply = ending.reply.take();
        self.activity = Activity::Resting;
        if let Some((id, outcome)) = reply {
            self.reply(id, outcome);
        }
        let Counters { run, made, dropped, lost, corrupt, .. } = self.counters;
        let ended = EventKind::RunEnded {
            run,
            frames_made: made,
            frames_dropped: dropped,
            fpga_frames_lost: lost,
            fpga_frames_corrupt: corrupt,
        };
        self.notify(now, ended);
    }
}
