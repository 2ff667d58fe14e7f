//! Tests of the faults that switch the LEDs off, and that the LEDs stay off until the fault is
//! cleared.

use crate::bench::Bench;
use nirspi_hdl_model::{AdcSample, Gateware};
use nirspi_wire::register::{
    DUTY_LIMIT_MAX, DUTY_WINDOW, FaultCode, ORDER_TABLE, Register, WATCHDOG_MAX, control, mode,
    status,
};
use proptest::prelude::*;

const DARK: AdcSample = AdcSample { code: 0, over_range: false };
const OVER: AdcSample = AdcSample { code: 0x3FFF, over_range: true };

/// Checks that the LEDs stay off after a trip, and that only clearing the fault allows a new run.
fn stays_off_until_cleared(mut bench: Bench, code: FaultCode) {
    assert_eq!(bench.fault(), code);
    for _ in 0..3 {
        assert!(!bench.0.running() && !bench.0.lines().enable);
        assert!(!bench.status(status::LEDS_ON));
        bench.ticks(100);
        bench.control(control::START);
        bench.control(control::START_RAW);
        assert!(!bench.status(status::CONFIG_ERROR), "the settings are not to blame");
    }
    bench.control(control::CLEAR_FAULT | control::START);
    assert_eq!(bench.fault(), FaultCode::None);
    assert!(bench.0.lines().enable);
}

#[test]
fn a_start_needs_a_closed_interlock() {
    let mut gateware = Gateware::new();
    for start in [control::START, control::START_RAW] {
        gateware.write(Register::Control.address(), start);
        assert!(!gateware.running());
    }
    assert_eq!(gateware.read(Register::Fault.address()), Some(0), "it was not running");
    gateware.set_interlock(true);
    assert!(!gateware.running(), "closing it starts nothing");
}

#[test]
fn an_interlock_opened_in_a_run_puts_the_leds_out_at_once_and_is_latched() {
    for start in [control::START, control::START_RAW] {
        let mut bench = Bench::new();
        bench.control(start);
        bench.ticks(3);
        bench.0.set_interlock(false);
        assert!(!bench.0.lines().enable);
        bench.control(control::CLEAR_FAULT | control::START);
        assert!(!bench.0.running(), "it is still open");
        bench.0.set_interlock(true);
        bench.start();
        bench.0.set_interlock(false);
        bench.0.set_interlock(true);
        stays_off_until_cleared(bench, FaultCode::Interlock);
    }
}

#[test]
fn the_watchdog_trips_after_exactly_its_clocks_without_an_access() {
    for watchdog in [1, 2, 1000] {
        for start in [control::START, control::START_RAW] {
            let mut bench = Bench::new();
            bench.set(Register::Watchdog, watchdog);
            bench.ticks(5000);
            bench.control(start);
            let lit = bench.ticks_until_dark(DARK, 2000);
            assert_eq!(lit, watchdog.into());
            assert_eq!(bench.fault(), FaultCode::Watchdog);
        }
    }
}

#[test]
fn every_kind_of_access_feeds_the_watchdog() {
    let accesses: [fn(&mut Gateware); 6] = [
        |g| assert!(g.read(Register::Identity.address()).is_some()),
        |g| assert!(g.write(Register::Scratch.address(), 1)),
        |g| assert!(g.read(0xFFFF).is_none()),
        |g| assert!(!g.write(0xFFFF, 1)),
        |g| assert!(g.frame().is_none()),
        |g| assert!(g.raw().is_none()),
    ];
    for access in accesses {
        let mut bench = Bench::new();
        bench.set(Register::Watchdog, 10);
        bench.start();
        for _ in 0..10 {
            bench.ticks(9);
            access(&mut bench.0);
        }
        assert_eq!(bench.ticks_until_dark(DARK, 100), 10);
        stays_off_until_cleared(bench, FaultCode::Watchdog);
    }
}

/// A bench that shows only pattern 0, with all LEDs on, from the given clock.
fn full_light(first_clock: u64) -> Bench {
    let mut bench = Bench::new();
    bench.set(Register::Watchdog, WATCHDOG_MAX);
    bench.set(Register::Patterns, 1);
    bench.ticks(first_clock);
    bench.start();
    bench
}

#[test]
fn pattern_0_alone_trips_the_duty_limit_once_its_light_exceeds_the_budget() {
    let mut bench = full_light(0);
    // All LEDs cost 2 half-arrays a clock: the budget is spent after this many clocks, and exceeded
    // one clock later.
    let budget = u64::from(DUTY_LIMIT_MAX / 2);
    assert_eq!(bench.ticks_until_dark(DARK, 2 * budget), budget + 1);
    stays_off_until_cleared_in_the_next_window(bench);
}

fn stays_off_until_cleared_in_the_next_window(mut bench: Bench) {
    assert_eq!(bench.fault(), FaultCode::Duty);
    bench.control(control::CLEAR_FAULT | control::START);
    assert_eq!(bench.ticks_until_dark(DARK, 10), 1, "the budget of this window is spent");
    assert_eq!(bench.fault(), FaultCode::Duty);
    let rest = u64::from(DUTY_WINDOW) - u64::from(bench.get(Register::ClockLow));
    bench.ticks(rest);
    bench.control(control::CLEAR_FAULT | control::START);
    let budget = u64::from(DUTY_LIMIT_MAX / 2);
    assert_eq!(bench.ticks_until_dark(DARK, 2 * budget), budget + 1, "a new window, a new budget");
}

#[test]
fn no_sequence_of_starts_gets_around_the_duty_limit() {
    let mut bench = full_light(0);
    let mut lit = 0;
    while bench.0.running() && lit < DUTY_LIMIT_MAX {
        lit += 1;
        bench.tick(0);
        if lit % 1000 == 0 {
            bench.control(control::STOP | control::CLEAR_FAULT | control::START);
        }
    }
    assert_eq!(lit, DUTY_LIMIT_MAX / 2 + 1);
    assert_eq!(bench.fault(), FaultCode::Duty);
}

#[test]
fn duty_windows_begin_at_multiples_of_their_length_since_reset() {
    // Half of the budget spent before a boundary leaves the whole budget after it.
    let before = u64::from(DUTY_LIMIT_MAX / 4);
    let mut bench = full_light(u64::from(DUTY_WINDOW) - before);
    let budget = u64::from(DUTY_LIMIT_MAX / 2);
    assert_eq!(bench.ticks_until_dark(DARK, 4 * budget), before + budget + 1);
    assert_eq!(bench.fault(), FaultCode::Duty);
}

#[test]
fn whole_sweeps_and_complementary_pairs_never_trip_the_duty_limit() {
    let alternating = mode::DIFFERENTIAL | mode::ALTERNATING;
    let pairs = [mode::DIFFERENTIAL, alternating].map(|bits| [(1024, bits), (1, bits)]);
    for (patterns, bits) in [(1024, 0)].into_iter().chain(pairs.into_iter().flatten()) {
        let mut bench = Bench::new();
        bench.set(Register::Watchdog, WATCHDOG_MAX);
        bench.set(Register::Patterns, patterns);
        bench.set(Register::Mode, bits);
        bench.start();
        bench.ticks(2 * u64::from(DUTY_WINDOW));
        assert_eq!(bench.fault(), FaultCode::None);
        assert!(bench.0.lines().enable);
    }
}

#[test]
fn light_is_counted_in_half_arrays_a_clock() {
    // Each case: table entry, whether the complement is shown, limit, clocks lit until the limit is
    // exceeded (dwell 5).
    let cases = [
        (0, false, 0, 1),
        (0, false, 7, 4),
        (1, false, 7, 8),
        (0, true, 10, 11), // the complement of pattern 0 is free: 2 2 2 2 2 0 0 0 0 0 2
        (5, true, 10, 11), // that of any other is not: 1 1 1 1 1 1 1 1 1 1 1
    ];
    for (pattern, differential, limit, lit) in cases {
        let mut bench = Bench::new();
        bench.0.write(ORDER_TABLE, pattern);
        bench.set(Register::Patterns, 1);
        let bits = if differential { mode::DIFFERENTIAL } else { 0 };
        bench.set(Register::Mode, mode::ORDER_TABLE | bits);
        bench.set(Register::DutyLimit, limit);
        bench.start();
        assert_eq!(bench.ticks_until_dark(DARK, 100), lit, "pattern {pattern}");
        assert_eq!(bench.fault(), FaultCode::Duty);
    }
}

/// The same run with and without light: lines, samples and sums are the same.
#[test]
fn a_run_without_light_shows_its_lines_and_spends_nothing() {
    let mut lit = Bench::new();
    let mut unlit = Bench::new();
    for (bench, bits) in [(&mut lit, 0), (&mut unlit, mode::UNLIT)] {
        bench.set(Register::Mode, mode::DIFFERENTIAL | bits);
        bench.set(Register::Patterns, 3);
        bench.set(Register::Latency, 9);
        bench.set(Register::Frames, 2);
        bench.set(Register::DutyLimit, if bits == 0 { DUTY_LIMIT_MAX } else { 0 });
        bench.start();
    }
    let mut shown = 0;
    for t in 0..2 * 30 + 9 {
        let (with, without) = (lit.0.lines(), unlit.0.lines());
        assert_eq!((with.rows, with.columns), (without.rows, without.columns), "clock {t}");
        assert!(!without.enable && !unlit.status(status::LEDS_ON), "clock {t}");
        shown += u32::from(with.enable);
        assert_eq!(lit.0.running(), unlit.0.running(), "clock {t}");
        lit.tick(t * 7);
        unlit.tick(t * 7);
        if lit.0.frame_ready() {
            let (with, without) = (lit.take_frame(), unlit.take_frame());
            assert_eq!(with.sums, without.sums);
        }
    }
    assert_eq!(shown, 60);
    assert_eq!((lit.fault(), unlit.fault()), (FaultCode::None, FaultCode::None));
    assert!(!unlit.0.running() && unlit.get(Register::FramesMade) == 2);
}

/// A start takes the bit as it takes any setting; and a burst has no light either.
#[test]
fn a_burst_without_light_is_dark_and_the_next_run_is_lit() {
    let mut bench = Bench::new();
    bench.set(Register::Mode, mode::UNLIT);
    bench.set(Register::RawLength, 50);
    bench.control(control::START_RAW);
    bench.set(Register::Mode, 0);
    assert_eq!(bench.ticks_until_dark(DARK, 100), 0);
    assert!(bench.0.running());
    bench.ticks(50);
    assert!(bench.0.raw_ready() && !bench.0.running());
    bench.start();
    assert!(bench.0.lines().enable);
}

#[test]
fn the_dark_end_of_a_run_costs_no_light() {
    let mut bench = Bench::new();
    bench.set(Register::Frames, 1);
    bench.set(Register::Patterns, 1);
    bench.set(Register::Latency, 63);
    bench.set(Register::DutyLimit, 10); // exactly the 5 lit clocks of pattern 0
    bench.start();
    bench.ticks(5 + 63);
    assert_eq!(bench.fault(), FaultCode::None);
    assert!(bench.0.frame_ready() && !bench.0.running());
}

#[test]
fn over_range_samples_of_one_frame_trip_blanked_ones_too_but_none_from_before_the_light() {
    let mut bench = Bench::new();
    bench.set(Register::Patterns, 2); // frames of 10 clocks
    bench.set(Register::Blank, 4);
    bench.set(Register::Latency, 3);
    bench.set(Register::OverRangeTrip, 4);
    bench.start();
    // Over-range samples before the arrival of the first light, and three in each of three frames.
    for t in 0u32..3 + 30 {
        let over = t < 3 || (t - 3) % 10 < 3;
        bench.0.tick(if over { OVER } else { DARK });
        if bench.0.frame_ready() {
            assert_eq!(bench.take_frame().header.over_range, 3);
        }
    }
    assert_eq!(bench.fault(), FaultCode::None);
    assert_eq!(bench.get(Register::FramesMade), 3);
    assert_eq!(bench.ticks_until_dark(OVER, 100), 4);
    bench.ticks(100);
    assert!(!bench.0.frame_ready(), "the unfinished frame is discarded");
    stays_off_until_cleared(bench, FaultCode::OverRange);
}

#[test]
fn over_range_only_flags_where_the_trip_is_0() {
    let mut bench = Bench::new();
    bench.set(Register::Frames, 1);
    bench.set(Register::OverRangeTrip, 0);
    bench.start();
    while bench.0.running() {
        bench.0.tick(OVER);
    }
    assert_eq!(bench.fault(), FaultCode::None);
    assert_eq!(bench.take_frame().header.over_range, 5 * 1024);
}

#[test]
fn a_fault_in_the_clock_that_completes_a_frame_discards_it() {
    let mut bench = Bench::new();
    bench.set(Register::Patterns, 1);
    bench.set(Register::OverRangeTrip, 1);
    bench.start();
    bench.ticks(9);
    assert_eq!(bench.take_frame().header.sequence, 0);
    bench.0.tick(OVER);
    assert_eq!(bench.fault(), FaultCode::OverRange);
    assert!(!bench.0.frame_ready());
    assert_eq!(bench.get(Register::FramesMade), 1);
}

#[test]
fn a_delivered_frame_outlives_a_fault() {
    let mut bench = Bench::new();
    bench.set(Register::Patterns, 1);
    bench.set(Register::Watchdog, 7);
    bench.start();
    bench.ticks(100);
    assert_eq!(bench.fault(), FaultCode::Watchdog);
    assert_eq!(bench.take_frame().header.sequence, 0);
}

#[test]
fn the_first_fault_is_the_one_latched_and_one_clock_has_an_order() {
    // Every cause trips in the first clock; over-range comes before duty, and duty before watchdog.
    let mut bench = Bench::new();
    bench.set(Register::Watchdog, 1);
    bench.set(Register::DutyLimit, 0);
    bench.set(Register::OverRangeTrip, 1);
    bench.start();
    bench.0.tick(OVER);
    assert_eq!(bench.fault(), FaultCode::OverRange);
    bench.0.set_interlock(false);
    assert_eq!(bench.fault(), FaultCode::OverRange, "not running any more");
    bench.0.set_interlock(true);
    bench.control(control::CLEAR_FAULT | control::START);
    bench.0.tick(DARK);
    assert_eq!(bench.fault(), FaultCode::Duty);
}

#[test]
fn clearing_faults_does_not_disturb_a_run() {
    let mut bench = Bench::new();
    bench.start();
    bench.ticks(10);
    bench.control(control::CLEAR_FAULT);
    assert!(bench.0.running() && bench.0.lines().enable);
}

#[derive(Debug, Clone)]
enum Deed {
    Write(u16, u32),
    Ticks(u8, bool),
    Interlock(bool),
}

fn deed() -> impl Strategy<Value = Deed> {
    let control = Register::Control.address();
    // Settings with which events happen within a few clocks.
    let lively = prop::sample::select(vec![
        (Register::Watchdog, 40),
        (Register::Watchdog, 300),
        (Register::DutyLimit, 100),
        (Register::DutyLimit, DUTY_LIMIT_MAX),
        (Register::OverRangeTrip, 3),
        (Register::OverRangeTrip, 0),
        (Register::Patterns, 2),
        (Register::Patterns, 0),
        (Register::Frames, 2),
        (Register::Latency, 9),
        (Register::RawLength, 20),
        (Register::Mode, mode::DIFFERENTIAL),
        (Register::Mode, mode::UNLIT),
    ]);
    prop_oneof![
        4 => (0u32..32).prop_map(move |bits| Deed::Write(control, bits)),
        2 => lively.prop_map(|(register, value)| Deed::Write(register.address(), value)),
        1 => (0u16..0x1B, any::<u32>()).prop_map(|(address, value)| Deed::Write(address, value)),
        1 => any::<(u16, u32)>().prop_map(|(address, value)| Deed::Write(address, value)),
        6 => (any::<u8>(), prop::bool::weighted(0.2)).prop_map(|(n, over)| Deed::Ticks(n, over)),
        1 => prop::bool::weighted(0.8).prop_map(Deed::Interlock),
    ]
}

proptest! {
    #[test]
    fn no_light_with_a_fault_latched_an_open_interlock_or_no_run(
        deeds in prop::collection::vec(deed(), 1..120),
    ) {
        let mut gateware = Gateware::new();
        let mut closed = false;
        let mut latched = 0;
        for deed in deeds {
            let mut ticks = 0;
            let mut may_clear = false;
            let mut sample = DARK;
            match deed {
                Deed::Write(address, value) => {
                    may_clear = address == Register::Control.address()
                        && value & control::CLEAR_FAULT != 0;
                    gateware.write(address, value);
                }
                Deed::Ticks(n, over) => {
                    ticks = n;
                    sample = if over { OVER } else { DARK };
                }
                Deed::Interlock(now) => {
                    closed = now;
                    gateware.set_interlock(now);
                }
            }
            for tick in 0..=ticks {
                if tick > 0 {
                    gateware.tick(sample);
                }
                let lines = gateware.lines();
                // A read would restart the watchdog, so the test reads a copy.
                let mut copy = gateware.clone();
                let fault = copy.read(Register::Fault.address()).unwrap();
                let bits = copy.read(Register::Status.address()).unwrap();
                if lines.enable {
                    prop_assert!(gateware.running() && closed && fault == 0);
                } else if !gateware.running() {
                    prop_assert_eq!((lines.rows, lines.columns), (0, 0));
                }
                prop_assert!(latched == 0 || fault == latched || may_clear, "fault lost");
                prop_assert!(fault == 0 || !gateware.running());
                prop_assert_eq!(bits & status::LEDS_ON != 0, lines.enable);
                prop_assert_eq!(bits & status::FAULT != 0, fault != 0);
                prop_assert_eq!(bits & status::RUNNING != 0, gateware.running());
                prop_assert_eq!(bits & status::INTERLOCK_CLOSED != 0, closed);
                latched = fault;
            }
        }
    }
}
