//! Tests of the FIFO between the clocks.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use std::collections::VecDeque;

laws![the_fifo_gives_every_byte_once_and_in_order_whatever_the_clocks];

fn the_fifo_gives_every_byte_once_and_in_order_whatever_the_clocks(project: &Project) {
    let mut bench = Bench::new(project, "byte_fifo");
    for (fast, slow) in [("write", "read"), ("read", "write")] {
        for ratio in [1, 2, 3, 7] {
            bench.reset("clk_write", "rst_write");
            bench.reset("clk_read", "rst_read");
            let dice = &mut Dice::new(ratio);
            let mut inside = VecDeque::new();
            let mut passed = 0;
            let (mut was_full, mut was_empty) = (false, false);
            for clock in 0..20_000u64 {
                let side = if clock % (ratio + 1) == 0 { slow } else { fast };
                // Bursts of writes fill the FIFO and bursts of reads drain it.
                let eager = (clock / 700).is_multiple_of(3) != (side == "write");
                let wants = if eager { !dice.once_in(8) } else { dice.once_in(32) };
                if side == "write" {
                    let full = bench.is("full");
                    let word = dice.next() & 0x1FF;
                    bench.set("push", wants);
                    bench.set("push_data", word);
                    if wants && !full {
                        inside.push_back(word);
                    }
                    was_full |= full;
                    bench.edge("clk_write");
                    assert!(inside.len() <= 16, "overrun");
                } else {
                    let empty = bench.is("empty");
                    bench.set("pop", wants);
                    if !empty {
                        assert_eq!(Some(bench.get("pop_data")), inside.front().copied());
                        if wants {
                            inside.pop_front();
                            passed += 1;
                        }
                    }
                    was_empty |= empty;
                    bench.edge("clk_read");
                }
            }
            assert!(was_full && was_empty && passed > 300, "{passed} passed");
        }
    }
}
