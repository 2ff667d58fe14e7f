//! Tests of the sum of a frame's samples.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::ADC_MAX;
use std::collections::VecDeque;

/// Clocks from a sample to the sum with it.
const STAGES: usize = 5;

laws![a_sum_is_of_the_frames_samples_so_far_that_count, a_sum_goes_on_beyond_its_low_word,];

fn a_sum_is_of_the_frames_samples_so_far_that_count(project: &Project) {
    let mut bench = Bench::new(project, "sample_total");
    let dice = &mut Dice::new(44);
    let mut total = 0u64;
    let mut stages: VecDeque<u64> = VecDeque::new();
    let mut frames = 0;
    for clock in 0..4000 {
        let first = clock == 0 || dice.once_in(60);
        let counts = !dice.once_in(3);
        let code = dice.range(0, ADC_MAX.into());
        bench.set("first", first);
        bench.set("counts", counts);
        bench.set("code", code);
        total = if first { 0 } else { total } + if counts { code } else { 0 };
        frames += u64::from(first);
        stages.push_back(total);
        if stages.len() > STAGES {
            assert_eq!(Some(bench.get("total")), stages.pop_front(), "clock {clock}");
        }
        bench.tick();
    }
    assert!(frames > 40, "{frames}");
}

/// The brightest light: 2^32 after 2.1 ms.
fn a_sum_goes_on_beyond_its_low_word(project: &Project) {
    let mut bench = Bench::new(project, "sample_total");
    bench.set("first", true);
    bench.set("counts", true);
    bench.set("code", ADC_MAX);
    bench.tick();
    bench.set("first", false);
    const CLOCKS: u64 = 300_000;
    for _ in 1..CLOCKS {
        bench.tick();
    }
    // Nothing more comes.
    bench.set("counts", false);
    for _ in 0..STAGES {
        bench.tick();
    }
    let expected = CLOCKS * u64::from(ADC_MAX);
    assert!(expected > 1 << 32);
    assert_eq!(bench.get("total"), expected);
}
