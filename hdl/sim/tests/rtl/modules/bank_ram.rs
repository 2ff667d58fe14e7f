//! Tests of the RAM that holds the sums.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use std::collections::BTreeMap;

laws![a_word_is_read_from_the_clock_after_its_writing_on];

fn a_word_is_read_from_the_clock_after_its_writing_on(project: &Project) {
    let mut bench = Bench::new(project, "bank_ram");
    let dice = &mut Dice::new(2);
    let mut words = BTreeMap::new();
    // The reads of the clocks before; `None` where the answer is undefined.
    let mut asked = [None; 2];
    let mut compared = 0;
    for clock in 0..20_000 {
        if let Some(word) = asked[1] {
            assert_eq!(bench.get("read_data"), word, "clock {clock}");
            compared += 1;
        }
        // A few addresses, the highest one among them.
        let address = |dice: &mut Dice| if dice.once_in(9) { 2047 } else { dice.range(0, 15) };
        let (from, to, word) = (address(dice), address(dice), dice.next() >> 16);
        let write = dice.once_in(2);
        bench.set("read_address", from);
        bench.set("write_address", to);
        bench.set("write_data", word);
        bench.set("write", write);
        let found = words.get(&from).copied().filter(|_| !(write && from == to));
        asked = [found, asked[0]];
        if write {
            words.insert(to, word);
        }
        bench.tick();
    }
    assert!(compared > 10_000);
}
