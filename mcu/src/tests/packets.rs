//! Tests of frames that the FPGA has made into packets: they go to the host as they are, and each is counted once.

use super::host_port::{Device, bus};
use super::support::*;
use crate::Micros;
use nirspi_wire::host_port::READ_PACKET;
use nirspi_wire::ready;
use nirspi_wire::register::{DAMAGED, Register, mode};
use nirspi_wire::samples::Width;
use nirspi_wire::{
    Answer, Command, Configuration, DeviceMessage, Fault, Frame, RunLength, Signal, State,
};
use std::vec::Vec;

fn running() -> Bench {
    Bench::running(RunLength::Continuous)
}

#[test]
fn a_packet_goes_to_the_host_as_the_fpga_made_it() {
    let mut bench = Bench::open();
    bench.fpga.clock = 1_000_000;
    assert_eq!(bench.ask(Command::Configure(SMALL)), Ok(Answer::Done));
    bench.now = Micros((7 << 32) + 50_000);
    // A host that was not silent.
    bench.status();
    assert_eq!(bench.ask(Command::Start(RunLength::Continuous)), Ok(Answer::Done));
    for sequence in 0..3u32 {
        bench.fpga.clock += 125 * 300;
        bench.fpga.make_frame();
        let made = bench.fpga.frame.clone().unwrap();
        bench.after(100);
        assert_eq!(bench.link.packets, [made]);
        let heard = bench.heard();
        let [Frame { run, device_time_us, samples, .. }] = frames(&heard)[..] else { panic!() };
        let time = (7 << 32) + 50_000 + 300 * (1 + u64::from(sequence));
        assert_eq!((run, device_time_us), (1, time));
        let expected: Vec<i64> = (0..4).map(|k| 1000 * i64::from(sequence) + k - 7).collect();
        assert_eq!(samples.iter().collect::<Vec<_>>(), expected);
    }
    assert_eq!(bench.status().frames_sent, 3);
}

#[test]
fn a_frame_that_the_link_has_no_room_for_is_released_unread_and_counted() {
    let mut bench = running();
    bench.link.room = 2;
    for _ in 0..5 {
        bench.frame();
        assert!(bench.fpga.frame.is_none(), "released");
    }
    bench.link.room = usize::MAX;
    bench.frame();
    assert_eq!(sequences(&bench.heard()), [0, 1, 5]);
    assert_eq!(bench.status().frames_dropped, 3);
    bench.ask(Command::Stop).unwrap();
    assert_eq!(bench.heard_events(), [ended(6, 3, 0, 0)]);
}

#[test]
fn a_packet_does_not_overtake_a_reply_that_waits() {
    let mut bench = Bench::open();
    bench.ask(Command::Configure(SMALL)).unwrap();
    // The link refuses the reply twice, then has room.
    bench.link.refusals = 2;
    bench.send(Command::Start(RunLength::Continuous));
    bench.frame();
    bench.frame();
    let heard = bench.heard();
    assert!(matches!(heard[0], DeviceMessage::Reply(_)));
    assert_eq!(sequences(&heard), [1]);
    assert_eq!(bench.status().frames_dropped, 1);
}

#[test]
fn a_release_that_is_lost_on_the_bus_sends_no_packet_twice_and_drops_none_twice() {
    for room in [0, usize::MAX] {
        let mut bench = running();
        bench.fpga.lost_address = Some(Register::Control.address());
        bench.link.room = room;
        bench.frame();
        bench.after(10);
        bench.after(10);
        assert!(bench.fpga.frame.is_some(), "the release is lost");
        bench.fpga.lost_address = None;
        bench.link.room = usize::MAX;
        bench.after(10);
        assert!(bench.fpga.frame.is_none());
        let sent = u32::from(room > 0);
        assert_eq!(frames(&bench.heard()).len() as u32, sent);
        let status = bench.status();
        assert_eq!((status.frames_sent, status.frames_dropped), (sent, 1 - sent));
    }
}

/// What lies between two transfers decides how many packets a second come.
#[test]
fn a_packet_costs_two_reads_and_a_release() {
    let mut bench = running();
    // The signal meter looks at these two.
    bench.frame();
    bench.frame();
    bench.fpga.make_frame();
    // The status of the FPGA is not due yet.
    let before = bench.fpga.accesses;
    bench.after(10);
    assert_eq!(sequences(&bench.heard()), [0, 1, 2]);
    assert_eq!(bench.fpga.accesses - before, 3);
}

#[test]
fn a_frame_that_waits_behind_another_follows_it() {
    let mut bench = running();
    for _ in 0..4 {
        bench.fpga.make_frame();
    }
    // Two wait, two are lost; the fifth finds the room of the first.
    bench.after(10);
    bench.fpga.make_frame();
    for _ in 0..3 {
        bench.after(10);
    }
    assert!(bench.fpga.frame.is_none());
    assert_eq!(sequences(&bench.heard()), [0, 1, 4]);
    bench.fpga.make_frame();
    bench.fpga.make_frame();
    bench.ask(Command::Stop).unwrap();
    let heard = bench.heard();
    assert_eq!(sequences(&heard), [5, 6], "both come after the stop");
    assert_eq!(events(&heard), [ended(7, 0, 2, 0)]);
}

#[test]
fn a_lost_release_sends_no_packet_twice_while_another_waits_behind_it() {
    for room in [0, usize::MAX] {
        let mut bench = running();
        bench.fpga.lost_address = Some(Register::Control.address());
        bench.link.room = room;
        bench.fpga.make_frame();
        bench.after(10);
        bench.fpga.make_frame();
        bench.link.room = usize::MAX;
        bench.after(10);
        assert!(bench.fpga.behind.is_some(), "the release is lost");
        bench.fpga.lost_address = None;
        for _ in 0..3 {
            bench.after(10);
        }
        assert!(bench.fpga.frame.is_none());
        // A frame whose first release was lost before it was read comes in the place of the one behind it.
        let dropped = u32::from(room == 0);
        let expected: &[u32] = if room == 0 { &[0] } else { &[0, 1] };
        assert_eq!(sequences(&bench.heard()), expected);
        let status = bench.status();
        assert_eq!((status.frames_sent, status.frames_dropped), (2 - dropped, dropped));
    }
}

#[test]
fn a_frame_that_is_lost_while_the_counters_are_read_hides_no_other_and_doubles_none() {
    for lost_release in [false, true] {
        for register in [Register::FramesMade, Register::FramesLost] {
            let mut bench = running();
            bench.frame();
            if lost_release {
                bench.fpga.lost_address = Some(Register::Control.address());
                bench.frame();
                bench.fpga.lost_address = None;
            } else {
                bench.fpga.make_frame();
            }
            bench.fpga.make_frame();
            // Two frames wait and none is released yet, so the next is lost.
            bench.fpga.frame_after_read_of = Some(register);
            for _ in 0..3 {
                bench.after(10);
            }
            bench.frame();
            assert_eq!(sequences(&bench.heard()), [0, 1, 2, 4], "{register:?}, {lost_release}");
            bench.ask(Command::Stop).unwrap();
            assert_eq!(bench.heard_events(), [ended(5, 0, 1, 0)]);
        }
    }
}

#[test]
fn damage_inside_a_packet_is_the_hosts_to_see() {
    let mut bench = running();
    bench.fpga.make_frame();
    bench.fpga.frame.as_mut().unwrap()[40] ^= 1;
    let damaged = bench.fpga.frame.clone().unwrap();
    bench.after(10);
    assert!(bench.fpga.frame.is_none());
    assert_eq!(bench.link.packets, [damaged]);
    bench.link.packets.clear();
    let status = bench.status();
    assert_eq!((status.frames_sent, status.fpga_frames_corrupt), (1, 0));
}

#[test]
fn bytes_without_a_packet_count_as_damaged() {
    type Spoil = fn(&mut Vec<u8>);
    let spoils: [Spoil; 4] = [
        // The ADC's clock is lost, and the port gives zeros.
        |frame| frame.fill(0),
        |frame| frame.truncate(20),
        |frame| frame.clear(),
        // Noise in the zeros after the packet.
        |frame| frame.extend([0, 0, 0, 1, 0]),
    ];
    for spoil in spoils {
        let mut bench = running();
        bench.fpga.make_frame();
        spoil(bench.fpga.frame.as_mut().unwrap());
        bench.after(10);
        assert!(bench.fpga.frame.is_none(), "released");
        assert!(bench.link.packets.is_empty());
        assert_eq!(bench.status().fpga_frames_corrupt, 1);
        bench.frame();
        assert_eq!(sequences(&bench.heard()), [1], "the run goes on");
    }
}

/// As of a port that is sampled at the wrong phase.
#[test]
fn a_run_whose_first_packets_all_come_damaged_ends_and_a_whole_one_is_enough() {
    let fault = Fault::FpgaAbsent { identity: DAMAGED };
    let spoils: [fn(&mut Vec<u8>); 2] = [|frame| frame[40] ^= 1, |frame| frame.fill(0)];
    for (spoil, whole) in spoils.into_iter().flat_map(|spoil| [(spoil, None), (spoil, Some(6))]) {
        let mut bench = running();
        for packet in 0..20 {
            bench.fpga.make_frame();
            if Some(packet) != whole {
                spoil(bench.fpga.frame.as_mut().unwrap());
            }
            bench.after(1_000);
            let ended = whole.is_none() && packet >= 8;
            assert!(ended || packet == 7 || bench.camera.state() == State::Running, "{packet}");
            if ended {
                break;
            }
        }
        bench.link.packets.clear();
        assert_eq!(bench.status().fault, Some(fault).filter(|_| whole.is_none()), "{whole:?}");
        assert_eq!(bench.fpga.leds_on(), whole.is_some());
    }
}

#[test]
fn packets_that_cannot_be_found_are_no_reason_for_a_stall_and_silence_is() {
    let mut bench = running();
    bench.frame();
    for _ in 0..10 {
        bench.fpga.make_frame();
        bench.fpga.frame.as_mut().unwrap().fill(0);
        bench.after(200_000);
    }
    assert_eq!(bench.camera.state(), State::Running);
    bench.after(300_000);
    assert_eq!(bench.camera.state(), State::Fault);
}

#[test]
fn a_self_test_and_a_burst_get_no_packets_and_the_run_after_them_does() {
    let mut bench = Bench::open();
    bench.ask(Command::Configure(SMALL)).unwrap();
    bench.fpga.instant = true;
    let Ok(Answer::SelfTest(report)) = bench.ask_slowly(Command::SelfTest) else { panic!() };
    assert_eq!(report.failed, 0, "{report:?}");
    assert!(bench.fpga.sends_packets(), "as it was");
    bench.ask(Command::RawBurst { samples: 8 }).unwrap();
    bench.after(10);
    assert!(matches!(bench.heard()[..], [DeviceMessage::Raw(_)]));
    bench.ask(Command::Start(RunLength::Frames(1))).unwrap();
    bench.poll();
    assert_eq!(frames(&bench.heard()).len(), 1);
}

/// Readings that change from frame to frame.
fn noise(sequence: u32, k: u64) -> u64 {
    (u64::from(sequence) * 7919 + k * 104_729) % 97
}

fn signal(bench: &mut Bench) -> Option<Signal> {
    bench.status().signal
}

/// All samples of a frame together do not fit a register of 32 bits.
#[test]
fn the_level_of_a_long_bright_frame_is_right() {
    let mut bench = Bench::open();
    // Three samples a sweep.
    let sweeps = ready::MAX_SUMMED_SAMPLES / 3;
    bench.ask(Command::Configure(Configuration { sweeps, ..SMALL })).unwrap();
    bench.fpga.light = 1 << 30;
    bench.ask(Command::Start(RunLength::Continuous)).unwrap();
    bench.frame();
    bench.frame();
    // 2^30 in 2^17 samples.
    let level = signal(&mut bench).unwrap().mean_milli_counts;
    assert!(level.abs_diff(1_000 << 13) < 1_000, "{level}");
}

#[test]
fn the_meter_sees_no_packet_that_the_wires_have_damaged() {
    for damaged in 0..3 {
        let mut bench = running();
        bench.fpga.noise_of = noise;
        for number in 0..2 {
            bench.fpga.make_frame();
            if number == damaged {
                bench.fpga.frame.as_mut().unwrap()[44] ^= 0x20;
            }
            bench.after(10);
        }
        bench.link.packets.clear();
        assert_eq!(signal(&mut bench).is_some(), damaged == 2, "{damaged}");
    }
}

#[test]
fn a_packet_goes_straight_into_the_links_room() {
    let mut device = Device::new(bus());
    device.ask(Command::Configure(SMALL));
    device.ask(Command::Start(RunLength::Continuous));
    for _ in 0..3 {
        device.bus.port().fpga.make_frame();
        let made = device.bus.port().fpga.frame.clone().unwrap();
        device.turn(&[]);
        assert!(device.bus.port().fpga.frame.is_none(), "released in the same turn");
        assert_eq!(device.link.packets, [made]);
        device.heard();
    }
    let transfer = (READ_PACKET, ready::fast_read_bytes(4, Width::Bits24));
    assert_eq!(device.bus.port().transfers, [transfer; 3]);
    assert_ne!(device.bus.port().fpga.get(Register::Mode) & mode::PACKETS, 0);
}

#[test]
fn a_packet_that_could_not_be_read_three_times_is_counted() {
    let mut device = Device::new(bus());
    device.ask(Command::Configure(SMALL));
    device.ask(Command::Start(RunLength::Frames(5)));
    let mut heard = Vec::new();
    for number in 0..5 {
        device.bus.port().failures = [0, 2, 3, 0, 1][number];
        device.bus.port().fpga.make_frame();
        for _ in 0..6 {
            device.turn(&[]);
        }
        heard.extend(device.heard());
    }
    assert_eq!(sequences(&heard), [0, 1, 3, 4]);
    assert_eq!(events(&heard), [ended(5, 0, 0, 1)]);
}

#[test]
fn a_link_that_is_full_costs_no_transfer() {
    let mut device = Device::new(bus());
    device.ask(Command::Configure(SMALL));
    device.ask(Command::Start(RunLength::Continuous));
    device.link.room = 0;
    for _ in 0..3 {
        device.bus.port().fpga.make_frame();
        device.turn(&[]);
    }
    assert_eq!(device.bus.port().transfers, []);
    device.link.room = usize::MAX;
    device.ask(Command::Stop);
    assert!(device.bus.port().fpga.frame.is_none());
}
