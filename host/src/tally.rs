//! The tally of one run: packets in, the sum of its frames and their account out, live or from a recording.
//!
//! The one law: a recording gives the same tally as the capture that made it.

use crate::account::{Arrival, LossAccount, LossCounters};
use crate::integrate::Integrated;
use crate::recording::{Packet, Recording, RecordingError};
use crate::setup::MeasurementSetup;
use nirspi_wire::{DeviceMessage, EventKind, Frame, PacketError, open};

/// What a run's packets amount to.
#[derive(Debug, Clone)]
pub struct Tally {
    /// The run that counts; `None`: that of the first frame.
    run: Option<u16>,
    account: LossAccount,
    integrated: Integrated,
    ended: bool,
    device_time_us: u64,
    /// Intact messages of a newer protocol version.
    unknown: u64,
}

impl Tally {
    /// Nothing has come. Frames of another run than `run` are stragglers of earlier ones, and do not count; `None`
    /// counts the run of the first frame that comes.
    #[must_use]
    pub fn new(setup: &MeasurementSetup, run: Option<u16>) -> Self {
        let integrated = Integrated::new(setup);
        let account = LossAccount::new();
        Self { run, account, integrated, ended: false, device_time_us: 0, unknown: 0 }
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
        if !self.integrated.fits(frame) {
            // Intact, yet not of this setup: as lost as if it had been damaged.
            self.account.damaged();
            return false;
        }
        let received = self.account.frame(frame.sequence) == Arrival::Received;
        if received {
            self.integrated.add(frame);
        }
        received
    }

    /// The camera says that the run is over, and how many frames it has made.
    pub fn end(&mut self, frames_made: u32) {
        self.account.made(frames_made);
        self.ended = true;
    }

    /// Whether the camera has said that the run is over.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.ended
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
pub fn tally_recording(
    recording: &mut Recording,
) -> Result<(Integrated, LossCounters), RecordingError> {
    let mut tally = Tally::new(&recording.setup, None);
    for packet in recording {
        tally.packet(&open(encoded(&mut packet?)));
    }
    let counters = tally.account.counters();
    Ok((tally.integrated, counters))
}

/// What each frame of a recording that arrived in order says by itself, and what became of all of them.
///
/// # Errors
/// [`RecordingError`] where the file cannot be read.
pub fn frames_of_recording(
    recording: &mut Recording,
) -> Result<(Vec<Integrated>, LossCounters), RecordingError> {
    let setup = recording.setup.clone();
    let mut tally = Tally::new(&setup, None);
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
    Ok((frames, tally.account.counters()))
}

/// The packet without its delimiter, to be decoded in place.
fn encoded(packet: &mut Packet) -> &mut [u8] {
    let bytes = &mut packet.bytes;
    if bytes.last() == Some(&0) {
        bytes.pop();
    }
    bytes
}
