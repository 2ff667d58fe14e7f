//! Tests of the chain of counters against positions computed by division.

use super::bundles::{PLACE, Place, Settings};
use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;

laws![every_clock_lies_where_division_puts_it, a_halt_ends_a_run_and_a_start_wins_over_it];

fn place(bench: &mut Bench) -> Option<Place> {
    Place::from_fields(&bench.get_fields("place", &PLACE))
}

fn start(bench: &mut Bench, settings: &Settings) {
    bench.set_fields("settings", &settings.fields());
    bench.set("start", true);
    bench.tick();
    bench.set("start", false);
}

fn every_clock_lies_where_division_puts_it(project: &Project) {
    let mut bench = Bench::new(project, "sequencer");
    let dice = &mut Dice::new(6);
    for run in 0..120 {
        let mut settings = Settings::random(dice);
        if run % 40 == 0 {
            settings = Settings { patterns: 1024, dwell: 1, blank: 0, ..settings };
        }
        if run % 40 == 1 {
            settings = Settings { patterns: 1, dwell: 70, blank: 69, ..settings };
        }
        start(&mut bench, &settings);
        // Goes beyond the end of a run, and covers about four frames of a run without end.
        for t in 0..settings.frame_clocks() * 4 + 10 {
            assert_eq!(place(&mut bench), Place::of(&settings, t), "clock {t} of {settings:?}");
            bench.tick();
        }
        bench.set("halt", true);
        bench.tick();
        bench.set("halt", false);
    }
}

fn a_halt_ends_a_run_and_a_start_wins_over_it(project: &Project) {
    let mut bench = Bench::new(project, "sequencer");
    let dice = &mut Dice::new(7);
    for _ in 0..200 {
        let settings = Settings { frames: 0, ..Settings::random(dice) };
        bench.set("halt", dice.once_in(2));
        start(&mut bench, &settings);
        bench.set("halt", false);
        for t in 0..dice.range(0, 30) {
            assert_eq!(place(&mut bench), Place::of(&settings, t));
            bench.tick();
        }
        if dice.once_in(2) {
            continue;
        }
        bench.set("halt", true);
        bench.tick();
        bench.set("halt", false);
        for _ in 0..dice.range(1, 20) {
            assert_eq!(place(&mut bench), None);
            bench.tick();
        }
    }
}
