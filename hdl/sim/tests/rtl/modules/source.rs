//! Tests of the ADC's samples and the test generator.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::register::{TEST_SEED, test_sample};

laws![
    the_test_generator_is_that_of_the_register_map,
    a_sample_leaves_two_clocks_after_it_was_at_the_pins,
];

fn the_test_generator_is_that_of_the_register_map(project: &Project) {
    let mut bench = Bench::new(project, "source");
    bench.set("test", true);
    bench.set("over_range", true);
    bench.set("start", true);
    bench.tick();
    bench.set("start", false);
    let mut expected = TEST_SEED;
    for _ in 0..1 << 14 {
        bench.tick();
        assert_eq!(bench.get("sample"), u64::from(expected), "over-range bit, code");
        expected = test_sample(expected);
    }
}

fn a_sample_leaves_two_clocks_after_it_was_at_the_pins(project: &Project) {
    let mut bench = Bench::new(project, "source");
    let dice = &mut Dice::new(14);
    let mut stages = [0; 2];
    for clock in 0..2000 {
        let (code, over_range) = (dice.range(0, 0x3FFF), dice.once_in(3));
        bench.set("code", code);
        bench.set("over_range", over_range);
        // A start affects the test generator alone.
        bench.set("start", dice.once_in(10));
        assert_eq!(bench.get("sample"), stages[1], "clock {clock}");
        stages = [u64::from(over_range) << 14 | code, stages[0]];
        bench.tick();
    }
}
