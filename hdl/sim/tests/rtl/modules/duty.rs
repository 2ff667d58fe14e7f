//! Tests of the light budget.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;

laws![the_light_budget_is_a_sum_over_its_window];

fn the_light_budget_is_a_sum_over_its_window(project: &Project) {
    let mut bench = Bench::new(project, "duty");
    let dice = &mut Dice::new(3);
    let mut spent = 0u64;
    for run in 0..200 {
        // One run: idle clocks in which the limit changes, then lit clocks until the light exceeds
        // the limit.
        let limit = dice.range(0, 60);
        bench.set("limit", limit);
        bench.set("running", false);
        for clock in 0..dice.range(4, 9) + 200 {
            let idle = clock < 4;
            let window = dice.once_in(40);
            let half_arrays = dice.range(0, 2);
            bench.set("window_first", window);
            bench.set("running", !idle);
            bench.set("spends", !idle);
            bench.set("half_arrays", half_arrays);
            spent = if window { 0 } else { spent };
            let exceeded = !idle && {
                spent += half_arrays;
                spent > limit
            };
            if !idle {
                assert_eq!(bench.is("exceeded"), exceeded, "run {run}, clock {clock}");
            }
            bench.tick();
            if exceeded {
                break;
            }
        }
    }
}
