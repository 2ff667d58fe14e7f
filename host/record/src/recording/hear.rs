//! Reads every packet of a recording, and counts it.

use super::{Packet, Recording, RecordingError};
use nirspi_camera::tally::{FrameCount, Tally};
use nirspi_wire::packet::{parse, unseal};
use nirspi_wire::{DeviceMessage, Frame, PacketError};
use std::sync::mpsc::sync_channel;
use std::thread;

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
/// and the count so far.
///
/// # Errors
/// [`RecordingError`] if the file cannot be read, and the errors of `hear`.
pub fn hear_recording<E: From<RecordingError>>(
    recording: &mut Recording,
    mut hear: impl FnMut(&Heard<'_>, &FrameCount) -> Result<(), E>,
) -> Result<FrameCount, E> {
    let mut count = recording.frame_count();
    each_packet(recording, |Packet { bytes, time_ns }, content| {
        let counts = count.packet(content);
        hear(&Heard { raw: bytes, time_ns: *time_ns, content, counts }, &count)
    })?;
    Ok(count)
}

/// Counts the packets of a recording again, and sums its frames.
///
/// # Errors
/// [`RecordingError`] if the file cannot be read.
pub fn tally_recording(recording: &mut Recording) -> Result<Tally, RecordingError> {
    let mut tally = Tally::new(&recording.setup, recording.frame_count());
    each_packet(recording, |_, content| {
        tally.packet(content);
        Ok::<_, RecordingError>(())
    })?;
    Ok(tally)
}

/// Packets that are handed over at a time, and how many times as many are read ahead.
const TOGETHER: usize = 64;
const AHEAD: usize = 4;

/// A packet, and the bytes of its message.
type Unsealed = (Packet, Result<Vec<u8>, PacketError>);

/// Reads and checks the packets in a thread of its own, while the caller takes those before.
fn each_packet<E: From<RecordingError>>(
    recording: &mut Recording,
    mut take: impl FnMut(&Packet, &Result<DeviceMessage<'_>, PacketError>) -> Result<(), E>,
) -> Result<(), E> {
    let (to, from) = sync_channel(AHEAD);
    thread::scope(|scope| {
        scope.spawn(move || {
            let mut packets = recording.map(|packet| packet.map(unsealed));
            loop {
                let some: Vec<Result<Unsealed, _>> = packets.by_ref().take(TOGETHER).collect();
                // The receiver is gone when the caller has ended with an error.
                if some.is_empty() || to.send(some).is_err() {
                    break;
                }
            }
        });
        for packet in from.into_iter().flatten() {
            let (packet, message) = packet?;
            take(&packet, &message.as_deref().map_err(|error| *error).and_then(parse))?;
        }
        Ok(())
    })
}

fn unsealed(packet: Packet) -> Unsealed {
    let mut bytes = packet.bytes.strip_suffix(&[0]).unwrap_or(&packet.bytes).to_vec();
    let length = unseal(&mut bytes).map(<[u8]>::len);
    let message = length.map(|length| {
        bytes.truncate(length);
        bytes
    });
    (packet, message)
}
