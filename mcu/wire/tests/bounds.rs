//! How long packets are: buffers and transfers are laid out by these numbers.

use nirspi_wire::packet::{hello_of_any_version, overhead, parse, seal, unseal};
use nirspi_wire::ready::{
    FAST_LEAD_BYTES, HEADER_BYTES, LEAD_BYTES, MAX_READ_BYTES, fast_read_bytes, packet_in,
    read_bytes,
};
use nirspi_wire::samples::{Width, Words};
use nirspi_wire::version::{self, speaks};
use nirspi_wire::{Answer, DeviceMessage, PATTERNS, Reply, Samples, encode};

/// A payload without zeros is the longest for COBS. Its checksum may have zeros, so the longest packet
/// has the bound, or is a byte short of it.
#[test]
fn the_overhead_is_what_a_payload_without_zeros_needs() {
    let mut room = [0; 2048];
    for length in 0..=1600 {
        let packet = seal(&vec![0xA5; length], &mut room).unwrap().len();
        let most = length + overhead(length);
        assert!((most - 1..=most).contains(&packet), "{length}: {packet} of {most}");
    }
}

/// A read that is too short cuts the packet, and one that is too long costs time in every frame.
#[test]
fn a_read_of_a_packet_ends_with_its_last_byte_if_the_packet_begins_as_late_as_it_may() {
    let mut room = [0; 2 * 4096];
    for (width, bytes) in [(Width::Bits32, 4), (Width::Bits24, 3)] {
        for patterns in 1..=PATTERNS {
            let payload = vec![0xA5; HEADER_BYTES + bytes * usize::from(patterns)];
            let packet = seal(&payload, &mut room).unwrap().len();
            let most = read_bytes(patterns, width);
            assert!(
                (most - 1..=most).contains(&(LEAD_BYTES + packet)),
                "{patterns}, {width:?}: {packet} of {most}"
            );
        }
    }
}

#[test]
fn a_read_that_is_clocked_by_sck_has_room_for_a_longer_lead() {
    for width in [Width::Bits24, Width::Bits32] {
        for patterns in 1..=PATTERNS {
            let packet = read_bytes(patterns, width) - LEAD_BYTES;
            assert_eq!(fast_read_bytes(patterns, width), FAST_LEAD_BYTES + packet);
        }
    }
    assert_eq!(MAX_READ_BYTES, fast_read_bytes(PATTERNS, Width::Bits32));
}

/// Two packets that run together, or a packet that is cut, are not taken for one.
#[test]
fn what_is_longer_or_shorter_than_any_packet_of_a_frame_is_none() {
    let patterns = 256;
    for (width, bytes) in [(Width::Bits32, 4), (Width::Bits24, 3)] {
        let payload = HEADER_BYTES + bytes * usize::from(patterns);
        let (least, most) = (payload + 6, payload + overhead(payload));
        for length in least - 1..=most + 1 {
            let read = [vec![0; 3], vec![0xA5; length - 1], vec![0; 5]].concat();
            let expected = (least..=most).contains(&length).then_some(3..3 + length);
            assert_eq!(packet_in(&read, patterns, width), expected, "{length}, {width:?}");
        }
    }
}

#[test]
fn samples_are_whole_words() {
    for (width, lengths) in [(Width::Bits32, [8, 7, 6]), (Width::Bits24, [6, 7, 8])] {
        let taken = lengths.map(|length| Samples::packed(width, &vec![0; length]).is_ok());
        assert_eq!(taken, [true, false, false], "{width:?}");
    }
}

#[test]
fn words_are_counted_in_pairs_of_bytes() {
    for count in [0, 1, 3] {
        let words = [7; 6];
        let words = Words::from_le_bytes(&words[..2 * count]).unwrap();
        assert_eq!((words.len(), words.is_empty()), (count, count == 0));
    }
    assert!(Words::from_le_bytes(&[7; 3]).is_err());
}

#[test]
fn every_version_from_the_oldest_to_the_newest_is_spoken_and_no_other() {
    let spoken: Vec<u16> = (0..=u16::MAX).filter(|&version| speaks(version)).collect();
    assert_eq!(spoken, (version::MIN..=version::CURRENT).collect::<Vec<u16>>());
}

/// The answer to a greeting begins alike in every version, so a host can say which version a camera of the
/// future speaks.
#[test]
fn the_version_of_a_camera_of_the_future_is_read_from_its_answer_alone() {
    // DeviceMessage::Reply, its id in two bytes, Ok, Answer::Hello, version 300, and fields of that later protocol.
    let future = [0, 0xC8, 0x01, 0, 0, 0xAC, 0x02, 9, 9, 9];
    assert_eq!(hello_of_any_version(&future), Some((200, 300)));
    // Cut short, and an answer to another command.
    assert_eq!(hello_of_any_version(&future[..5]), None);
    // Reply, Ok, and another answer that begins with a number; an event.
    assert_eq!(hello_of_any_version(&[0, 0xC8, 0x01, 0, 4, 0xAC, 0x02, 9, 9, 9]), None);
    assert_eq!(hello_of_any_version(&[1, 0xC8, 0x01, 0, 0, 0xAC, 0x02, 9, 9, 9]), None);
    let mut room = [0; 64];
    let done = DeviceMessage::Reply(Reply { id: 200, outcome: Ok(Answer::Done) });
    let mut packet = encode(&done, &mut room).unwrap().to_vec();
    packet.pop();
    let payload = unseal(&mut packet).unwrap();
    assert_eq!(parse::<DeviceMessage<'_>>(payload), Ok(done));
    assert_eq!(hello_of_any_version(payload), None);
}
