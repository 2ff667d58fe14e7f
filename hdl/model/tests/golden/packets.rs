//! Tests of frames that are sent as packets.

use crate::bench::{Bench, random_sample};
use crate::oracle::setup;
use nirspi_wire::fpga::Sums;
use nirspi_wire::register::{Register, control, mode};
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
            let samples = match narrow {
                true => Samples::pack_narrow(differences, &mut words).unwrap(),
                false => Samples::pack(differences, &mut words).unwrap(),
            };
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
