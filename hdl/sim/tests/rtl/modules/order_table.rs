//! Tests of the order table's two copies.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;

laws![host_and_sequencer_read_what_was_written_two_clocks_after_they_ask];

fn host_and_sequencer_read_what_was_written_two_clocks_after_they_ask(project: &Project) {
    let mut bench = Bench::new(project, "order_table");
    let dice = &mut Dice::new(3);
    let mut table = [0; 1024];
    bench.set("write", true);
    for (address, entry) in table.iter_mut().enumerate() {
        *entry = dice.range(0, 1023);
        bench.set("host_address", address as u64);
        // The host writes whole words; the table keeps ten bits.
        bench.set("host_data", dice.next() << 10 | *entry);
        bench.tick();
    }
    bench.set("write", false);
    let mut asked = [(0, 0); 2];
    for clock in 0..3000 {
        if clock >= 2 {
            let (host, index) = asked[1];
            assert_eq!(bench.get("host_entry"), table[host]);
            assert_eq!(bench.get("entry"), table[index]);
        }
        let (host, index) = (dice.range(0, 1023), dice.range(0, 1023));
        bench.set("host_address", host);
        bench.set("index", index);
        asked = [(host as usize, index as usize), asked[0]];
        bench.tick();
    }
}
