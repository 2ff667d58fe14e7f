//! Tests of raw bursts.

use crate::bench::{Bench, random_sample};
use crate::oracle::{Setup, setup};
use nirspi_hdl_model::AdcSample;
use nirspi_wire::register::{FaultCode, Register, TEST_SEED, control, mode, status, test_sample};
use proptest::prelude::*;

fn words(bytes: &[u8]) -> Vec<u16> {
    bytes.chunks_exact(2).map(|word| u16::from_le_bytes([word[0], word[1]])).collect()
}

proptest! {
    #[test]
    fn a_burst_is_every_sample_from_the_first_clock_of_the_sweep_on(
        setup in setup(), length in prop_oneof![1u16..300, Just(4096u16)], seed: u64,
    ) {
        let mut bench = Bench::new();
        let setup = Setup { test_source: false, ..setup };
        setup.apply(&mut bench);
        bench.set(Register::RawLength, length.into());
        bench.control(control::START_RAW);
        // A burst repeats the sweep until it is long enough, whatever `Sweeps` and `Frames` say.
        let endless = Setup { frames: u32::MAX, ..setup };
        for t in 0..u64::from(length) {
            prop_assert!(bench.0.running() && !bench.0.raw_ready());
            prop_assert_eq!(bench.0.lines(), endless.lines(t));
            bench.0.tick(random_sample(seed, t));
        }
        prop_assert!(!bench.0.running() && !bench.0.lines().enable);
        prop_assert!(bench.0.raw_ready() && bench.status(status::RAW_READY));
        prop_assert!(!bench.0.frame_ready());
        prop_assert_eq!(bench.get(Register::FramesMade), 0);
        let expected: Vec<u16> = (0..u64::from(length))
            .map(|t| random_sample(seed, t))
            .map(|sample| sample.code | u16::from(sample.over_range) << 15)
            .collect();
        prop_assert_eq!(words(bench.0.raw().unwrap()), expected);
        bench.control(control::RELEASE);
        prop_assert!(!bench.0.raw_ready() && bench.0.raw().is_none());
    }
}

/// A bench with a whole burst of ten samples.
fn with_burst() -> Bench {
    let mut bench = Bench::new();
    bench.set(Register::RawLength, 10);
    bench.control(control::START_RAW);
    bench.ticks(10);
    assert!(bench.0.raw_ready());
    bench
}

#[test]
fn a_burst_stays_until_the_next_start_of_either_kind() {
    for start in [control::START, control::START_RAW] {
        let mut bench = with_burst();
        bench.ticks(1000);
        assert_eq!(words(bench.0.raw().unwrap()), [0; 10]);
        bench.control(start);
        assert!(!bench.0.raw_ready());
    }
}

#[test]
fn a_start_of_a_burst_drops_frames_of_earlier_runs() {
    let mut bench = Bench::new();
    bench.set(Register::Patterns, 1);
    bench.set(Register::Frames, 1);
    bench.start();
    bench.ticks(5);
    assert!(bench.0.frame_ready());
    bench.control(control::START_RAW);
    assert!(!bench.0.frame_ready());
    assert_eq!(bench.get(Register::FramesMade), 0);
}

#[test]
fn a_burst_cut_short_is_not_delivered() {
    let mut bench = Bench::new();
    bench.control(control::START_RAW);
    bench.ticks(4095);
    bench.control(control::STOP);
    bench.ticks(10);
    assert!(!bench.0.raw_ready());
    assert!(bench.0.raw().is_none());
}

#[test]
fn over_range_samples_end_a_burst_even_with_its_last_sample() {
    let mut bench = Bench::new();
    bench.set(Register::RawLength, 10);
    bench.set(Register::OverRangeTrip, 10);
    bench.control(control::START_RAW);
    for _ in 0..10 {
        assert_eq!(bench.fault(), FaultCode::None);
        bench.0.tick(AdcSample { code: 1, over_range: true });
    }
    assert_eq!(bench.fault(), FaultCode::OverRange);
    assert!(!bench.0.raw_ready() && !bench.0.running());
}

#[test]
fn the_test_generator_runs_through_a_burst_from_its_seed() {
    let mut bench = Bench::new();
    bench.set(Register::Mode, mode::TEST_SOURCE);
    for _ in 0..2 {
        bench.control(control::START_RAW);
        for _ in 0..4096 {
            bench.0.tick(AdcSample { code: 0x2AAA, over_range: true });
        }
        let expected: Vec<u16> =
            std::iter::successors(Some(TEST_SEED), |&state| Some(test_sample(state)))
                .take(4096)
                .collect();
        assert_eq!(words(bench.0.raw().unwrap()), expected);
    }
}
