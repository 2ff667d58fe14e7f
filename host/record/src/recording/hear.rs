//! Reads every packet of a recording, and counts it.

use super::{Recording, RecordingError};
use nirspi_camera::tally::Tally;
use nirspi_wire::{DeviceMessage, Frame, PacketError, open};

/// A packet of a recording, with its content.
#[derive(Debug)]
pub struct Heard<'p> {
    /// The packet as received, delimiter included.
    pub raw: &'p [u8],
    /// Time of arrival in ns of the host's clock.
    pub time_ns: u64,
    /// The message in the packet.
    pub content: &'p Result<DeviceMessage<'p>, PacketError>,
    /// Whether the packet is a frame that arrived in order, and counts.
    pub counts: bool,
}

impl Heard<'_> {
    /// The frame that arrived in order; `None` for any other packet.
    #[must_use]
    pub fn frame(&self) -> Option<&Frame<'_>> {
        match self.content {
            Ok(DeviceMessage::Frame(frame)) if self.counts => Some(frame),
            _ => None,
        }
    }
}

/// Reads every packet of a recording, and counts it. `hear` gets each packet after it was counted,
/// and the tally so far.
///
/// # Errors
/// [`RecordingError`] if the file cannot be read, and the errors of `hear`.
pub fn hear_recording<E: From<RecordingError>>(
    recording: &mut Recording,
    mut hear: impl FnMut(&Heard<'_>, &Tally) -> Result<(), E>,
) -> Result<Tally, E> {
    let mut tally = recording.tally();
    let mut scratch = Vec::new();
    for packet in recording {
        let packet = packet?;
        scratch.clear();
        scratch.extend_from_slice(packet.bytes.strip_suffix(&[0]).unwrap_or(&packet.bytes));
        let content = &open(&mut scratch);
        let counts = tally.packet(content);
        let heard = Heard { raw: &packet.bytes, time_ns: packet.time_ns, content, counts };
        hear(&heard, &tally)?;
    }
    Ok(tally)
}

/// Counts the packets of a recording again.
///
/// # Errors
/// [`RecordingError`] if the file cannot be read.
pub fn tally_recording(recording: &mut Recording) -> Result<Tally, RecordingError> {
    hear_recording(recording, |_, _| Ok(()))
}
