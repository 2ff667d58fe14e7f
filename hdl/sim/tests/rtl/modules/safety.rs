//! Tests of the faults that switch the LEDs off, and for how long.

use super::bundles::Settings;
use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::register::FaultCode;

laws![
    the_first_cause_ends_the_run_and_stays_until_cleared,
    an_open_interlock_darkens_at_once_and_until_a_new_start,
    a_stop_trips_nothing,
];

/// The module between runs, with the interlock closed.
fn bench(project: &Project) -> Bench {
    let mut bench = Bench::new(project, "safety");
    bench.set("interlock_now", true);
    bench.set("interlock_closed", true);
    bench
}

/// One clock with a signal set.
fn pulse(bench: &mut Bench, port: &str) {
    bench.set(port, true);
    bench.tick();
    bench.set(port, false);
}

/// A run with a full light budget; ends in its first clock.
fn begin(bench: &mut Bench, settings: &Settings) {
    bench.set_fields("settings", &settings.fields());
    bench.set("half_arrays", 0u64);
    bench.set("running", false);
    pulse(bench, "clear");
    pulse(bench, "begins");
    pulse(bench, "window_first");
    bench.tick();
    pulse(bench, "arrives");
    bench.set("running", true);
}

fn the_first_cause_ends_the_run_and_stays_until_cleared(project: &Project) {
    let mut bench = bench(project);
    let dice = &mut Dice::new(26);
    let mut seen = [0; 5];
    for run in 0..400 {
        // One of the four causes is likely to be first; sometimes two causes come together.
        let likely = dice.range(1, 4);
        let short = |dice: &mut Dice, this| if likely == this { dice.range(1, 30) } else { 500 };
        let settings = Settings {
            watchdog: short(dice, 1),
            duty_limit: short(dice, 2),
            ..Settings::default()
        };
        begin(&mut bench, &settings);
        let (mut silent, mut spent) = (0, 0);
        let code = loop {
            let feed = dice.once_in(if likely == 1 { 40 } else { 4 });
            let over_range = dice.once_in(if likely == 3 { 10 } else { 90 });
            let closed = !dice.once_in(if likely == 4 { 10 } else { 90 });
            let half_arrays = dice.range(0, 2);
            bench.set("feed", feed);
            bench.set("over_range", over_range);
            bench.set("interlock_closed", closed);
            bench.set("half_arrays", half_arrays);
            silent = if feed { 1 } else { silent + 1 };
            spent += half_arrays;
            let code = if !closed {
                FaultCode::Interlock
            } else if over_range {
                FaultCode::OverRange
            } else if spent > settings.duty_limit {
                FaultCode::Duty
            } else if silent >= settings.watchdog {
                FaultCode::Watchdog
            } else {
                FaultCode::None
            };
            let ends = code != FaultCode::None;
            assert_eq!(bench.is("opens"), !closed, "run {run}");
            assert_eq!(bench.is("trips"), ends && closed, "run {run}");
            assert_eq!(bench.is("permit"), !ends, "run {run}");
            assert_eq!(bench.get("fault"), 0);
            bench.tick();
            if ends {
                break code;
            }
        };
        seen[code as usize] += 1;
        bench.set("running", false);
        // After the first cause, no later cause changes the latched fault and nothing is lit.
        for _ in 0..dice.range(1, 20) {
            bench.set("over_range", dice.once_in(2));
            bench.set("interlock_closed", dice.once_in(2));
            assert_eq!(bench.get("fault"), code as u64, "run {run}");
            assert!(!bench.is("permit") && !bench.is("permitted"));
            bench.tick();
        }
        bench.set("over_range", false);
        bench.set("interlock_closed", true);
        pulse(&mut bench, "clear");
        assert_eq!(bench.get("fault"), 0);
    }
    assert!(seen[1..].iter().all(|&count| count > 20), "{seen:?}");
}

fn an_open_interlock_darkens_at_once_and_until_a_new_start(project: &Project) {
    let mut bench = bench(project);
    let dice = &mut Dice::new(27);
    // Whether the interlock is closed or not, nothing may be lit before the first start.
    assert!(!bench.is("permit") && !bench.is("permitted"));
    for _ in 0..50 {
        begin(&mut bench, &Settings::default());
        for _ in 0..dice.range(0, 5) {
            assert!(bench.is("permit") && bench.is("permitted"));
            bench.tick();
        }
        bench.set("interlock_now", false);
        // The LEDs are dark long before the run ends, and stay dark after the interlock has closed
        // again.
        for _ in 0..dice.range(1, 4) {
            assert!(!bench.is("permit") && !bench.is("permitted"));
            bench.tick();
        }
        bench.set("interlock_now", true);
        for _ in 0..dice.range(0, 30) {
            assert!(!bench.is("permit") && !bench.is("permitted"));
            bench.tick();
        }
    }
}

fn a_stop_trips_nothing(project: &Project) {
    let mut bench = bench(project);
    begin(&mut bench, &Settings { duty_limit: 0, watchdog: 1, ..Settings::default() });
    bench.set("over_range", true);
    bench.set("half_arrays", 2u64);
    assert!(bench.is("trips"));
    bench.set("stop", true);
    assert!(!bench.is("trips"));
    bench.tick();
    assert_eq!(bench.get("fault"), 0);
}
