//! Tests with hosts of a later protocol version.

use super::support::*;
use nirspi_wire::packet::encode;
use nirspi_wire::{DeviceMessage, Refusal, State, version};
use std::vec::Vec;

/// A whole packet with this payload.
fn packet_of(payload: &[u8]) -> Vec<u8> {
    // Postcard writes a byte array as its bytes alone, without a length.
    let mut room = [0; 64];
    match *payload {
        [a, b] => encode(&[a, b], &mut room),
        [a, b, c] => encode(&[a, b, c], &mut room),
        _ => panic!("a payload of 2 or 3 bytes"),
    }
    .unwrap()
    .to_vec()
}

/// A request with number `id` of a command that exists in no version.
fn unknown(id: u8) -> Vec<u8> {
    packet_of(&[id, 0x7F])
}

#[test]
fn a_command_of_a_later_version_is_refused_and_nothing_is_damaged() {
    let mut bench = Bench::open();
    bench.receive(&unknown(99));
    bench.poll();
    let refused = Err(Refusal::Unknown);
    assert!(matches!(bench.heard()[..], [DeviceMessage::Reply(reply)]
        if reply.id == 99 && reply.outcome == refused));
    assert_eq!(bench.status().commands_damaged, 0);
    assert_eq!(bench.camera.state(), State::Idle);
}

#[test]
fn before_hello_an_unknown_command_is_told_the_version() {
    let mut bench = Bench::new();
    bench.receive(&unknown(7));
    bench.poll();
    let refused = Err(Refusal::Protocol { device: version::CURRENT });
    assert!(matches!(bench.heard()[..], [DeviceMessage::Reply(reply)]
        if reply.id == 7 && reply.outcome == refused));
}
