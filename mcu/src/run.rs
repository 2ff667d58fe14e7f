//! A run: transfers frames from the FPGA to the link, and counts every frame.
//!
//! # Invariant
//! When a run has ended,
//! `frames_made = frames_sent + frames_dropped + fpga_frames_lost + fpga_frames_corrupt`
//! (`tests::laws::every_frame_made_is_sent_or_counted_and_the_run_ends_once`).

mod stream;

use crate::configure::Setup;
use crate::meter::Meter;
use crate::notices::Outcome;
use crate::{FpgaBus, Limits, Micros, PacketSink, configure, fpga};
use nirspi_wire::ready::{self, BEGINNING_BYTES};
use nirspi_wire::register::{NO_CLOCK, Register, control, mode};
use nirspi_wire::samples::Width;
use nirspi_wire::{ConfigField, EventKind, Fault, PATTERNS, Refusal, RunLength};

/// Longest time that the end of a run waits for frames that the FPGA has counted as made. A
/// transfer of the longest frame takes well under a millisecond.
const DRAIN_PATIENCE: Micros = Micros(100_000);

/// Longest time from the moment when a full ring has room again until the frames that waited in the FPGA are there: four
/// of the longest packets take 0.4 ms, and the loop looks once in a millisecond.
const ROOM_PATIENCE: Micros = Micros(3_000);

/// Bytes of the samples of the longest frame.
pub(crate) const SAMPLE_BYTES: usize = 4 * PATTERNS as usize;

/// Frames of this run or the last one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Counters {
    /// Number of the run since power-up; 0 before the first run.
    pub run: u16,
    /// Frames completed by the FPGA.
    pub made: u32,
    /// Frames given to the link.
    pub sent: u32,
    /// Frames dropped whole because the link had no room.
    pub dropped: u32,
    /// Frames lost in the FPGA, because the frame before was not released in time.
    pub lost: u32,
    /// Frames damaged between the FPGA and the firmware.
    pub corrupt: u32,
}

impl Counters {
    /// Reads the FPGA's own counters, if the FPGA answers. Counters of an FPGA that was reset
    /// change nothing.
    ///
    /// The lost frames are read first: a frame that is lost between the two reads is then one that is missing for
    /// a moment, and hides no frame that waits.
    #[inline(never)]
    pub fn read(&mut self, bus: &mut impl FpgaBus) -> Result<(), Fault> {
        fpga::identify(bus)?;
        self.update(bus)
    }

    /// The same without a look at the identity, for every packet: the bus checks each answer, and the poll looks at the
    /// identity once in [`Limits::running_check`].
    #[inline(never)]
    fn update(&mut self, bus: &mut impl FpgaBus) -> Result<(), Fault> {
        let lost =
            fpga::read(bus, Register::FramesLost).map_err(|error| fpga::failed(error, bus))?;
        let made =
            fpga::read(bus, Register::FramesMade).map_err(|error| fpga::failed(error, bus))?;
        if made == NO_CLOCK {
            return Err(Fault::FpgaAbsent { identity: NO_CLOCK });
        }
        self.advance(made, lost);
        self.reconcile();
        Ok(())
    }

    /// Takes back what was counted as damaged and is counted elsewhere too. A frame that could not be
    /// read has no number, so a frame whose release the bus has lost is counted twice until its number, or the
    /// FPGA's own count, is known.
    fn reconcile(&mut self) {
        let Self { made, sent, dropped, lost, corrupt, .. } = *self;
        let found = [dropped, lost, corrupt].into_iter().fold(sent, u32::wrapping_add);
        let twice = found.wrapping_sub(made);
        if twice < 1 << 31 {
            self.corrupt = corrupt.saturating_sub(twice);
        }
    }

    /// Counters of the next run.
    pub fn of_next_run(&self) -> Self {
        Self { run: self.run.wrapping_add(1), ..Self::default() }
    }

    /// Counts as damaged every frame below this number that is counted nowhere. Frames above it that the FPGA has lost
    /// can hide some of them, which a later call then counts.
    fn count_gone(&mut self, number: u32) {
        let Self { sent, dropped, lost, corrupt, .. } = *self;
        let gone = [sent, dropped, lost, corrupt].into_iter().fold(number, u32::wrapping_sub);
        if gone < 1 << 31 {
            self.corrupt = corrupt.wrapping_add(gone);
        }
    }

    /// Counts missing frames as dropped, because their host is gone.
    pub fn drop_missing(&mut self) {
        self.dropped = self.dropped.wrapping_add(self.missing());
    }

    /// Frames that the FPGA has made and that have not arrived yet.
    fn missing(&self) -> u32 {
        let Self { made, sent, dropped, lost, corrupt, .. } = *self;
        let missing = [sent, dropped, lost, corrupt].into_iter().fold(made, u32::wrapping_sub);
        // More frames arrived than the FPGA counted: its count is wrong.
        if missing < 1 << 31 { missing } else { 0 }
    }

    /// Updates both counters. Both only grow, and wrap at 2^32.
    fn advance(&mut self, made: u32, lost: u32) {
        for (count, found) in [(&mut self.made, made), (&mut self.lost, lost)] {
            if found.wrapping_sub(*count) < 1 << 31 {
                *count = found;
            }
        }
    }
}

#[derive(Debug)]
#[cfg_attr(test, derive(Clone))]
pub(crate) struct Run {
    length: RunLength,
    patterns: u16,
    /// Bits of a sample of a packet.
    width: Width,
    /// Packets come by the parallel port.
    is_parallel: bool,
    stall_after: Micros,
    last_frame: Micros,
    /// When the ring of the parallel port was full at a look, so that the FPGA had to wait.
    last_full: Option<Micros>,
    last_sequence: Option<u32>,
    /// How the packet that was sent last began.
    last_beginning: [u8; BEGINNING_BYTES],
    ending: Option<Ending>,
}

/// State of a run whose LEDs are off and whose frames may still be in transfer.
#[derive(Debug)]
#[cfg_attr(test, derive(Clone))]
struct Ending {
    since: Micros,
    /// Reply that waits for the end of the run.
    reply: Option<(u16, Outcome)>,
}

/// What a frame needs on its way from the FPGA to the link.
#[derive(Debug)]
pub(crate) struct Path<'m> {
    pub counters: &'m mut Counters,
    pub meter: &'m mut Meter,
    /// Memory for the samples of the frame before, for the meter.
    pub scratch: &'m mut [u8],
    /// A host listens, and no reply or event waits.
    pub may_send: bool,
}

/// How far a run is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Progress {
    UnderWay,
    /// The last frame of the run has been made, and LEDs are still on.
    Complete,
    /// The LEDs are on and no frame has come for too long.
    Stalled,
}

/// What the camera knows of the FPGA at the end of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fpga {
    /// The FPGA does not answer, so the end of the run waits for no frame.
    Absent,
    /// The FPGA has not confirmed that the LEDs are off, so it may still make frames.
    MayBeLit,
    Dark,
}

/// Reply and event of a run that is over.
#[derive(Debug, PartialEq)]
pub(crate) struct Ended {
    pub reply: Option<(u16, Outcome)>,
    /// [`EventKind::RunEnded`].
    pub event: EventKind,
}

/// The value of [`Register::Frames`]. A run of no frames is refused.
pub(crate) fn frames(length: RunLength) -> Result<u32, Refusal> {
    match length {
        // In the FPGA's register 0 means a run without end.
        RunLength::Continuous => Ok(0),
        RunLength::Frames(frames) => {
            configure::in_range(ConfigField::Frames, frames, 1, u32::MAX)
                .map_err(Refusal::Configuration)?;
            Ok(frames)
        }
    }
}

impl Run {
    /// `Start`: checks that the FPGA still holds `setup`, and switches the LEDs on.
    ///
    /// [`Refusal::Fault`] if the FPGA did not take the start; LEDs may then be on.
    pub fn start(
        now: Micros,
        (number, length): (u16, RunLength),
        setup: &Setup,
        limits: &Limits,
        bus: &mut impl FpgaBus,
    ) -> Result<Self, Refusal> {
        let frames = frames(length)?;
        let started = fpga::verify(bus, setup, limits)
            .and_then(|()| Ok(fpga::write(bus, Register::Frames, frames)?))
            .and_then(|()| Ok(fpga::stamp(bus, number, now)?))
            .map_err(|_| fpga::health(bus).err().unwrap_or(Fault::FpgaConfiguration))
            .and_then(|()| fpga::start(bus, control::START))
            .map_err(Refusal::Fault)?;
        let frame_micros = setup.frame_clocks() / crate::CLOCKS_PER_MICRO;
        let stall_after = frame_micros.saturating_mul(limits.stall_frames.into());
        let run = Self {
            length,
            patterns: setup.patterns,
            width: setup.width(),
            is_parallel: setup.mode & mode::PARALLEL != 0,
            stall_after: Micros(stall_after).max(limits.stall_min),
            last_frame: now,
            last_full: None,
            last_sequence: None,
            last_beginning: [0; _],
            ending: None,
        };
        if started == fpga::Started::OverAlready {
            let mut counters = Counters::default();
            if counters.read(bus).is_err() || !run.is_complete(counters.made) {
                return Err(Refusal::Fault(Fault::FpgaStalled));
            }
        }
        Ok(run)
    }

    /// What the rest of the run depends on, with ages for times.
    #[cfg(test)]
    pub fn key(&self, age: impl Fn(Micros) -> u64) -> [u64; 10] {
        let ending = self.ending.as_ref();
        let length = match self.length {
            RunLength::Continuous => 0,
            RunLength::Frames(frames) => u64::from(frames),
        };
        [
            length,
            self.patterns.into(),
            age(self.last_frame),
            self.last_full.map_or(u64::MAX, &age),
            self.last_sequence.map_or(0, |last| u64::from(last) + 1),
            ending.map_or(u64::MAX, |ending| age(ending.since)),
            ending.and_then(|ending| ending.reply).map_or(0, |(id, _)| u64::from(id) + 1),
            self.width.bytes() as u64,
            self.is_parallel.into(),
            // The sequence: the rest of the beginning is absolute.
            self.last_beginning[5..9].iter().fold(0, |key, &byte| key << 8 | u64::from(byte)),
        ]
    }

    /// Whether the LEDs are on.
    pub fn is_lit(&self) -> bool {
        self.ending.is_none()
    }

    pub fn is_complete(&self, made: u32) -> bool {
        matches!(self.length, RunLength::Frames(frames) if made >= frames)
    }

    /// Whether the run goes on, is complete or has stalled.
    pub fn progress(&self, now: Micros, counters: &Counters) -> Progress {
        if !self.is_lit() {
            Progress::UnderWay
        } else if self.is_complete(counters.made) {
            Progress::Complete
        } else if now.since(self.last_frame) > self.stall_after {
            Progress::Stalled
        } else {
            Progress::UnderWay
        }
    }

    /// Notes that the LEDs have been switched off. `reply` is sent after the last frame.
    pub fn end(&mut self, now: Micros, reply: Option<(u16, Outcome)>) {
        let ending = self.ending.get_or_insert(Ending { since: now, reply: None });
        if reply.is_some() {
            ending.reply = reply;
        }
    }

    /// Takes packets of the FPGA, which go to the host as they are; true if there was work.
    ///
    /// `may_come` is false if the FPGA does not answer, and after a failed release, when the line
    /// still signals the frame that was taken before. `release_pending` is set if a release fails.
    pub fn take(
        &mut self,
        now: Micros,
        path: Path<'_>,
        (may_come, release_pending): (bool, &mut bool),
        bus: &mut impl FpgaBus,
        sink: &mut impl PacketSink,
    ) -> bool {
        if self.is_parallel {
            return self.take_streamed(now, path, bus, sink);
        }
        may_come && bus.frame_ready() && self.take_packet(now, path, release_pending, bus, sink)
    }

    /// Takes at most one packet by the host port. It is asked for only if the link has room; a frame without room is
    /// released unread.
    ///
    /// The wires may have damaged the packet. Its CRC-32 is the host's to look at; here a packet counts as sent, and
    /// as damaged only if none can be found.
    fn take_packet(
        &mut self,
        now: Micros,
        path: Path<'_>,
        release_pending: &mut bool,
        bus: &mut impl FpgaBus,
        sink: &mut impl PacketSink,
    ) -> bool {
        let Path { counters, meter, scratch, may_send } = path;
        let length = ready::fast_read_bytes(self.patterns, self.width);
        let mut room = if may_send { sink.claim(length) } else { None };
        let mut place = None;
        if let Some(room) = &mut room {
            match bus.packet(room) {
                Ok(false) => return false,
                Ok(true) => place = ready::packet_in(room, self.patterns, self.width),
                Err(_) => {}
            }
        }
        if counters.update(bus).is_err() {
            // The FPGA keeps the frame until it is known whether the frame is counted already.
            return false;
        }
        let packet = match (&room, &place) {
            (Some(room), Some(place)) => room.get(place.clone()),
            _ => None,
        };
        let beginning = packet.and_then(<[u8]>::first_chunk);
        // Otherwise the bus has lost the release of a frame that is counted already.
        if counters.missing() > 0 && beginning != Some(&self.last_beginning) {
            self.last_frame = now;
            let has_room = room.is_some();
            if let (Some(packet), Some(beginning)) = (packet, beginning) {
                self.last_beginning = *beginning;
                meter.look(now, (packet, self.patterns), scratch, bus);
            }
            let count = match place {
                Some(place) => {
                    sink.commit(place);
                    &mut counters.sent
                }
                None if has_room => {
                    meter.judge(false);
                    &mut counters.corrupt
                }
                None => &mut counters.dropped,
            };
            *count = count.wrapping_add(1);
        }
        *release_pending = fpga::release(bus).is_err();
        true
    }

    /// Reply and event of a run whose LEDs are off and whose last frame is through; `None` before.
    pub fn wind_up(
        &mut self,
        now: Micros,
        counters: &mut Counters,
        fpga: Fpga,
        bus: &mut impl FpgaBus,
    ) -> Option<Ended> {
        let ending = self.ending.as_mut()?;
        if fpga != Fpga::Absent {
            let unknown = fpga == Fpga::MayBeLit || counters.read(bus).is_err();
            if self.is_parallel
                && let Some(last) = self.last_sequence
            {
                counters.count_gone(last.wrapping_add(1));
            }
            let more = unknown || counters.missing() > 0;
            if more && now.since(ending.since) <= DRAIN_PATIENCE {
                return None;
            }
        }
        // The FPGA keeps frames for which a slow host leaves no room.
        if self.last_full.is_some_and(|full| now.since(full) <= ROOM_PATIENCE) {
            counters.drop_missing();
        }
        // Frames that the FPGA made and did not deliver count as damaged.
        counters.corrupt = counters.corrupt.wrapping_add(counters.missing());
        let Counters { run, made, dropped, lost, corrupt, .. } = *counters;
        let event = EventKind::RunEnded {
            run,
            frames_made: made,
            frames_dropped: dropped,
            fpga_frames_lost: lost,
            fpga_frames_corrupt: corrupt,
        };
        Some(Ended { reply: ending.reply.take(), event })
    }
}

#[cfg(test)]
#[path = "tests/run.rs"]
mod tests;
