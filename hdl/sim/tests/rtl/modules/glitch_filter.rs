//! Tests of the filter before the host port's pins.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;

laws![
    a_level_comes_out_three_clocks_after_it_went_in,
    one_wrong_sample_in_a_period_of_six_changes_no_edge,
];

/// A filter, and the levels that it has given.
struct Rig(Bench, Vec<bool>);

impl Rig {
    fn new(project: &Project) -> Self {
        Self(Bench::new(project, "glitch_filter"), Vec::new())
    }

    fn sample(&mut self, level: bool) {
        self.0.set("from", level);
        let given = self.0.is("to");
        self.1.push(given);
        self.0.tick();
    }
}

fn a_level_comes_out_three_clocks_after_it_went_in(project: &Project) {
    let mut rig = Rig::new(project);
    let dice = &mut Dice::new(81);
    let mut levels = Vec::new();
    for period in 0..100 {
        levels.extend(vec![period % 2 == 1; dice.range(2, 6) as usize]);
    }
    levels.iter().for_each(|&level| rig.sample(level));
    assert_eq!(rig.1[3..], levels[..levels.len() - 3]);
}

fn one_wrong_sample_in_a_period_of_six_changes_no_edge(project: &Project) {
    let mut rig = Rig::new(project);
    let dice = &mut Dice::new(82);
    let periods = 300;
    for period in 0..periods {
        // One period in two has a glitch: as long as `sck` is low, high, or at its edges.
        let wrong = dice.range(0, 5) + 6 * (period % 2);
        for clock in 0..6 {
            rig.sample((clock >= 3) != (clock == wrong));
        }
    }
    let rises = rig.1.windows(2).filter(|pair| pair[1] && !pair[0]).count() as u64;
    assert_eq!(rises, periods - 1, "the last comes out after the end");

    // A level that stands: a pulse of one clock never comes out.
    for level in [false, true] {
        (0..4).for_each(|_| rig.sample(level));
        rig.1.clear();
        for _ in 0..40 {
            rig.sample(!level);
            (0..dice.range(2, 9)).for_each(|_| rig.sample(level));
        }
        assert!(rig.1.iter().all(|&given| given == level), "{level}");
    }
}
