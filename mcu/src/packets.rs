//! Encodes a message in the link's own memory, whole or not at all.

use crate::PacketSink;
use nirspi_wire::DeviceMessage;
use nirspi_wire::packet::{encode, overhead};

/// Largest number of postcard bytes around the samples of a frame, a raw burst or a depth map.
pub(crate) const STREAM_HEADER_BYTES: usize = 64;

/// Sends a message of at most `payload` bytes of postcard; `false`: the link has no room for the
/// message.
pub(crate) fn send(
    message: &DeviceMessage<'_>,
    payload: usize,
    sink: &mut impl PacketSink,
) -> bool {
    let Some(room) = sink.claim(payload.saturating_add(overhead(payload))) else {
        return false;
    };
    let Ok(packet) = encode(message, room) else {
        return false;
    };
    let length = packet.len();
    sink.commit(0..length);
    true
}
