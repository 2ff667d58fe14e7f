//! Tests of the checksum.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::crc32;

laws![the_checksum_is_that_of_wire];

fn the_checksum_is_that_of_wire(project: &Project) {
    let mut bench = Bench::new(project, "crc32");
    let dice = &mut Dice::new(1);
    for length in [0, 1, 9, 300] {
        let bytes: Vec<u8> = (0..length).map(|_| dice.next() as u8).collect();
        bench.set("clear", true);
        bench.tick();
        bench.set("clear", false);
        for &byte in &bytes {
            // A clock without `take` must not count its octet.
            bench.set("octet", dice.next());
            bench.set("take", false);
            bench.tick();
            bench.set("octet", byte);
            bench.set("take", true);
            bench.tick();
        }
        bench.set("take", false);
        assert_eq!(bench.get("value"), u64::from(crc32(&bytes)));
    }
}
