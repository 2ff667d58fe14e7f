//! Tests that a packet port whose packets come damaged is named before the first run, and that nothing else is.

use super::support::*;
use crate::training::Port;
use crate::{BoardInfo, Camera, Limits, fpga};
use nirspi_wire::register::{Register, mode};
use nirspi_wire::{
    Answer, Capabilities, Command, EventKind, Fault, Refusal, RunLength, State, Version, ready,
};
use std::collections::BTreeSet;
use std::vec::Vec;

/// A bench after power-up, not polled yet.
fn unpolled() -> Bench {
    let mut bench = Bench::new();
    let info = BoardInfo::new("bench", "0001", Version(1, 2, 3)).can(Capabilities::LOAD_GATEWARE);
    bench.camera = Camera::new(info, Limits::SIMULATED);
    bench.fpga.reset();
    bench
}

fn port(bench: &Bench) -> Port {
    bench.camera.machine().port
}

/// The packet of the training, as the FPGA has it.
fn packet_of(bench: &mut Bench) -> Vec<u8> {
    bench.poll();
    bench.fpga.frame.clone().expect("the training has begun")
}

#[test]
fn the_packet_is_asked_for_without_light_before_any_command_is_taken() {
    let mut bench = unpolled();
    bench.poll();
    let bits = bench.fpga.get(Register::Mode);
    let asked = mode::UNLIT | mode::PACKETS | mode::TEST_SOURCE;
    assert_eq!(bits & (asked | mode::PARALLEL), asked);
    assert_eq!(bench.camera.state(), State::Idle);
    assert!(!bench.fpga.leds_on() && !bench.camera.may_light());
    assert_eq!(bench.receive(&packet(1, Command::Status)), 0);
    bench.poll();
    assert_eq!(port(&bench), Port::Sound);
    assert!(!bench.fpga.running && bench.fpga.frame.is_none());
    assert_ne!(bench.receive(&packet(1, Command::Status)), 0);
    let before = bench.fpga.accesses;
    bench.after(50_000);
    assert_eq!(bench.fpga.accesses, before, "once is enough");
}

#[test]
fn nothing_of_the_packet_reaches_the_host_and_the_settings_stay() {
    let mut bench = unpolled();
    // The interlock is open, so no packet was compared before the configuration.
    bench.inputs.interlock_closed = false;
    bench.fpga.interlock_closed = false;
    bench.poll();
    assert!(matches!(port(&bench), Port::Unknown(_)));
    bench.inputs.interlock_closed = true;
    bench.fpga.interlock_closed = true;
    let hello = Command::Hello { protocol: nirspi_wire::version::CURRENT };
    assert!(matches!(bench.ask(hello), Ok(Answer::Hello(_))));
    bench.heard();
    assert_eq!(bench.ask(Command::Configure(SMALL)), Ok(Answer::Done));
    bench.poll();
    assert_eq!(bench.receive(&packet(7, Command::Start(RunLength::Continuous))), 0, "it waits");
    assert_eq!(bench.camera.state(), State::Configured);
    bench.poll();
    assert_eq!(port(&bench), Port::Sound);
    assert_eq!(bench.heard(), []);
    assert_eq!(bench.fpga.get(Register::Patterns), 4);
    assert_eq!(bench.ask(Command::Start(RunLength::Continuous)), Ok(Answer::Done));
    assert_eq!(bench.status().run, 1, "the packet was of no run");
    bench.frame();
    assert_eq!(sequences(&bench.heard()), [0]);
}

/// Every bit of the packet counts, and each of three attempts.
#[test]
fn a_packet_that_comes_damaged_each_time_is_named_before_the_first_run() {
    let mut whole = unpolled();
    let length = packet_of(&mut whole).len();
    for at in (0..length - 1).step_by(7) {
        let mut bench = whole.clone();
        if let Some(frame) = &mut bench.fpga.frame {
            frame[at] ^= 1 << (at % 8);
        }
        bench.poll();
        bench.poll();
        assert_eq!(bench.camera.state(), State::Idle, "two attempts, byte {at}");
        bench.poll();
        assert_eq!(bench.camera.state(), State::Fault, "byte {at}");
        assert_eq!(bench.camera.machine().fault, Some(fpga::UNREADABLE));
        assert!(!bench.fpga.running);
    }
}

/// A packet of other words, whose checksum is right: a line that both ends take for another, for example.
#[test]
fn the_words_of_the_packet_count_as_its_checksum_does() {
    let mut bench = unpolled();
    packet_of(&mut bench);
    bench.fpga.registers.insert(Register::Latency.address(), 4);
    (bench.fpga.frame, bench.fpga.made, bench.fpga.running) = (None, 0, true);
    bench.fpga.make_frame();
    for _ in 0..3 {
        bench.poll();
    }
    assert_eq!(bench.camera.machine().fault, Some(fpga::UNREADABLE));
}

#[test]
fn one_damaged_attempt_is_no_wrong_phase() {
    let mut bench = unpolled();
    let packet = packet_of(&mut bench);
    for _ in 0..2 {
        bench.fpga.frame = Some(packet.iter().map(|byte| byte ^ 4).collect());
        bench.poll();
    }
    bench.fpga.frame = Some(packet);
    bench.poll();
    assert_eq!((port(&bench), bench.camera.state()), (Port::Sound, State::Idle));
}

/// A line of the port that is stuck, or joined to its neighbour.
#[test]
fn each_line_of_the_port_is_needed() {
    let mut whole = unpolled();
    let packet = packet_of(&mut whole);
    let line = |from: u32, to: u32| {
        move |byte: u8| -> u8 {
            [0, 4].iter().fold(byte, |byte, &half| {
                let level = byte >> (half + from) & 1;
                byte & !(1 << (half + to)) | level << (half + to)
            })
        }
    };
    let mut wrong: Vec<Vec<u8>> = Vec::new();
    for bit in 0..4u32 {
        wrong.push(packet.iter().map(|byte| byte | 0x11 << bit).collect());
        wrong.push(packet.iter().map(|byte| byte & !(0x11 << bit)).collect());
        wrong.push(packet.iter().map(|&byte| line((bit + 1) % 4, bit)(byte)).collect());
    }
    // Sampled a period late: each byte has a half of its neighbour.
    let late =
        packet.iter().scan(0, |last, &byte| Some(std::mem::replace(last, byte) << 4 | byte >> 4));
    wrong.push(late.collect());
    for bytes in wrong {
        let mut bench = whole.clone();
        bench.fpga.frame = Some(bytes);
        for _ in 0..3 {
            bench.poll();
        }
        assert_eq!(bench.camera.state(), State::Fault);
    }
}

#[test]
fn the_packet_has_every_change_of_the_four_lines() {
    let packet = packet_of(&mut unpolled());
    let halves: Vec<u8> = packet.iter().flat_map(|byte| [byte >> 4, byte & 15]).collect();
    let changes: BTreeSet<_> = halves.windows(2).map(|pair| (pair[0], pair[1])).collect();
    assert_eq!(changes.len(), 256);
    assert!(packet.len() <= ready::packet_bytes(1024, nirspi_wire::samples::Width::Bits24));
}

#[test]
fn a_configuration_acknowledges_it_and_the_next_packet_names_it_again_before_a_start() {
    let mut bench = unpolled();
    packet_of(&mut bench);
    let damage = |bench: &mut Bench| {
        if let Some(frame) = &mut bench.fpga.frame {
            frame[100] ^= 1;
        }
        for _ in 0..3 {
            bench.poll();
        }
    };
    damage(&mut bench);
    let hello = Command::Hello { protocol: nirspi_wire::version::CURRENT };
    assert!(matches!(bench.ask(hello), Ok(Answer::Hello(_))));
    assert_eq!(bench.ask(Command::Configure(SMALL)), Ok(Answer::Done));
    bench.poll();
    damage(&mut bench);
    assert_eq!(bench.heard_events(), [EventKind::Fault(fpga::UNREADABLE)]);
    let refused = bench.ask(Command::Start(RunLength::Continuous));
    assert_eq!(refused, Err(Refusal::Fault(fpga::UNREADABLE)));
}

#[test]
fn a_line_that_does_not_tell_of_the_frame_is_named() {
    let mut bench = unpolled();
    packet_of(&mut bench);
    bench.fpga.ready_line_broken = true;
    bench.after(100_001);
    assert_eq!(bench.camera.machine().fault, Some(Fault::FpgaStalled));
}

#[test]
fn a_full_link_and_an_fpga_that_was_reset_put_it_off() {
    let mut full = unpolled();
    full.link.room = 0;
    packet_of(&mut full);
    let mut reset = unpolled();
    packet_of(&mut reset);
    reset.fpga.reset();
    for mut bench in [full, reset] {
        bench.after(100_001);
        assert!(matches!(port(&bench), Port::Unknown(_)));
        assert_eq!((bench.camera.state(), bench.camera.machine().fault), (State::Idle, None));
        bench.link.room = usize::MAX;
        bench.after(100_000);
        bench.poll();
        assert_eq!(port(&bench), Port::Sound);
    }
}

/// New gateware, and an FPGA that was away, have a port that nobody has tried.
#[test]
fn it_is_asked_for_again_after_gateware_and_after_an_absent_fpga() {
    let mut bench = Bench::configured();
    assert_eq!(port(&bench), Port::Sound);
    bench.fpga.dead = true;
    bench.after(100_001);
    assert_eq!(bench.camera.state(), State::Fault);
    bench.fpga.dead = false;
    assert!(matches!(port(&bench), Port::Unknown(_)));
    assert_eq!(bench.ask(Command::Configure(SMALL)), Ok(Answer::Done));
    bench.poll();
    bench.poll();
    assert_eq!(port(&bench), Port::Sound);
    let chunk = nirspi_wire::GatewareChunk { offset: 0, total: 1, crc: 0, data: &[] };
    bench.ask(Command::LoadGateware(chunk)).unwrap();
    assert!(matches!(port(&bench), Port::Unknown(_)));
}
