//! How long packets are: buffers and transfers are laid out by these numbers.

use nirspi_wire::packet::{hello_of_any_version, overhead, parse, seal, unseal};
use nirspi_wire::ready::{HEADER_BYTES, LEAD_BYTES, read_bytes};
use nirspi_wire::{Answer, DeviceMessage, PATTERNS, Reply, encode};

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
    for patterns in 1..=PATTERNS {
        let payload = vec![0xA5; HEADER_BYTES + 4 * usize::from(patterns)];
        let packet = seal(&payload, &mut room).unwrap().len();
        let most = read_bytes(patterns);
        assert!(
            (most - 1..=most).contains(&(LEAD_BYTES + packet)),
            "{patterns}: {packet} of {most}"
        );
    }
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
