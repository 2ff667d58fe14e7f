//! What a receiver may take from a frame of the FPGA.

use nirspi_wire::fpga::{FpgaFrame, FrameError, Header, SUM_MODULUS, Sums};
use nirspi_wire::{FrameFlags, crc32};

/// A frame of two patterns, with its checksum.
fn frame(header: &Header, sums: [Sums; 2]) -> Vec<u8> {
    let mut bytes = header.to_bytes().to_vec();
    for sum in sums {
        bytes.extend(sum.to_bytes());
    }
    bytes.extend(crc32(&bytes).to_le_bytes());
    bytes
}

const HEADER: Header = Header {
    patterns: 2,
    flags: FrameFlags::AFTER_LOSS,
    sequence: 7,
    sweeps: 3,
    over_range: 4,
    lost: 5,
    clock: 1 << 40,
};

#[test]
fn a_reading_is_the_pattern_less_its_complement_to_the_ends_of_the_range() {
    let most = SUM_MODULUS - 1;
    let sums = [(0, most), (5, 7), (9, 9), (7, 5), (most, 0)];
    let readings = sums.map(|(positive, negative)| Sums { positive, negative }.difference());
    assert_eq!(readings, [-(most as i64), -2, 0, 2, most as i64]);
}

/// The firmware asks which frame a damaged one was, before it packs the frame.
#[test]
fn the_header_of_a_frame_is_read_though_its_sums_are_damaged() {
    let whole = frame(&HEADER, [Sums { positive: 1, negative: 2 }; 2]);
    assert_eq!(FpgaFrame::parse_header(&whole), Some(HEADER));
    let mut damaged = whole.clone();
    *damaged.last_mut().unwrap() ^= 1;
    assert_eq!(FpgaFrame::parse(&damaged), Err(FrameError::Crc));
    assert_eq!(FpgaFrame::parse_header(&damaged), Some(HEADER));
    damaged[0] ^= 1;
    assert_eq!(FpgaFrame::parse_header(&damaged), None);
    assert_eq!(FpgaFrame::parse_header(&whole[..8]), None);
}
