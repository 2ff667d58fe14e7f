//! Tests of the watchdog alone.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;

laws![it_barks_with_the_clock_that_makes_the_silence_as_long_as_set];

fn it_barks_with_the_clock_that_makes_the_silence_as_long_as_set(project: &Project) {
    let mut bench = Bench::new(project, "watchdog");
    let dice = &mut Dice::new(4);
    let mut barks = 0;
    for run in 0..300 {
        let limit = if dice.once_in(4) { 1 } else { dice.range(1, 50) };
        bench.set("less_1", limit - 1);
        // Between runs the watchdog does not count, whatever the host does.
        for _ in 0..dice.range(2, 70) {
            bench.set("feed", dice.once_in(4));
            bench.tick();
        }
        bench.set("feed", false);
        bench.set("arrives", true);
        bench.tick();
        bench.set("arrives", false);
        let mut silent = 0;
        for clock in 0..200 {
            let feed = dice.once_in(limit);
            bench.set("feed", feed);
            silent = if feed { 1 } else { silent + 1 };
            assert_eq!(bench.is("barks"), silent == limit, "run {run}, clock {clock}");
            bench.tick();
            if silent == limit {
                barks += 1;
                break;
            }
        }
    }
    assert!(barks > 100, "{barks}");
}
