//! Tests of the detector of the bring-up design.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::register::loopback;

laws![a_sample_is_the_light_of_the_diagonal_four_clocks_before];

fn a_sample_is_the_light_of_the_diagonal_four_clocks_before(project: &Project) {
    let mut bench = Bench::new(project, "loopback");
    let dice = &mut Dice::new(81);
    let mut inside = std::collections::VecDeque::new();
    for clock in 0..2000 {
        let [rows, other] = [(); 2].map(|()| dice.next() as u32);
        let single = 1u32 << dice.range(0, 31);
        let columns = dice.pick(&[rows, !rows, rows ^ single, !rows ^ single, other]);
        let enable = !dice.once_in(5);
        bench.set("rows", rows);
        bench.set("columns", columns);
        bench.set("enable", enable);
        if inside.len() == 4 {
            let expected: u16 = inside.pop_front().unwrap();
            assert_eq!(bench.get("code"), u64::from(expected), "clock {clock}");
        }
        inside.push_back(loopback(rows, columns, enable));
        bench.tick();
    }
}
