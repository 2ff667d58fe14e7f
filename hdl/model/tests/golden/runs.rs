//! Tests of frames lost and released, and of runs stopped, restarted and reconfigured while
//! running.

use crate::bench::{Bench, random_sample};
use crate::oracle::{Order, Setup, setup};
use nirspi_wire::{
    FrameFlags,
    register::{Access, ORDER_TABLE, Register, WAITING_FRAMES, control, status},
};
use proptest::prelude::*;
use std::collections::VecDeque;

/// A short frame of 24 clocks that still uses every path.
fn small() -> Setup {
    Setup {
        order: Order::Sequency,
        patterns: 3,
        differential: true,
        alternating: true,
        test_source: false,
        dwell: 2,
        blank: 1,
        latency: 5,
        sweeps: 2,
        frames: 8,
    }
}

proptest! {
    #[test]
    fn a_slow_host_loses_whole_frames_and_every_loss_is_counted_once(
        setup in setup(), frames in 1u32..12, hurry in prop::collection::vec(0.0f64..3.0, 12),
        seed: u64,
    ) {
        let frames = if setup.patterns > 1000 { frames.min(3) } else { frames };
        let setup = Setup { frames, ..setup };
        let samples = |t| random_sample(seed, t);
        let mut bench = Bench::new();
        setup.apply(&mut bench);
        bench.start();
        // The host keeps each frame for a random time. Only those times decide whether frame f is
        // lost.
        let mut held_until = 0;
        let mut lost = 0;
        let mut after_loss = false;
        let mut waiting = VecDeque::new();
        let hold = |t: u64, hurry: f64| t + (hurry * setup.clocks_per_frame() as f64) as u64;
        let mut f = 0;
        for t in 1..=setup.complete_after(frames - 1) {
            if !waiting.is_empty() && t > held_until {
                // A late read must give the frame unchanged.
                let frame = bench.take_frame();
                prop_assert_eq!(Some(frame), waiting.pop_front());
                held_until = hold(t, hurry[f as usize]);
            }
            bench.0.tick(samples(t - 1));
            if t == setup.complete_after(f) {
                if waiting.len() == WAITING_FRAMES {
                    lost += 1;
                    after_loss = true;
                } else {
                    let mut frame = setup.frame(f, 0, &samples);
                    frame.header.lost = lost;
                    if std::mem::take(&mut after_loss) {
                        frame.header.flags = frame.header.flags.with(FrameFlags::AFTER_LOSS);
                    }
                    if waiting.is_empty() {
                        held_until = hold(t, hurry[f as usize]);
                    }
                    waiting.push_back(frame);
                }
                f += 1;
            }
            prop_assert_eq!(bench.0.frame_ready(), !waiting.is_empty(), "clock {}", t);
        }
        prop_assert_eq!(bench.get(Register::FramesMade), frames);
        prop_assert_eq!(bench.get(Register::FramesLost), lost);
        for frame in waiting {
            prop_assert_eq!(bench.take_frame(), frame);
        }
        prop_assert!(!bench.0.frame_ready());
    }

    #[test]
    fn a_run_stopped_anywhere_leaves_nothing_in_the_next(
        first in setup(), second in setup(), stop in any::<prop::sample::Index>(), seed: u64,
    ) {
        let mut bench = Bench::new();
        first.apply(&mut bench);
        bench.start();
        let ran = stop.index(first.complete_after(first.frames - 1) as usize) as u64;
        for t in 0..ran {
            bench.0.tick(random_sample(!seed, t));
        }
        bench.control(control::STOP);
        prop_assert!(!bench.0.running() && !bench.0.lines().enable);
        let made = bench.get(Register::FramesMade);
        let delivered = bench.0.frame_ready();
        prop_assert_eq!(delivered, made > 0);
        bench.ticks(100);
        prop_assert_eq!(bench.get(Register::FramesMade), made, "stopped, yet it made a frame");

        second.apply(&mut bench);
        bench.start();
        prop_assert!(!bench.0.frame_ready(), "a frame of an earlier run is still there");
        let samples = |t| random_sample(seed, t);
        for t in 0..second.complete_after(0) {
            prop_assert_eq!(bench.0.lines(), second.lines(t));
            bench.0.tick(samples(t));
        }
        prop_assert_eq!(bench.take_frame(), second.frame(0, ran + 100, &samples));
    }

    #[test]
    fn settings_written_while_running_hold_for_the_next_run(
        now in setup(), next in setup(), at in any::<prop::sample::Index>(), seed: u64,
    ) {
        // The table cannot be written during the run, so both runs use the table of the first.
        let next = match (&now.order, &next.order) {
            (Order::Table(table), Order::Table(_)) => {
                Setup { order: Order::Table(table.clone()), ..next }
            }
            (_, Order::Table(_)) => Setup { order: Order::Natural, ..next },
            _ => next,
        };
        let samples = |t| random_sample(seed, t);
        let mut bench = Bench::new();
        now.apply(&mut bench);
        bench.start();
        let written = at.index(now.complete_after(now.frames - 1) as usize) as u64;
        let mut f = 0;
        for t in 0..now.complete_after(now.frames - 1) {
            if t == written {
                next.apply(&mut bench);
                let table = matches!(next.order, Order::Table(_));
                prop_assert_eq!(bench.status(status::WRITE_REFUSED), table);
            }
            prop_assert_eq!(bench.0.lines(), now.lines(t));
            bench.0.tick(samples(t));
            if t + 1 == now.complete_after(f) {
                prop_assert_eq!(bench.take_frame(), now.frame(f, 0, &samples));
                f += 1;
            }
        }
        let start = now.complete_after(now.frames - 1);
        bench.start();
        prop_assert!(!bench.status(status::WRITE_REFUSED));
        for t in 0..next.complete_after(0) {
            prop_assert_eq!(bench.0.lines(), next.lines(t));
            bench.0.tick(samples(t));
        }
        prop_assert_eq!(bench.take_frame(), next.frame(0, start, &samples));
    }
}

#[test]
fn the_order_table_is_the_sequencers_during_a_run() {
    let mut bench = Bench::new();
    assert!(bench.0.write(ORDER_TABLE + 3, 77));
    bench.start();
    assert!(bench.0.write(ORDER_TABLE + 3, 78));
    assert!(bench.status(status::WRITE_REFUSED));
    assert_eq!(bench.0.read(ORDER_TABLE + 3), Some(77));
    bench.control(control::STOP);
    assert!(bench.status(status::WRITE_REFUSED), "only an accepted start clears it");
    assert!(bench.0.write(ORDER_TABLE + 3, 78));
    assert_eq!(bench.0.read(ORDER_TABLE + 3), Some(78));
    bench.start();
    assert!(!bench.status(status::WRITE_REFUSED));
}

/// Three frames are in the banks at a time: one delivered, one that waits, one that is being summed.
#[test]
fn a_frame_that_waits_is_delivered_at_the_release() {
    let setup = Setup { frames: 5, ..small() };
    let samples = |t| random_sample(3, t);
    let mut bench = Bench::new();
    setup.apply(&mut bench);
    bench.start();
    let mut t = 0;
    let mut run_to = |bench: &mut Bench, end: u64| {
        for t in std::mem::replace(&mut t, end)..end {
            bench.0.tick(samples(t));
        }
    };
    // Two wait, and half of the third frame is summed.
    run_to(&mut bench, setup.complete_after(1) + setup.clocks_per_frame() / 2);
    let first = setup.frame(0, 0, &samples);
    let again = bench.0.frame().unwrap().to_vec();
    assert_eq!(bench.take_frame(), first);
    assert!(bench.0.frame_ready(), "the one behind is there at once");
    assert_ne!(bench.0.frame().unwrap(), again);
    // The release makes room for the third, but not for the fourth.
    run_to(&mut bench, setup.complete_after(3));
    assert_eq!((bench.get(Register::FramesMade), bench.get(Register::FramesLost)), (4, 1));
    for sequence in [1, 2] {
        assert_eq!(bench.take_frame(), setup.frame(sequence, 0, &samples));
    }
    assert!(!bench.0.frame_ready());
    bench.control(control::RELEASE);
    run_to(&mut bench, setup.complete_after(4));
    let last = bench.take_frame();
    assert_eq!(last.sums, setup.frame(4, 0, &samples).sums);
    assert_eq!((last.header.sequence, last.header.lost), (4, 1));
    assert!(last.header.flags.contains(FrameFlags::AFTER_LOSS));
}

#[test]
fn a_start_while_running_changes_nothing() {
    let setup = small();
    let samples = |t| random_sample(1, t);
    let mut bench = Bench::new();
    setup.apply(&mut bench);
    bench.start();
    for t in 0..setup.complete_after(0) {
        if t == 13 {
            bench.control(control::START);
            bench.control(control::START_RAW);
        }
        assert_eq!(bench.0.lines(), setup.lines(t));
        bench.0.tick(samples(t));
    }
    assert_eq!(bench.take_frame(), setup.frame(0, 0, &samples));
}

#[test]
fn control_bits_act_in_the_order_listed() {
    let setup = small();
    let samples = |t| random_sample(2, t);
    let mut bench = Bench::new();
    setup.apply(&mut bench);
    bench.start();
    bench.ticks(17);
    // Writes a stop and both starts at once: the stop comes first, the raw start comes last and is
    // refused because a run has started.
    bench.control(control::STOP | control::RELEASE | control::START | control::START_RAW);
    for t in 0..setup.complete_after(0) {
        bench.0.tick(samples(t));
    }
    assert!(!bench.0.raw_ready());
    assert_eq!(bench.take_frame(), setup.frame(0, 17, &samples));
}

#[test]
fn a_run_goes_on_dark_until_its_last_samples_are_in() {
    let setup = Setup { frames: 1, ..small() };
    let mut bench = Bench::new();
    setup.apply(&mut bench);
    bench.start();
    bench.ticks(setup.lit_clocks());
    for _ in 0..setup.latency {
        assert!(bench.0.running() && bench.status(status::RUNNING));
        assert!(!bench.0.lines().enable && !bench.status(status::LEDS_ON));
        assert!(!bench.0.frame_ready());
        bench.tick(0);
    }
    assert!(!bench.0.running() && bench.0.frame_ready());
}

#[test]
fn a_stop_in_the_dark_end_of_a_run_discards_its_last_frame() {
    let setup = Setup { frames: 2, ..small() };
    let mut bench = Bench::new();
    setup.apply(&mut bench);
    bench.start();
    bench.ticks(setup.lit_clocks() + 1);
    bench.control(control::STOP);
    bench.ticks(100);
    assert_eq!(bench.get(Register::FramesMade), 1);
    assert_eq!(bench.take_frame().header.sequence, 0);
}

#[test]
fn a_delivered_frame_outlives_stop_and_a_refused_start() {
    let setup = small();
    let mut bench = Bench::new();
    setup.apply(&mut bench);
    bench.start();
    bench.ticks(setup.complete_after(0));
    bench.control(control::STOP);
    bench.set(Register::Sweeps, 0);
    bench.control(control::START);
    assert!(bench.status(status::CONFIG_ERROR) && !bench.0.running());
    assert!(bench.0.frame_ready());
    assert_eq!(bench.get(Register::FramesMade), 1);
    bench.set(Register::Sweeps, 1);
    bench.start();
    assert!(!bench.status(status::CONFIG_ERROR) && !bench.0.frame_ready());
    assert_eq!(bench.get(Register::FramesMade), 0);
}

#[test]
fn a_run_without_end_goes_on_until_stopped() {
    let setup = Setup { frames: 0, ..small() };
    let mut bench = Bench::new();
    setup.apply(&mut bench);
    bench.start();
    for f in 0..1000 {
        bench.ticks(setup.clocks_per_frame() + if f == 0 { 5 } else { 0 });
        assert_eq!(bench.take_frame().header.sequence, f);
    }
    assert!(bench.0.running() && bench.0.lines().enable);
}

#[test]
fn every_setting_is_checked_at_a_start_and_only_there() {
    use Register as R;
    let cases: &[(R, &[u32], &[u32])] = &[
        (R::Mode, &[0, 0b11_1111], &[1 << 6, 1 << 31]),
        (R::Patterns, &[1, 1024], &[0, 1025, 1 << 16 | 1]),
        (R::Dwell, &[3, 65_535], &[0, 2, 65_536, 1 << 16 | 5]),
        (R::Blank, &[0, 4], &[5, 1 << 16]),
        (R::Latency, &[0, 63], &[64, 256]),
        (R::Sweeps, &[1, u32::MAX], &[0]),
        (R::Frames, &[0, u32::MAX], &[]),
        (R::RawLength, &[1, 4096], &[0, 4097, 1 << 16 | 1]),
        (R::Watchdog, &[1, 125_000_000], &[0, 125_000_001]),
        (R::DutyLimit, &[0, 1_310_720], &[1_310_721]),
        (R::OverRangeTrip, &[0, u32::MAX], &[]),
        (R::Run, &[0, u32::MAX], &[]),
        (R::TimeLow, &[0, u32::MAX], &[]),
        (R::TimeHigh, &[0, u32::MAX], &[]),
    ];
    for start in [control::START, control::START_RAW] {
        for &(register, good, bad) in cases {
            for &value in good.iter().chain(bad) {
                let mut bench = Bench::new();
                bench.set(register, value);
                assert_eq!(bench.get(register), value);
                bench.control(start);
                let accepted = good.contains(&value);
                assert_eq!(bench.0.running(), accepted, "{register:?} = {value}");
                assert_eq!(bench.status(status::CONFIG_ERROR), !accepted);
                bench.control(control::STOP);
                bench.set(register, register.reset());
                assert_eq!(bench.status(status::CONFIG_ERROR), !accepted);
                bench.control(start);
                assert!(bench.0.running() && !bench.status(status::CONFIG_ERROR));
            }
        }
    }
    let settings = R::ALL
        .iter()
        .filter(|register| register.access() == Access::ReadWrite && **register != R::Scratch);
    assert!(settings.eq(cases.iter().map(|(register, ..)| register)), "a setting is not tested");
}
