//! Tests of frames that are sent as packets, by the host port and by the parallel port.

use crate::bench::{Bench, random_sample};
use crate::oracle::setup;
use nirspi_wire::fpga::Sums;
use nirspi_wire::register::{Register, control, mode, status};
use nirspi_wire::samples::Width;
use nirspi_wire::{DeviceMessage, Frame, Samples, open};
use proptest::prelude::*;

/// Says what packets carry beside their frames.
fn stamp(bench: &mut Bench, run: u32, time_us: u64) {
    bench.set(Register::Run, run);
    bench.set(Register::TimeLow, time_us as u32);
    bench.set(Register::TimeHigh, (time_us >> 32) as u32);
}

proptest! {
    #[test]
    fn a_run_of_packets_has_the_frames_of_the_oracle_and_says_what_stood_at_its_start(
        setup in setup(), seed: u64, run: u32, time_us in 0..1u64 << 63,
        rest in 0..400u64, between in 0..400u64, later: bool, narrow: bool,
    ) {
        let mut bench = Bench::new();
        setup.apply(&mut bench);
        let bits = bench.get(Register::Mode);
        let more = if narrow { mode::PACKETS | mode::NARROW } else { mode::PACKETS };
        bench.set(Register::Mode, bits | more);
        bench.ticks(rest);
        prop_assert_eq!(u64::from(bench.get(Register::ClockLow)), rest);
        bench.ticks(between);
        stamp(&mut bench, run, time_us);
        bench.start();
        if later {
            stamp(&mut bench, !run, !time_us);
            bench.set(Register::Mode, bits ^ mode::NARROW);
            bench.get(Register::ClockLow);
        }
        let samples = |t| random_sample(seed, t);
        let mut t = 0;
        for f in 0..setup.frames {
            while t < setup.complete_after(f) {
                bench.0.tick(samples(t));
                t += 1;
            }
            let expected = setup.frame(f, rest + between, &samples);
            let mut bytes = bench.0.frame().expect("no frame").to_vec();
            let total: u64 = expected.sums.iter().map(|sums| sums.positive + sums.negative).sum();
            let measures = |bench: &mut Bench| {
                [Register::SumLow, Register::SumHigh, Register::OverRange].map(|r| bench.get(r))
            };
            let over_range = expected.header.over_range;
            prop_assert_eq!(measures(&mut bench), [total as u32, (total >> 32) as u32, over_range]);
            bench.control(control::RELEASE);
            prop_assert_eq!(measures(&mut bench), [0; 3], "released");
            prop_assert_eq!(bytes.pop(), Some(0), "no delimiter");
            let differences = expected.sums.iter().map(Sums::difference);
            let mut words = vec![0; 4 * expected.sums.len()];
            let header = expected.header;
            let width = if narrow { Width::Bits24 } else { Width::Bits32 };
            let samples = Samples::pack(differences, width, &mut words).unwrap();
            let frame = Frame {
                run: run as u16,
                sequence: f,
                device_time_us: time_us + (header.clock - rest) / 125,
                sweeps: header.sweeps,
                flags: header.flags,
                samples,
            };
            let opened: DeviceMessage<'_> = open(&mut bytes).expect("damaged packet");
            prop_assert_eq!(opened, DeviceMessage::Frame(frame));
        }
    }
}

/// A bench in which a run has made so many frames of 10 clocks each, which leave by the parallel port.
fn by_parallel_port(frames: u64) -> Bench {
    let mut bench = Bench::new();
    bench.set(Register::Mode, mode::PACKETS | mode::PARALLEL);
    for (register, value) in [(Register::Patterns, 5), (Register::Dwell, 2), (Register::Blank, 0)] {
        bench.set(register, value);
    }
    bench.start();
    bench.ticks(10 * frames);
    bench
}

/// Number in its run of the frame that the parallel port sends next.
fn next_number(bench: &mut Bench) -> Option<u32> {
    let sent = bench.0.outgoing()?;
    let (before, packet) = sent.split_first().unwrap();
    let (packet, behind) = packet.split_at(packet.len() - 3);
    assert_eq!((*before, behind), (0, &[0; 3][..]));
    let (delimiter, packet) = packet.split_last().unwrap();
    assert_eq!(*delimiter, 0);
    let mut packet = packet.to_vec();
    let opened: DeviceMessage<'_> = open(&mut packet).expect("damaged packet");
    let DeviceMessage::Frame(frame) = opened else { panic!("{opened:?}") };
    Some(frame.sequence)
}

#[test]
fn the_parallel_port_has_the_frames_and_the_host_port_finds_none() {
    let mut bench = by_parallel_port(2);
    assert!(!bench.0.frame_ready() && bench.0.frame().is_none());
    bench.control(control::RELEASE);
    assert_eq!(next_number(&mut bench), Some(0), "the host gives nothing back");
    bench.0.sent();
    assert_eq!(next_number(&mut bench), Some(1));
    bench.0.sent();
    assert_eq!(next_number(&mut bench), None);
    bench.control(control::STOP);
    bench.set(Register::Mode, mode::PACKETS);
    bench.start();
    bench.ticks(10);
    assert!(bench.0.frame_ready() && bench.0.outgoing().is_none(), "the next run's are the host's");
    bench.0.sent();
    assert!(bench.0.frame().is_some(), "the port gives nothing of them back");
}

#[test]
fn frames_that_the_parallel_port_cannot_send_are_lost_whole_and_counted() {
    let mut bench = by_parallel_port(5);
    let counts = [Register::FramesMade, Register::FramesLost].map(|register| bench.get(register));
    assert_eq!(counts, [5, 3]);
    assert_eq!(next_number(&mut bench), Some(0));
    bench.0.sent();
    assert_eq!(next_number(&mut bench), Some(1));
    bench.control(control::STOP | control::START);
    assert_eq!(next_number(&mut bench), None, "a start forgets what waits");
}

#[test]
fn a_start_with_the_parallel_port_and_without_packets_is_refused() {
    let mut bench = Bench::new();
    bench.set(Register::Mode, mode::PARALLEL);
    bench.control(control::START);
    assert!(!bench.0.running() && bench.status(status::CONFIG_ERROR));
}
