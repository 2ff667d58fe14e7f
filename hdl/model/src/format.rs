//! Serialises a delivered bank into the bytes of the host port: header, sums, CRC-32. The layout is
//! defined in [`nirspi_wire::fpga`].
//!
//! # Invariant
//! Without complements every negative sum reads 0, whatever an earlier run has left in its RAM
//! (`golden::measurement::the_negative_half_of_an_earlier_run_does_not_show_in_a_plain_one`).

use nirspi_wire::{
    FrameFlags, crc32,
    fpga::{Header, Sums, frame_bytes},
};

/// The bytes of a frame: this header, and sums from the beginning of the bank.
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
