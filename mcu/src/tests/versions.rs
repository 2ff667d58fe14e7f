//! Tests with hosts of older and newer protocol versions.

use super::support::*;
use nirspi_wire::packet::{encode, unseal};
use nirspi_wire::register::Register;
use nirspi_wire::{
    Answer, Capabilities, Command, EventKind, Refusal, RunLength, State, Tail, version,
};
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

/// The payloads of the packets that a camera has sent, without COBS, CRC and delimiter.
fn payloads(bench: &mut Bench) -> Vec<Vec<u8>> {
    let payload = |mut packet: Vec<u8>| {
        packet.pop();
        unseal(&mut packet).unwrap().to_vec()
    };
    bench.link.packets.drain(..).map(payload).collect()
}

#[test]
fn a_host_of_version_1_gets_the_bytes_of_version_1() {
    let mut bench = Bench::new();
    // The gateware of that time.
    bench.fpga.registers.insert(Register::Version.address(), 0x0000_0100);
    // Id 1, Hello, protocol 1: the bytes that a host of version 1 sends.
    bench.receive(&packet_of(&[1, 0, 1]));
    bench.poll();
    let greeting = payloads(&mut bench).concat();
    // Reply, id 1, Ok, Hello, protocol 1, versions 1.2.3 and 0.1.0, names, side, ADC, wavelength; no tail.
    let names = [&[5][..], b"bench", &[4], b"0001"].concat();
    let numbers = [32, 0xC0, 0xB2, 0xCD, 0x3B, 14, 0x8E, 0x0C];
    let expected = [&[0, 1, 0, 0, 1, 1, 2, 3, 0, 1, 0][..], &names, &numbers].concat();
    assert_eq!(greeting, expected);
    // The session is open: Status, number 2.
    bench.receive(&packet_of(&[2, 4]));
    bench.poll();
    assert!(payloads(&mut bench).concat().starts_with(&[0, 2, 0, 2]));
}

#[test]
fn a_host_of_this_version_hears_what_the_camera_can_do() {
    let mut bench = Bench::new();
    let answer = bench.ask(Command::Hello { protocol: version::CURRENT });
    let Ok(Answer::Hello(identity)) = answer else { panic!("{answer:?}") };
    assert_eq!(identity.protocol, version::CURRENT);
    let expected = Capabilities::LOAD_GATEWARE.with(Capabilities::NARROW_SAMPLES);
    assert_eq!(identity.capabilities, Tail(Some(expected)));
}

#[test]
fn a_command_of_a_later_version_is_refused_and_nothing_is_damaged() {
    // Version 2 is the first that has the refusal.
    for protocol in 2..=version::CURRENT {
        let mut bench = Bench::new();
        bench.ask(Command::Hello { protocol }).unwrap();
        bench.receive(&unknown(99));
        bench.poll();
        let refused = Err(Refusal::Unknown);
        assert!(matches!(bench.heard()[..], [nirspi_wire::DeviceMessage::Reply(reply)]
            if reply.id == 99 && reply.outcome == refused));
        assert_eq!(bench.status().commands_damaged, 0);
        assert_eq!(bench.camera.state(), State::Idle);
    }
}

#[test]
fn in_a_session_of_version_1_an_unknown_command_is_damage_as_ever() {
    let mut bench = Bench::new();
    bench.ask(Command::Hello { protocol: 1 }).unwrap();
    bench.receive(&unknown(99));
    bench.poll();
    assert_eq!(bench.heard_events(), [EventKind::CommandDamaged]);
    assert_eq!(bench.status().commands_damaged, 1);
}

#[test]
fn before_hello_an_unknown_command_is_told_the_version() {
    let mut bench = Bench::new();
    bench.receive(&unknown(7));
    bench.poll();
    let refused = Err(Refusal::Protocol { device: version::CURRENT });
    assert!(matches!(bench.heard()[..], [nirspi_wire::DeviceMessage::Reply(reply)]
        if reply.id == 7 && reply.outcome == refused));
}

#[test]
fn a_host_greets_again_with_the_cameras_version() {
    let mut bench = Bench::new();
    let newer = bench.ask(Command::Hello { protocol: version::CURRENT + 1 });
    assert!(matches!(newer, Ok(Answer::Hello(identity)) if identity.protocol == version::CURRENT));
    assert!(bench.ask(Command::Hello { protocol: version::CURRENT }).is_ok());
    bench.status();
}

#[test]
fn the_signal_is_in_the_status_of_version_2_alone() {
    for (protocol, has_signal) in [(1, false), (2, true)] {
        let mut bench = Bench::new();
        bench.ask(Command::Hello { protocol }).unwrap();
        assert_eq!(bench.status().signal, Tail(has_signal.then_some(None)), "no run yet");
        bench.ask(Command::Configure(SMALL)).unwrap();
        bench.ask(Command::Start(RunLength::Frames(2))).unwrap();
        bench.frame();
        bench.frame();
        let Tail(signal) = bench.status().signal;
        assert_eq!(signal.map(|signal| signal.is_some()), has_signal.then_some(true));
    }
}
