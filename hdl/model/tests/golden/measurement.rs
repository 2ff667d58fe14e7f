//! Tests of lines, sums and headers of undisturbed runs.

use crate::bench::{Bench, random_sample};
use crate::oracle::{Order, Setup, setup};
use nirspi_hdl_model::AdcSample;
use nirspi_wire::register::{Register, status};
use proptest::prelude::*;
use std::collections::VecDeque;

proptest! {
    #[test]
    fn every_line_and_every_sum_is_the_oracles(setup in setup(), before in 0u64..50, seed: u64) {
        let mut bench = Bench::new();
        setup.apply(&mut bench);
        bench.ticks(before);
        bench.start();
        let samples = |t| random_sample(seed, t);
        let mut made = 0;
        for t in 0..setup.complete_after(setup.frames - 1) {
            prop_assert!(bench.0.running(), "clock {t}");
            prop_assert_eq!(bench.0.lines(), setup.lines(t), "clock {}", t);
            prop_assert!(!bench.0.frame_ready());
            bench.0.tick(samples(t));
            if t + 1 == setup.complete_after(made) {
                prop_assert!(bench.0.frame_ready(), "frame {made}");
                prop_assert!(bench.status(status::FRAME_READY));
                let frame = bench.take_frame();
                prop_assert_eq!(frame, setup.frame(made, before, &samples));
                made += 1;
                prop_assert_eq!(bench.get(Register::FramesMade), made);
            }
        }
        prop_assert_eq!(made, setup.frames);
        prop_assert!(!bench.0.running());
        prop_assert!(!bench.0.lines().enable);
        prop_assert_eq!(bench.get(Register::FramesLost), 0);
    }
}

/// Light that each LED adds at the photodiode, in ADC counts. The sum of all LEDs stays within 14
/// bits.
fn scene() -> impl Strategy<Value = Vec<u16>> {
    prop::collection::vec(0u16..16, 1024)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn a_scene_lit_by_the_lines_comes_back_as_its_hadamard_transform(
        scene in scene(),
        (order, dwell, blank, latency) in prop_oneof![
            Just((Order::Natural, 1u16, 0u16, 0u8)),
            (1u16..4, 0u8..64).prop_map(|(dwell, l)| (Order::Sequency, dwell, dwell - 1, l)),
            (Just((0..1024).collect::<Vec<u16>>()).prop_shuffle(), 0u8..64)
                .prop_map(|(table, l)| (Order::Table(table), 2, 1, l)),
        ],
        sweeps in 1u32..3,
        seed: u64,
    ) {
        let setup = Setup {
            order, patterns: 1024, differential: true, alternating: false, test_source: false,
            dwell, blank, latency, sweeps, frames: 1,
        };
        let mut bench = Bench::new();
        setup.apply(&mut bench);
        bench.start();
        // Samples from before the first light, and samples in the blanked clocks, are noise.
        let mut in_flight: VecDeque<u16> =
            (0..latency).map(|t| random_sample(seed, t.into()).code).collect();
        let (mut shown, mut light) = (None, 0);
        for t in 0.. {
            if !bench.0.running() {
                break;
            }
            let lines = bench.0.lines();
            if shown != Some(lines) {
                shown = Some(lines);
                light = (0u16..1024)
                    .filter(|p| lines.lit((p / 32) as u8, (p % 32) as u8))
                    .map(|p| scene[usize::from(p)])
                    .sum();
            }
            let settling = t % u64::from(dwell) < u64::from(blank);
            in_flight.push_back(if settling { random_sample(seed, t).code } else { light });
            let code = in_flight.pop_front().unwrap();
            bench.0.tick(AdcSample { code, over_range: false });
        }
        let frame = bench.take_frame();
        let summed = i64::from(dwell - blank) * i64::from(sweeps);
        for (k, sums) in (0u16..).zip(&frame.sums) {
            let row = setup.pattern(k);
            let coefficient: i64 = (0u16..1024)
                .map(|p| {
                    let value = i64::from(scene[usize::from(p)]);
                    if (row & p).count_ones().is_multiple_of(2) { value } else { -value }
                })
                .sum();
            prop_assert_eq!(sums.difference(), coefficient * summed, "pattern {}", row);
        }
    }
}

#[test]
fn a_slot_of_65_535_full_scale_samples_is_summed_exactly() {
    let mut bench = Bench::new();
    bench.set(Register::Patterns, 2);
    bench.set(Register::Dwell, 65_535);
    bench.set(Register::Blank, 0);
    bench.set(Register::Sweeps, 3);
    bench.set(Register::Frames, 1);
    bench.start();
    while bench.0.running() {
        bench.tick(0x3FFF);
    }
    for sums in bench.take_frame().sums {
        assert_eq!((sums.positive, sums.negative), (3 * 65_535 * 0x3FFF, 0));
    }
}

#[test]
fn bits_above_the_adcs_fourteen_are_not_connected() {
    let mut bench = Bench::new();
    bench.set(Register::Patterns, 1);
    bench.set(Register::Frames, 1);
    bench.start();
    while bench.0.running() {
        bench.tick(0xFFFF);
    }
    assert_eq!(bench.take_frame().sums[0].positive, 3 * 0x3FFF);
}

#[test]
fn the_negative_half_of_an_earlier_run_does_not_show_in_a_plain_one() {
    let mut bench = Bench::new();
    let differential = Setup {
        order: Order::Natural,
        patterns: 4,
        differential: true,
        alternating: true,
        test_source: false,
        dwell: 2,
        blank: 0,
        latency: 1,
        sweeps: 1,
        frames: 2,
    };
    for setup in [differential.clone(), Setup { differential: false, ..differential }] {
        setup.apply(&mut bench);
        bench.start();
        while bench.0.running() {
            bench.tick(100);
            if bench.0.frame_ready() {
                let negative = if setup.differential { 200 } else { 0 };
                let sums = bench.take_frame().sums;
                assert!(sums.iter().all(|s| s.negative == negative && s.positive == 200));
            }
        }
    }
}
