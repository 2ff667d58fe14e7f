//! Tests of frames, raw bursts and depth maps on their way to the host.

use super::support::*;
use crate::{Micros, RAW_PIECE_SAMPLES};
use nirspi_wire::ready::MAX_SUMMED_SAMPLES;
use nirspi_wire::register::Register;
use nirspi_wire::{
    Answer, Command, Configuration, DeviceMessage, EventKind, Fault, FrameFlags, Refusal,
    RunLength, State,
};
use std::vec::Vec;

#[test]
fn a_frame_carries_the_differences_of_its_sums() {
    let mut bench = Bench::configured();
    // The lower 32 bits of the clock run over every 34 s.
    bench.fpga.clock = (3 << 32) + 1_000_000;
    bench.now = Micros(50_000);
    assert_eq!(bench.ask(Command::Start(RunLength::Continuous)), Ok(Answer::Done));
    bench.frame();
    bench.fpga.clock += 125 * 300;
    bench.frame();
    let heard = bench.heard();
    let frames = frames(&heard);
    assert_eq!(frames.len(), 2);
    let frame = frames[1];
    assert_eq!((frame.run, frame.sequence, frame.sweeps), (1, 1, 1));
    assert_eq!(frame.flags, FrameFlags::DIFFERENTIAL);
    assert_eq!(frame.samples.iter().collect::<Vec<_>>(), [993, 994, 995, 996]);
    assert_eq!(frames[0].device_time_us, 50_000);
    assert_eq!(frame.device_time_us, 50_300);
}

#[test]
fn the_longest_frame_fits_its_packet() {
    let mut bench = Bench::open();
    let sweeps = MAX_SUMMED_SAMPLES / 3;
    let whole = Configuration { patterns: 1024, sweeps, ..SMALL };
    assert_eq!(bench.ask(Command::Configure(whole)), Ok(Answer::Done));
    bench.now = Micros(u64::MAX / 2);
    bench.after(0);
    bench.fpga.clock = 1 << 62;
    assert_eq!(bench.ask(Command::Start(RunLength::Continuous)), Ok(Answer::Done));
    bench.fpga.made = i32::MAX as u32 - 1;
    bench.frame();
    let heard = bench.heard();
    assert_eq!(frames(&heard)[0].samples.len(), 1024);
}

#[test]
fn a_run_of_some_frames_sends_each_and_ends_by_itself() {
    let mut bench = Bench::running(RunLength::Frames(3));
    for _ in 0..3 {
        bench.frame();
    }
    let heard = bench.heard();
    assert_eq!(frames(&heard).iter().map(|f| f.sequence).collect::<Vec<_>>(), [0, 1, 2]);
    assert!(matches!(heard.last(), Some(DeviceMessage::Event(e)) if e.kind == ended(3, 0, 0, 0)));
    assert_eq!(bench.camera.state(), State::Configured);
}

#[test]
fn a_run_that_is_over_before_its_status_is_read_still_delivers() {
    let mut bench = Bench::configured();
    bench.fpga.instant = true;
    assert_eq!(bench.ask(Command::Start(RunLength::Frames(1))), Ok(Answer::Done));
    bench.poll();
    let heard = bench.heard();
    assert_eq!(frames(&heard).len(), 1);
    assert_eq!(events(&heard), [ended(1, 0, 0, 0)]);
}

#[test]
fn a_run_whose_last_frame_is_lost_in_the_fpga_ends_all_the_same() {
    let mut bench = Bench::running(RunLength::Frames(3));
    for _ in 0..3 {
        bench.fpga.make_frame();
    }
    bench.after(1_000);
    bench.after(1_000);
    let heard = bench.heard();
    assert_eq!(frames(&heard).len(), 2);
    assert_eq!(events(&heard), [ended(3, 0, 1, 0)]);
}

#[test]
fn a_loss_in_the_fpga_is_counted_and_flagged() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.fpga.make_frame();
    bench.fpga.make_frame();
    bench.frame();
    bench.after(100);
    bench.frame();
    let heard = bench.heard();
    assert_eq!(sequences(&heard), [0, 1, 3]);
    assert!(frames(&heard)[2].flags.contains(FrameFlags::AFTER_LOSS));
    assert_eq!(bench.status().fpga_frames_lost, 1);
}

#[test]
fn an_intact_frame_of_another_length_is_damaged_too() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.fpga.registers.insert(Register::Patterns.address(), 900);
    bench.frame();
    assert_eq!(bench.status().fpga_frames_corrupt, 1);
}

#[test]
fn a_frame_still_under_way_is_asked_for_again() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.fpga.transfer_polls = 3;
    bench.frame();
    assert_eq!(frames(&bench.heard()).len(), 0);
    for _ in 0..3 {
        bench.after(10);
    }
    assert_eq!(frames(&bench.heard()).len(), 1);
}

#[test]
fn a_run_whose_stop_was_lost_on_the_bus_ends_with_the_frames_it_made_since() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.fpga.lost_address = Some(Register::Control.address());
    bench.send(Command::Stop);
    bench.fpga.make_frame();
    bench.fpga.lost_address = None;
    bench.after(10);
    assert_eq!(bench.heard_events(), [ended(1, 0, 0, 0)]);
}

#[test]
fn stop_answers_after_the_last_frame_and_before_the_runs_end() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.fpga.transfer_polls = 2;
    bench.fpga.make_frame();
    let id = bench.send(Command::Stop);
    assert!(!bench.fpga.leds_on());
    assert_eq!(bench.receive(&packet(99, Command::Status)), 0, "one command after the other");
    for _ in 0..5 {
        bench.after(10);
    }
    let heard = bench.heard();
    assert!(matches!(heard[0], DeviceMessage::Frame(_)));
    assert!(matches!(heard[1], DeviceMessage::Reply(reply) if reply.id == id));
    assert_eq!(events(&heard), [ended(1, 0, 0, 0)]);
    assert_eq!(heard.len(), 3);
    assert_eq!(bench.camera.state(), State::Configured);
}

#[test]
fn a_run_waits_for_a_frame_that_is_made_and_not_ready_yet() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.fpga.make_frame();
    let frame = bench.fpga.frame.take();
    bench.send(Command::Stop);
    bench.after(10);
    assert!(bench.heard().is_empty());
    bench.fpga.frame = frame;
    bench.after(10);
    let heard = bench.heard();
    assert_eq!(frames(&heard).len(), 1);
    assert_eq!(events(&heard), [ended(1, 0, 0, 0)]);
}

#[test]
fn a_last_frame_that_never_comes_counts_as_damaged() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.fpga.transfer_polls = u32::MAX;
    bench.fpga.make_frame();
    bench.send(Command::Stop);
    bench.after(100_000);
    assert!(bench.heard_events().is_empty());
    bench.after(1);
    assert_eq!(bench.heard_events(), [ended(1, 0, 0, 1)]);
}

#[test]
fn runs_are_numbered_and_counters_start_over() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.frame();
    bench.ask(Command::Stop).unwrap();
    bench.ask(Command::Start(RunLength::Continuous)).unwrap();
    bench.frame();
    bench.frame();
    bench.ask(Command::Stop).unwrap();
    let heard = bench.heard();
    assert_eq!(frames(&heard).iter().map(|f| f.run).collect::<Vec<_>>(), [1, 2, 2]);
    let [
        EventKind::RunEnded { run: 1, frames_made: 1, .. },
        EventKind::RunEnded { run: 2, frames_made: 2, .. },
    ] = events(&heard)[..]
    else {
        panic!("{heard:?}")
    };
}

#[test]
fn the_count_of_frames_goes_on_where_it_wraps() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.frame();
    bench.fpga.made = 1 << 31;
    bench.frame();
    bench.fpga.made = u32::MAX;
    bench.frame();
    bench.frame();
    assert_eq!(bench.status().frames_made, 1);
}

#[test]
fn a_raw_burst_comes_in_pieces_and_whole() {
    let mut bench = Bench::configured();
    let samples = 2 * RAW_PIECE_SAMPLES + 5;
    assert_eq!(bench.ask(Command::RawBurst { samples }), Ok(Answer::Done));
    let mut received = Vec::new();
    for _ in 0..6 {
        bench.after(10);
        for message in bench.heard() {
            let DeviceMessage::Raw(raw) = message else { panic!("{message:?}") };
            assert_eq!((raw.total, raw.first_clock), (samples, received.len() as u16));
            assert!(raw.samples.len() <= usize::from(RAW_PIECE_SAMPLES));
            received.extend(raw.samples.iter());
        }
    }
    assert_eq!(received, (0..samples).collect::<Vec<u16>>());
    assert_eq!(bench.camera.state(), State::Configured);
}

#[test]
fn pieces_of_a_burst_wait_for_room_and_are_given_up_in_the_end() {
    let mut bench = Bench::configured();
    bench.ask(Command::RawBurst { samples: 4096 }).unwrap();
    bench.link.room = 1;
    for _ in 0..49 {
        bench.after(10_000);
    }
    bench.link.room = 1;
    bench.after(10_000);
    bench.after(500_000);
    assert_eq!(bench.camera.state(), State::Running);
    bench.after(1);
    assert_eq!(bench.camera.state(), State::Configured);
    bench.link.room = usize::MAX;
    bench.poll();
    let heard = bench.heard();
    assert_eq!(heard.len(), 3);
    assert_eq!(events(&heard), [EventKind::RawDropped]);
}

#[test]
fn a_piece_does_not_overtake_a_reply_that_waits() {
    let mut bench = Bench::configured();
    bench.link.refusals = 2;
    bench.send(Command::RawBurst { samples: 8 });
    bench.poll();
    bench.poll();
    let heard = bench.heard();
    assert!(matches!(heard[..], [DeviceMessage::Reply(_), DeviceMessage::Raw(_)]), "{heard:?}");
}

#[test]
fn a_burst_of_no_or_too_many_samples_is_refused() {
    let mut bench = Bench::configured();
    for samples in [0, 4097, u16::MAX] {
        let refused = bench.ask(Command::RawBurst { samples });
        assert_eq!(refused, Err(Refusal::RawLength { max: 4096 }));
    }
}

#[test]
fn a_burst_that_the_fpga_does_not_record_is_a_stall() {
    let mut bench = Bench::configured();
    bench.ask(Command::RawBurst { samples: 8 }).unwrap();
    bench.fpga.raw = None;
    bench.after(100_001);
    assert_eq!(bench.heard_events(), [EventKind::Fault(Fault::FpgaStalled)]);
}

#[test]
fn stop_ends_a_burst_and_a_fault_does_too() {
    let mut bench = Bench::configured();
    bench.ask(Command::RawBurst { samples: 4096 }).unwrap();
    assert_eq!(bench.ask(Command::Stop), Ok(Answer::Done));
    assert_eq!(bench.camera.state(), State::Configured);
    bench.ask(Command::RawBurst { samples: 4096 }).unwrap();
    bench.inputs.interlock_closed = false;
    bench.poll();
    assert_eq!(bench.heard_events(), [EventKind::Fault(Fault::Interlock)]);
    assert_eq!(bench.camera.state(), State::Fault);
}

#[test]
fn a_depth_map_goes_to_a_host_that_listens_and_has_room() {
    let map = [100, 200, 300, 0];
    let mut bench = Bench::new();
    bench.depth(2, &map);
    assert!(bench.link.packets.is_empty(), "no host");
    let mut bench = Bench::open();
    bench.depth(3, &map);
    bench.link.room = 0;
    bench.depth(2, &map);
    assert!(bench.link.packets.is_empty(), "wrong size, and no room");
    bench.link.room = usize::MAX;
    bench.depth(2, &map);
    let heard = bench.heard();
    let [DeviceMessage::Depth(depth)] = heard[..] else { panic!("{heard:?}") };
    assert_eq!(depth.distances_mm.iter().collect::<Vec<_>>(), map);
    assert_eq!(depth.device_time_us, bench.now.0);
}
