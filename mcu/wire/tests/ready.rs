//! A packet that the FPGA has made, as the firmware's signal meter reads it (`tests/packets.rs` has the laws for all
//! packets).
#![expect(clippy::unwrap_used, reason = "a failed unwrap in a helper fails its test")]

use nirspi_wire::FrameFlags;
use nirspi_wire::packet::{overhead, seal};
use nirspi_wire::ready::{BEGINNING_BYTES, Head, NUMBER_BYTES, Reader};
use nirspi_wire::samples::Width;

/// A packet in which every pattern has the same sample.
fn packet(head: &Head, sample: i32) -> Vec<u8> {
    let sample = &sample.to_le_bytes()[..head.width.bytes()];
    let payload = [&head.to_bytes()[..], &sample.repeat(head.patterns.into())].concat();
    let mut room = vec![0; payload.len() + overhead(payload.len())];
    seal(&payload, &mut room).unwrap().to_vec()
}

fn head(patterns: u16, width: Width) -> Head {
    let flags = FrameFlags(5);
    Head { run: 1, sequence: 2, device_time_us: 3, sweeps: 4, flags, patterns, width }
}

#[test]
fn a_packet_with_a_wrong_sample_is_not_intact() {
    let head = head(60, Width::Bits32);
    let sound = packet(&head, 0x0102_0304);
    // From the samples on, up to the checksum and the delimiter.
    for place in 50..sound.len() - 5 {
        let mut packet = sound.clone();
        packet[place] ^= 0x80;
        let mut reader = Reader::new(&packet, head.patterns);
        for _ in 0..head.patterns {
            reader.sample();
        }
        assert!(!reader.is_intact(), "byte {place}");
    }
}

/// COBS cuts bytes without a zero into blocks of 254 bytes. Such a block stands for its bytes alone, and every shorter
/// block for its bytes and a zero.
#[test]
fn samples_without_a_zero_byte_are_read_across_the_longest_blocks() {
    for (width, sample) in [(Width::Bits24, 0x005A_A55A), (Width::Bits32, 0x1B5A_A55A)] {
        let head = head(400, width);
        let packet = packet(&head, sample);
        assert!(packet.contains(&0xFF), "a block of 254 bytes");
        let mut reader = Reader::new(&packet, head.patterns);
        assert!((0..400).all(|_| reader.sample() == sample) && reader.is_intact(), "{width:?}");
    }
}

#[test]
fn frames_of_other_runs_numbers_and_times_differ_in_the_bytes_that_tell_them_apart() {
    let head = head(1, Width::Bits32);
    let one = packet(&head, 5);
    let differ = |other: Head, bytes| assert_ne!(packet(&other, 5)[..bytes], one[..bytes]);
    differ(Head { run: u16::MAX, ..head }, NUMBER_BYTES);
    differ(Head { sequence: 1 << 31, ..head }, NUMBER_BYTES);
    differ(Head { device_time_us: 1 << 63, ..head }, BEGINNING_BYTES);
}
