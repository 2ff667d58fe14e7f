//! Tests of the synchroniser of one bit.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;

laws![a_level_comes_out_two_clocks_after_it_went_in];

fn a_level_comes_out_two_clocks_after_it_went_in(project: &Project) {
    let mut bench = Bench::new(project, "synchroniser");
    let dice = &mut Dice::new(1);
    let mut inside = [false; 2];
    for clock in 0..500 {
        let level = dice.once_in(2);
        bench.set("from", level);
        assert_eq!(bench.is("to"), inside[1], "clock {clock}");
        inside = [level, inside[0]];
        bench.tick();
    }
}
