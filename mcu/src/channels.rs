//! The frames of further detectors, which go out right after the frame of detector 0.

use crate::packets::{STREAM_HEADER_BYTES, send};
use crate::{FpgaBus, PacketSink};
use nirspi_wire::fpga::{FpgaFrame, Header};
use nirspi_wire::{Channel, DeviceMessage, Frame, Samples};

/// The frames that belong to a frame of detector 0.
#[derive(Debug)]
pub(crate) struct Channels {
    pub run: u16,
    /// Device time of the frame of detector 0.
    pub device_time_us: u64,
    /// Header of the frame of detector 0.
    pub of: Header,
}

impl Channels {
    /// Sends the frame of each further detector. A frame that is damaged, or for which the link has no
    /// room, is left out: the host sees a gap in the sequence of its detector.
    pub fn send(&self, scratch: &mut [u8], bus: &mut impl FpgaBus, sink: &mut impl PacketSink) {
        for detector in 1..bus.detectors() {
            let Ok(Some(bytes)) = bus.channel(detector) else { continue };
            let Some((header, samples)) = self.packed(bytes, scratch) else { continue };
            let frame = Frame {
                run: self.run,
                sequence: header.sequence,
                device_time_us: self.device_time_us,
                sweeps: header.sweeps,
                flags: header.flags,
                samples,
            };
            let payload = samples.byte_len().saturating_add(STREAM_HEADER_BYTES);
            send(&DeviceMessage::Channel(Channel { detector, frame }), payload, sink);
        }
    }

    /// The header and packed samples of an intact frame of the same patterns and number.
    fn packed<'s>(&self, bytes: &[u8], scratch: &'s mut [u8]) -> Option<(Header, Samples<'s>)> {
        let frame = FpgaFrame::parse(bytes).ok()?;
        let Header { patterns, sequence, .. } = frame.header;
        if (patterns, sequence) != (self.of.patterns, self.of.sequence) {
            return None;
        }
        let samples = Samples::pack(frame.sums().map(|sums| sums.difference()), scratch).ok()?;
        Some((frame.header, samples))
    }
}
