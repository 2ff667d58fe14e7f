//! Tests of the frequency meter.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::register::clocks::WINDOW;

laws![a_count_is_of_the_last_whole_window, a_clock_that_stands_still_counts_nothing];

fn meter(project: &Project, window: u32) -> Bench {
    // A shorter window, so that many of them fit.
    let full = format!("CLOCKS_WINDOW          : logic<32> = 32'h{WINDOW:08X}");
    assert!(project.0["register_map"].contains(full.trim_end()), "{full}");
    let short = format!("CLOCKS_WINDOW          : logic<32> = 32'h{window:08X}");
    Bench::new(&project.with("register_map", &full, &short), "clock_meter")
}

fn a_count_is_of_the_last_whole_window(project: &Project) {
    let window = 200;
    let mut bench = meter(project, window);
    let dice = &mut Dice::new(61);
    // Levels two clocks ago and before: the synchroniser.
    let (mut levels, mut last) = ([false; 2], false);
    let (mut beat, mut so_far, mut expected) = (false, 0, 0);
    for clock in 0..20 * window {
        let rate = 2 + u64::from(clock / window);
        beat ^= dice.once_in(rate);
        bench.set("beat", beat);
        assert_eq!(bench.get("count"), expected, "clock {clock}");
        so_far += u64::from(levels[1] != last);
        last = levels[1];
        levels = [beat, levels[0]];
        if clock % window == window - 1 {
            (expected, so_far) = (so_far, 0);
        }
        bench.tick();
    }
    assert!(expected > 0);
}

fn a_clock_that_stands_still_counts_nothing(project: &Project) {
    for level in [false, true] {
        let mut bench = meter(project, 50);
        bench.set("beat", level);
        for _ in 0..101 {
            bench.tick();
        }
        assert_eq!(bench.get("count"), 0);
    }
}
