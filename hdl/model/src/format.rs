//! Turns a delivered bank into the bytes of the host port: header, sums, CRC-32.
//!
//! The one law: the layout is [`nirspi_wire::fpga`]'s; without complements the negative half reads 0,
//! whatever an earlier run has left in its RAM.

use nirspi_wire::{
    FrameFlags, crc32,
    fpga::{Header, Sums, frame_bytes},
};

/// The bytes of a frame with this header and the first of these sums.
pub(crate) fn frame(header: &Header, bank: &[Sums]) -> Vec<u8> {
    let differential = header.flags.contains(FrameFlags::DIFFERENTIAL);
    let mut bytes = Vec::with_capacity(frame_bytes(header.patterns));
    bytes.extend(header.to_bytes());
    for sums in bank.iter().take(header.patterns.into()) {
        let negative = if differential { sums.negative } else { 0 };
        bytes.extend(Sums { negative, ..*sums }.to_bytes());
    }
    bytes.extend(crc32(&bytes).to_le_bytes());
    bytes
}
