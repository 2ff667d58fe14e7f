//! The tally of one run, live or from a recording: sums the frames of its packets and makes their
//! account.
//!
//! A recording gives the same tally as the capture that made it. [`FrameCount`] makes the account alone.

use crate::account::{Arrival, Check, LossAccount};
use crate::integrate::{Changes, Integrated, KnownOfRun, NEWEST, Phases};
use crate::setup::MeasurementSetup;
use nirspi_wire::{DeviceMessage, EventKind, Frame, FrameFlags, PacketError};
use std::collections::VecDeque;
use std::ops::{Deref, DerefMut};
use std::sync::Arc;
use thiserror::Error;

/// The account of a run's packets.
#[derive(Debug, Clone)]
pub struct FrameCount {
    /// The run that counts; `None` means the run of the first frame.
    run: Option<u16>,
    patterns: usize,
    differential: bool,
    account: LossAccount,
    /// How the first invalid frame contradicts the setup.
    misfit: Option<Misfit>,
    /// The number of frames that the camera reported at the end of the run.
    said: Option<u32>,
    device_time_us: u64,
    /// Number of intact messages of a newer protocol version.
    unknown: u64,
}

/// The sum of a run's frames, and the account of its packets.
#[derive(Debug, Clone)]
pub struct Tally {
    count: FrameCount,
    integrated: Integrated,
    /// Of sweeps that alternate.
    phases: Option<Phases>,
    changes: Changes,
    /// The newest frames, each alone, with their numbers.
    newest: VecDeque<(u64, Arc<Integrated>)>,
    /// The sums of the frame that is added: all that follows reads them again.
    sums: Vec<i64>,
}

/// How an intact frame contradicts the setup.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Misfit {
    /// The number of patterns differs.
    #[error("frames of {found} patterns, expected {expected} by the setup")]
    Patterns {
        /// Number of samples of the frame.
        found: usize,
        /// Number of patterns of the setup.
        expected: usize,
    },
    /// The frame has differences and the setup single patterns, or the reverse.
    #[error(
        "frames of {}, expected {} by the setup",
        kind_of_samples(*.differential),
        kind_of_samples(!*.differential)
    )]
    Differential {
        /// Whether the frame has differences.
        differential: bool,
    },
    /// The frame sums no sweep, so its samples are not measurements.
    #[error("frames of 0 sweeps, expected at least 1")]
    NoSweep,
}

fn kind_of_samples(differential: bool) -> &'static str {
    if differential { "differences of patterns and complements" } else { "single patterns" }
}

impl FrameCount {
    /// The count before the first packet. Frames of another run than `run` are stragglers of earlier runs and do not
    /// count. With `None`, the run of the first frame counts.
    #[must_use]
    pub fn new(setup: &MeasurementSetup, run: Option<u16>) -> Self {
        Self {
            run,
            patterns: setup.rows.len(),
            differential: setup.differential,
            account: LossAccount::new(),
            misfit: None,
            said: None,
            device_time_us: 0,
            unknown: 0,
        }
    }

    /// The same before the first packet, of the frames from this number on. Earlier frames of
    /// the run do not count.
    #[must_use]
    pub fn beginning_at(self, first_frame: u64) -> Self {
        Self { account: LossAccount::beginning_at(first_frame), ..self }
    }

    /// Counts a packet. Returns whether the packet is a frame that arrived in order.
    pub fn packet(&mut self, content: &Result<DeviceMessage<'_>, PacketError>) -> bool {
        match content {
            Ok(DeviceMessage::Frame(frame)) => return self.frame(frame),
            Ok(DeviceMessage::Event(event)) => match event.kind {
                EventKind::RunEnded { run, frames_made, .. }
                    if self.run.is_none_or(|own| own == run) =>
                {
                    self.end(frames_made);
                }
                _ => {}
            },
            Ok(_) => {}
            Err(PacketError::Message) => self.unknown += 1,
            Err(PacketError::BufferTooSmall | PacketError::TooLong) => {
                self.account.damaged(Check::Length);
            }
            Err(PacketError::Cobs) => self.account.damaged(Check::Cobs),
            Err(PacketError::Crc) => self.account.damaged(Check::Crc),
        }
        false
    }

    fn frame(&mut self, frame: &Frame<'_>) -> bool {
        if *self.run.get_or_insert(frame.run) != frame.run {
            return false;
        }
        self.device_time_us = self.device_time_us.max(frame.device_time_us);
        if let Some(misfit) = self.misfit_of(frame) {
            // An intact frame that does not fit the setup counts as damaged.
            self.misfit.get_or_insert(misfit);
            self.account.damaged(Check::Setup);
            return false;
        }
        self.account.frame(frame.sequence) == Arrival::Received
    }

    fn misfit_of(&self, frame: &Frame<'_>) -> Option<Misfit> {
        let differential = frame.flags.contains(FrameFlags::DIFFERENTIAL);
        let (found, expected) = (frame.samples.len(), self.patterns);
        if found != expected {
            Some(Misfit::Patterns { found, expected })
        } else if differential != self.differential {
            Some(Misfit::Differential { differential })
        } else {
            (frame.sweeps == 0).then_some(Misfit::NoSweep)
        }
    }

    /// Records the end of the run and the number of frames that the camera reported.
    pub fn end(&mut self, frames_made: u32) {
        self.account.made(frames_made);
        self.said = Some(frames_made);
    }

    /// Number of frames of the whole run that the camera reported, after the end of the run. The
    /// camera counts in 32 bits; the account counts further.
    #[must_use]
    pub fn made(&self) -> Option<u64> {
        let accounted = self.account.accounted();
        self.said.map(|said| if said == accounted as u32 { accounted } else { u64::from(said) })
    }

    /// How the first invalid frame contradicts the setup; `None` if all frames fit.
    #[must_use]
    pub fn misfit(&self) -> Option<Misfit> {
        self.misfit
    }

    /// Whether the camera has reported the end of the run.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.said.is_some()
    }

    /// Whether any packet of the run, whole or damaged, has arrived.
    #[must_use]
    pub fn has_begun(&self) -> bool {
        self.account.accounted() > self.account.first()
            || self.account.failed_checks().packets() > 0
    }

    /// The camera's time of the newest frame.
    #[must_use]
    pub fn device_time_us(&self) -> u64 {
        self.device_time_us
    }

    /// The account of the frames.
    #[must_use]
    pub fn account(&self) -> &LossAccount {
        &self.account
    }

    /// Frames that arrived, in order or late.
    #[must_use]
    pub fn arrived(&self) -> u64 {
        let counters = self.account.counters();
        counters.received + counters.late
    }

    /// Number of intact messages that this program does not know. The messages are skipped, because
    /// a newer camera may send them.
    #[must_use]
    pub fn unknown_packets(&self) -> u64 {
        self.unknown
    }
}

/// A tally counts as its account does.
impl Deref for Tally {
    type Target = FrameCount;

    fn deref(&self) -> &FrameCount {
        &self.count
    }
}

impl DerefMut for Tally {
    fn deref_mut(&mut self) -> &mut FrameCount {
        &mut self.count
    }
}

impl Tally {
    /// An empty tally of these frames.
    #[must_use]
    pub fn new(setup: &MeasurementSetup, count: FrameCount) -> Self {
        Self {
            count,
            integrated: Integrated::new(setup),
            phases: setup.alternates().then(Phases::default),
            changes: Changes::default(),
            newest: VecDeque::new(),
            sums: Vec::new(),
        }
    }

    /// Counts a packet. Returns whether the packet was a frame that was added to the sum.
    pub fn packet(&mut self, content: &Result<DeviceMessage<'_>, PacketError>) -> bool {
        let counts = self.count.packet(content);
        if let (true, Ok(DeviceMessage::Frame(frame))) = (counts, content) {
            self.sums.clear();
            self.sums.extend(frame.samples.iter());
            self.integrated.add_read(frame, &self.sums);
            self.keep(frame);
            self.changes.add(self.sums.iter().copied(), frame.sweeps);
            if let Some(phases) = &mut self.phases {
                phases.add(frame.sequence, frame.sweeps, self.sums.iter().copied());
            }
        }
        counts
    }

    /// Keeps a frame alone, in the place of the oldest one that is kept.
    fn keep(&mut self, frame: &Frame<'_>) {
        let oldest = if self.newest.len() < NEWEST { None } else { self.newest.pop_front() };
        let sums = oldest.and_then(|(_, oldest)| Arc::into_inner(oldest));
        let mut alone = sums.map_or_else(|| self.integrated.empty(), Integrated::emptied);
        alone.add_read_alone(frame, &self.sums);
        self.newest.push_back((frame.sequence.into(), Arc::new(alone)));
    }

    /// The sum of the frames received in order.
    #[must_use]
    pub fn integrated(&self) -> &Integrated {
        &self.integrated
    }

    /// What the frames tell together, for the measurements of each of them.
    #[must_use]
    pub fn known(&self) -> KnownOfRun {
        let noise_of_a_sweep = self.integrated.noise_of_a_sweep();
        let offsets = self.phases.as_ref().zip(noise_of_a_sweep);
        let offsets = offsets.and_then(|(phases, noise)| phases.offsets(noise)).map(Arc::new);
        let changed = noise_of_a_sweep.and_then(|noise| self.changes.share(noise));
        let newest = changed.map(|_| self.newest.iter().cloned().collect()).unwrap_or_default();
        KnownOfRun { noise_of_a_sweep, offsets, changed, newest }
    }
}
