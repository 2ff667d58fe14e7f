//! The meter against frames whose light and noise are known.

use super::{APART, Exposure, Meter};
use crate::configure::{self, Setup};
use crate::run::SAMPLE_BYTES;
use crate::tests::fake_fpga::FakeFpga;
use crate::tests::support::SMALL;
use crate::{Limits, Micros};
use nirspi_wire::fpga::Sums;
use nirspi_wire::packet::{MAX_DEVICE_PACKET, seal};
use nirspi_wire::ready::{Head, MAX_SUMMED_SAMPLES};
use nirspi_wire::samples::Width;
use nirspi_wire::{Configuration, FrameFlags, PATTERNS, Signal};
use proptest::prelude::*;
use std::vec::Vec;

/// All patterns, three samples summed in each half.
const FULL: Configuration<'static> = Configuration { patterns: PATTERNS, ..SMALL };

fn setup(configuration: Configuration<'static>) -> Setup {
    configure::check(&configuration, &Limits::SIMULATED).unwrap()
}

/// What the packet of a frame says, and its samples over range.
#[derive(Clone, Copy)]
struct Header {
    sequence: u32,
    flags: FrameFlags,
    over_range: u32,
}

fn header(sequence: u32) -> Header {
    Header { sequence, flags: FrameFlags::default(), over_range: 0 }
}

/// A meter, and the memory in which it keeps a frame.
struct Bench {
    meter: Meter,
    scratch: Vec<u8>,
}

impl Bench {
    fn new(configuration: Configuration<'static>) -> Self {
        let mut meter = Meter::new();
        meter.start(Micros(0), &setup(configuration));
        Self { meter, scratch: std::vec![0; SAMPLE_BYTES] }
    }

    /// A frame comes from the FPGA.
    fn see(&mut self, now: u64, header: &Header, sums: impl IntoIterator<Item = Sums>) {
        let &Header { sequence, flags, over_range } = header;
        let head = Head {
            run: 1,
            sequence,
            device_time_us: now,
            sweeps: 1,
            flags,
            patterns: PATTERNS,
            width: Width::Bits32,
        };
        let (mut payload, mut level) = (head.to_bytes().to_vec(), 0);
        for sums in sums {
            level += sums.positive + sums.negative;
            payload.extend(i32::try_from(sums.difference()).unwrap().to_le_bytes());
        }
        let mut room = [0; MAX_DEVICE_PACKET];
        let packet = seal(&payload, &mut room).unwrap();
        let mut bus = FakeFpga::default();
        bus.deliver(packet.to_vec(), (level, over_range));
        self.meter.look(Micros(now), (packet, PATTERNS), &mut self.scratch, &mut bus);
    }
}

/// The same reading for every pattern.
fn even(level: u64) -> [Sums; PATTERNS as usize] {
    [Sums { positive: level, negative: 0 }; PATTERNS as usize]
}

/// Numbers of a normal distribution, by the sum of twelve uniform ones.
fn normal(state: &mut u64) -> f64 {
    let mut uniform = || {
        *state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

/// Sums of a frame: each pattern's reading is `signal` times a fixed number of unit variance, plus
/// `noise` of its own, in counts of a sample.
struct Light {
    level: f64,
    signal: f64,
    noise: f64,
    /// ADC samples of each sum.
    samples: f64,
    differential: bool,
}

impl Light {
    fn frame(&self, state: &mut u64) -> Vec<Sums> {
        let mut scene = 1;
        let sums = (0..PATTERNS).map(|_| {
            let reading = self.signal * normal(&mut scene) + self.noise * normal(state);
            let sum = |counts: f64| (self.samples * counts).round().max(0.0) as u64;
            if self.differential {
                let (positive, negative) = (self.level + reading / 2.0, self.level - reading / 2.0);
                Sums { positive: sum(positive), negative: sum(negative) }
            } else {
                Sums { positive: sum(self.level + reading), negative: 0 }
            }
        });
        sums.collect()
    }

    fn seen(&self, configuration: Configuration<'static>) -> Signal {
        self.seen_from(7, configuration)
    }

    /// With the noise of this seed.
    fn seen_from(&self, seed: u64, configuration: Configuration<'static>) -> Signal {
        let mut bench = Bench::new(configuration);
        let mut state = seed;
        for sequence in 0..2 {
            bench.see(0, &header(sequence), self.frame(&mut state));
        }
        bench.meter.signal().unwrap()
    }
}

fn near(milli_counts: u32, counts: f64, share: f64) -> bool {
    (f64::from(milli_counts) / 1000.0 - counts).abs() <= share * counts + 0.002
}

proptest! {
    #[test]
    fn light_and_noise_are_told_in_counts_of_a_sample(
        level in 4_000.0_f64..10_000.0, signal in 50.0_f64..400.0, noise in 2.0_f64..20.0,
        differential: bool, sweeps in 1..=MAX_SUMMED_SAMPLES / 3,
    ) {
        let light = Light { level, signal, noise, differential, samples: 3.0 * f64::from(sweeps) };
        let seen = light.seen(Configuration { sweeps, differential, ..FULL });
        prop_assert!(near(seen.mean_milli_counts, level, 0.01), "{seen:?}");
        prop_assert!(near(seen.signal_milli_counts, signal, 0.08), "{seen:?}");
        prop_assert!(near(seen.noise_milli_counts, noise, 0.12), "{seen:?}");
        let decibels = 20.0 * (signal / noise).log10();
        prop_assert!((f64::from(seen.snr_centi_db) / 100.0 - decibels).abs() < 1.5, "{seen:?}");
    }
}

#[test]
fn noise_alone_is_no_signal() {
    let light = Light { level: 8_000.0, signal: 0.0, noise: 5.0, samples: 3.0, differential: true };
    // What the noise does not explain is then as often negative as positive.
    for seed in 0..40 {
        let seen = light.seen_from(seed, FULL);
        assert!(near(seen.noise_milli_counts, 5.0, 0.1), "{seen:?}");
        assert!(seen.snr_centi_db < 0, "{seen:?}");
    }
}

#[test]
fn numbers_are_rounded_to_the_nearest_and_end_at_the_range() {
    let numbers = [0.0, 0.4, 0.6, 41.4, 41.6, -7.0, 1e20];
    assert_eq!(numbers.map(super::rounded), [0, 0, 1, 41, 42, 0, u32::MAX]);
}

#[test]
fn readings_that_do_not_change_have_no_noise() {
    let light =
        Light { level: 8_000.0, signal: 100.0, noise: 0.0, samples: 3.0, differential: true };
    let seen = light.seen(FULL);
    assert_eq!((seen.noise_milli_counts, seen.snr_centi_db), (0, 12_000));
}

#[test]
fn samples_out_of_range_are_a_share_of_all_samples() {
    let mut bench = Bench::new(FULL);
    bench.see(0, &header(0), even(1));
    let clipped = Header { over_range: u32::from(PATTERNS), ..header(1) };
    bench.see(0, &clipped, even(1));
    // One of the ten clocks of each pattern and its complement.
    assert_eq!(bench.meter.signal().unwrap().over_range_ppm, 100_000);
}

#[test]
fn two_frames_are_compared_four_times_a_second() {
    let mut bench = Bench::new(FULL);
    bench.see(0, &header(0), even(300));
    bench.see(2, &header(1), even(300));
    assert_eq!(bench.meter.signal().unwrap().noise_milli_counts, 0);
    bench.see(3, &header(4), even(600));
    bench.see(249_999, &header(5), even(900));
    assert_eq!(bench.meter.signal().unwrap().noise_milli_counts, 0, "the next pair is not due yet");
    bench.see(250_001, &header(6), even(0));
    bench.see(250_002, &header(7), even(300));
    assert!(bench.meter.signal().unwrap().noise_milli_counts > 0);
}

/// Where the FPGA loses frames, no two packets follow each other. A packet takes a millisecond to read, so the meter looks
/// at two in a period all the same.
#[test]
fn where_frames_are_lost_two_near_each_other_are_compared_and_no_pair_is_tried_again_at_once() {
    let mut bench = Bench::new(FULL);
    bench.see(0, &header(0), even(300));
    bench.see(1, &header(APART), even(300));
    assert_eq!(bench.meter.signal().unwrap().noise_milli_counts, 0);
    for far in [APART + 1, 0, u32::MAX] {
        let mut bench = Bench::new(FULL);
        bench.see(0, &header(0), even(0));
        bench.see(1, &header(far), even(300));
        assert_eq!(bench.meter.signal(), None, "{far}");
        assert!(!bench.meter.wants(Micros(249_999)), "{far}");
        assert!(bench.meter.wants(Micros(250_000)), "{far}");
    }
}

#[test]
fn a_depth_map_in_the_memory_of_the_first_frame_is_not_compared() {
    let mut bench = Bench::new(FULL);
    bench.see(0, &header(0), even(300));
    bench.scratch.fill(0x55);
    bench.meter.forget();
    bench.see(1, &header(1), even(300));
    assert_eq!(bench.meter.signal(), None);
    bench.see(2, &header(2), even(300));
    assert_eq!(bench.meter.signal().unwrap().noise_milli_counts, 0);
}

#[test]
fn the_brightest_and_longest_frame_fits() {
    let sweeps = MAX_SUMMED_SAMPLES / 4_000;
    let longest = Configuration { clocks_per_pattern: 4_000, blanked: 0, sweeps, ..FULL };
    let samples = Exposure::of(&setup(longest)).samples;
    let bright = Sums { positive: samples * 16_383, negative: 0 };
    let dark = Sums { positive: 0, negative: samples * 16_383 };
    let mut bench = Bench::new(longest);
    for (sequence, sums) in [(0, [bright, dark]), (1, [dark, bright])] {
        let sums = sums.into_iter().cycle().take(usize::from(PATTERNS));
        bench.see(0, &header(sequence), sums);
    }
    let seen = bench.meter.signal().unwrap();
    // Every reading changes by twice its size: root mean square over the square root of 2.
    assert!(near(seen.noise_milli_counts, 16_383.0 * 2.0_f64.sqrt(), 1e-4), "{seen:?}");
    assert!(near(seen.mean_milli_counts, 16_383.0 / 2.0, 1e-4), "{seen:?}");
}

#[test]
fn a_frame_whose_sums_have_wrapped_is_passed_over() {
    let wrapped = |sequence| Header { flags: FrameFlags::OVERFLOW, ..header(sequence) };
    for flags in [[header(0), wrapped(1)], [wrapped(0), header(1)]] {
        let mut bench = Bench::new(FULL);
        flags.iter().for_each(|header| bench.see(0, header, even(9)));
        assert_eq!(bench.meter.signal(), None);
    }
}
