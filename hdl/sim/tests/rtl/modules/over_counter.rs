//! Tests of the count of over-range samples.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use std::collections::VecDeque;

/// Clocks from a sample to its count.
const STAGES: usize = 5;

laws![a_count_is_of_the_frame_so_far_and_trips_from_its_limit_on];

fn a_count_is_of_the_frame_so_far_and_trips_from_its_limit_on(project: &Project) {
    let mut bench = Bench::new(project, "over_counter");
    let dice = &mut Dice::new(5);
    let (mut trips_seen, mut frames) = (0, 0);
    for _ in 0..200 {
        // Settings change only between runs.
        let (trips, limit) = (!dice.once_in(4), dice.range(1, 12));
        bench.set("trips", trips);
        bench.set("trip", limit);
        let mut count = 0u64;
        let mut stages: VecDeque<(bool, u64)> = VecDeque::new();
        for clock in 0..dice.range(20, 100) {
            // A run, after some idle clocks whose samples do not count.
            let counts = clock >= 8;
            let first = clock == 8 || counts && dice.once_in(25);
            let over = dice.once_in(3);
            bench.set("counts", counts);
            bench.set("first", first);
            bench.set("over", over);
            count = if first { 0 } else { count } + u64::from(counts && over);
            frames += u64::from(first);
            stages.push_back((counts, count));
            if stages.len() > STAGES {
                let (counted, count) = stages.pop_front().unwrap();
                assert_eq!(
                    bench.is("reached"),
                    counted && trips && count >= limit,
                    "clock {clock}"
                );
                if counted {
                    assert_eq!(bench.get("count"), count, "clock {clock}");
                    assert_eq!(bench.is("any"), count > 0, "clock {clock}");
                }
                trips_seen += u64::from(bench.is("reached"));
            }
            bench.tick();
        }
        bench.set("counts", false);
        for _ in 0..STAGES {
            bench.tick();
        }
    }
    assert!(trips_seen > 100 && frames > 400, "{trips_seen} trips, {frames} frames");
}
