//! The tally of one run: packets in, the sum of its frames and their account out, live or from a recording.
//!
//! The one law: a recording gives the same tally as the capture that made it.

use crate::account::{Arrival, LossAccount};
use crate::integrate::Integrated;
use crate::recording::{Packet, Recording, RecordingError};
use crate::setup::MeasurementSetup;
use nirspi_wire::{DeviceMessage, EventKind, Frame, FrameFlags, PacketError, open};
use thiserror::Error;

/// What a run's packets amount to.
#[derive(Debug, Clone)]
pub struct Tally {
    /// The run that counts; `None`: that of the first frame.
    run: Option<u16>,
    differential: bool,
    account: LossAccount,
    integrated: Integrated,
    /// Why the first frame that is not of the setup is none.
    misfit: Option<Misfit>,
    /// Frames made, by the camera's word, once the run has ended.
    said: Option<u32>,
    device_time_us: u64,
    /// Intact messages of a newer protocol version.
    unknown: u64,
}

/// How an intact frame contradicts the setup.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Misfit {
    /// Another number of patterns.
    #[error("frames of {found} patterns, expected {expected} by the setup")]
    Patterns {
        /// Samples of the frame.
        found: usize,
        /// Patterns of the setup.
        expected: usize,
    },
    /// Differences where the setup has single patterns, or the reverse.
    #[error(
        "frames of {}, expected {} by the setup",
        kind_of_samples(*.differential),
        kind_of_samples(!*.differential)
    )]
    Differential {
        /// What the frame says.
        differential: bool,
    },
    /// No sweep summed: the samples are no measurement.
    #[error("frames of 0 sweeps, expected at least 1")]
    NoSweep,
}

fn kind_of_samples(differential: bool) -> &'static str {
    if differential { "differences of patterns and complements" } else { "single patterns" }
}

impl Tally {
    /// Nothing has come. Frames of another run than `run` are stragglers of earlier ones, and do not count; `None`
    /// counts the run of the first frame that comes.
    #[must_use]
    pub fn new(setup: &MeasurementSetup, run: Option<u16>) -> Self {
        Self {
            run,
            differential: setup.differential,
            account: LossAccount::new(),
            integrated: Integrated::new(setup),
            misfit: None,
            said: None,
            device_time_us: 0,
            unknown: 0,
        }
    }

    /// A packet has come. Returns whether it was a frame that was added to the sum.
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
            Err(_) => self.account.damaged(),
        }
        false
    }

    fn frame(&mut self, frame: &Frame<'_>) -> bool {
        if *self.run.get_or_insert(frame.run) != frame.run {
            return false;
        }
        self.device_time_us = self.device_time_us.max(frame.device_time_us);
        if let Some(misfit) = self.misfit_of(frame) {
            // Intact, yet not of this setup: as lost as if it had been damaged.
            self.misfit.get_or_insert(misfit);
            self.account.damaged();
            return false;
        }
        let received = self.account.frame(frame.sequence) == Arrival::Received;
        if received {
            self.integrated.add(frame);
        }
        received
    }

    fn misfit_of(&self, frame: &Frame<'_>) -> Option<Misfit> {
        let differential = frame.flags.contains(FrameFlags::DIFFERENTIAL);
        if !self.integrated.fits(frame) {
            let (found, expected) = (frame.samples.len(), self.integrated.patterns());
            Some(Misfit::Patterns { found, expected })
        } else if differential != self.differential {
            Some(Misfit::Differential { differential })
        } else {
            (frame.sweeps == 0).then_some(Misfit::NoSweep)
        }
    }

    /// The camera says that the run is over, and how many frames it has made.
    pub fn end(&mut self, frames_made: u32) {
        self.account.made(frames_made);
        self.said = Some(frames_made);
    }

    /// Frames that the run has made by the camera's word, once it has ended. The camera counts in 32 bits; the account
    /// goes on beyond.
    #[must_use]
    pub fn made(&self) -> Option<u64> {
        let accounted = self.account.accounted();
        self.said.map(|said| if said == accounted as u32 { accounted } else { u64::from(said) })
    }

    /// Why the first frame that contradicts the setup does so; `None` if no frame does.
    #[must_use]
    pub fn misfit(&self) -> Option<Misfit> {
        self.misfit
    }

    /// Whether the camera has said that the run is over.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.said.is_some()
    }

    /// Whether anything of the run, whole or damaged, has come.
    #[must_use]
    pub fn has_begun(&self) -> bool {
        self.account.accounted() > 0 || self.account.damaged_packets() > 0
    }

    /// The camera's time of the newest frame.
    #[must_use]
    pub fn device_time_us(&self) -> u64 {
        self.device_time_us
    }

    /// What became of each frame.
    #[must_use]
    pub fn account(&self) -> &LossAccount {
        &self.account
    }

    /// Intact messages that this program does not know: passed over, since a newer camera may send them.
    #[must_use]
    pub fn unknown_packets(&self) -> u64 {
        self.unknown
    }

    /// The sum of the frames received in order.
    #[must_use]
    pub fn integrated(&self) -> &Integrated {
        &self.integrated
    }
}

/// Counts the packets of a recording again.
///
/// # Errors
/// [`RecordingError`] where the file cannot be read.
pub fn tally_recording(recording: &mut Recording) -> Result<Tally, RecordingError> {
    let mut tally = Tally::new(&recording.setup, recording.run);
    for packet in recording {
        tally.packet(&open(encoded(&mut packet?)));
    }
    Ok(tally)
}

/// What each frame of a recording that arrived in order says by itself, and what became of all of them.
///
/// # Errors
/// [`RecordingError`] where the file cannot be read.
pub fn frames_of_recording(
    recording: &mut Recording,
) -> Result<(Vec<Integrated>, Tally), RecordingError> {
    let setup = recording.setup.clone();
    let mut tally = Tally::new(&setup, recording.run);
    let mut frames = Vec::new();
    for packet in recording {
        let mut packet = packet?;
        let content = open(encoded(&mut packet));
        if let (true, Ok(DeviceMessage::Frame(frame))) = (tally.packet(&content), &content) {
            let mut alone = Integrated::new(&setup);
            alone.add(frame);
            frames.push(alone);
        }
    }
    Ok((frames, tally))
}

/// The packet without its delimiter, to be decoded in place.
fn encoded(packet: &mut Packet) -> &mut [u8] {
    let bytes = &mut packet.bytes;
    if bytes.last() == Some(&0) {
        bytes.pop();
    }
    bytes
}
