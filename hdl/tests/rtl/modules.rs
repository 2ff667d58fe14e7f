//! Single modules against what they promise, in numbers of the test itself.

use crate::bench::Bench;
use crate::scenario::Dice;
use nirspi_wire::{
    crc32,
    register::{TEST_SEED, test_sample},
};
use std::collections::VecDeque;

#[test]
fn the_checksum_is_that_of_wire() {
    let mut bench = Bench::new("crc32");
    let dice = &mut Dice::new(1);
    for length in [0, 1, 9, 300] {
        let bytes: Vec<u8> = (0..length).map(|_| dice.next() as u8).collect();
        bench.set("clear", 1);
        bench.edge("clk");
        bench.set("clear", 0);
        for &byte in &bytes {
            // Clocks without `take` must not count.
            bench.set("octet", dice.next());
            bench.set("take", 0);
            bench.edge("clk");
            bench.set("octet", byte.into());
            bench.set("take", 1);
            bench.edge("clk");
        }
        bench.set("take", 0);
        assert_eq!(bench.get("value"), u64::from(crc32(&bytes)));
    }
}

#[test]
fn the_fifo_gives_every_byte_once_and_in_order_whatever_the_clocks() {
    let mut bench = Bench::new("byte_fifo");
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
                // Bursts of either kind fill and drain it.
                let eager = (clock / 700).is_multiple_of(3) != (side == "write");
                let wants = if eager { !dice.once_in(8) } else { dice.once_in(32) };
                if side == "write" {
                    let full = bench.get("full") != 0;
                    let word = dice.next() & 0x1FF;
                    bench.set("push", wants.into());
                    bench.set("push_data", word);
                    if wants && !full {
                        inside.push_back(word);
                    }
                    was_full |= full;
                    bench.edge("clk_write");
                    assert!(inside.len() <= 16, "overrun");
                } else {
                    let empty = bench.get("empty") != 0;
                    bench.set("pop", wants.into());
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

#[test]
fn the_test_generator_is_that_of_the_register_map() {
    let mut bench = Bench::new("source");
    bench.reset("clk", "rst");
    bench.set("test", 1);
    bench.set("over_range", 1);
    bench.set("start", 1);
    bench.edge("clk");
    bench.set("start", 0);
    let mut expected = TEST_SEED;
    for _ in 0..1 << 14 {
        bench.edge("clk");
        assert_eq!(bench.get("sample"), u64::from(expected), "over-range bit, code");
        expected = test_sample(expected);
    }
}

#[test]
fn the_light_budget_is_a_sum_over_its_window() {
    let mut bench = Bench::new("duty");
    bench.reset("clk", "rst");
    let dice = &mut Dice::new(3);
    let mut spent = 0u64;
    for run in 0..200 {
        // A run: idle clocks in which the limit is set anew, then lit ones until it is exceeded.
        let limit = dice.range(0, 60);
        bench.set("limit", limit);
        bench.set("running", 0);
        for clock in 0..dice.range(4, 9) + 200 {
            let idle = clock < 4;
            let window = dice.once_in(40);
            let half_arrays = dice.range(0, 2);
            bench.set("window_first", window.into());
            bench.set("running", (!idle).into());
            bench.set("spends", (!idle).into());
            bench.set("half_arrays", half_arrays);
            spent = if window { 0 } else { spent };
            let exceeded = !idle && {
                spent += half_arrays;
                spent > limit
            };
            if !idle {
                assert_eq!(bench.get("exceeded") != 0, exceeded, "run {run}, clock {clock}");
            }
            bench.edge("clk");
            if exceeded {
                break;
            }
        }
    }
}

/// `types::Place` of a slot's last sample, as the port packs it.
fn last_sample(index: u64, complement: bool, first_sweep: bool) -> u64 {
    1 << 18 | 1 << 16 | index << 5 | u64::from(complement) << 4 | u64::from(first_sweep) << 3
}

/// The sums of the accumulators' bank 0, in which everything was summed.
struct Accumulators {
    bench: Bench,
    /// The sum comes a clock after its slot.
    sum: u64,
    overflows: usize,
}

impl Accumulators {
    fn new() -> Self {
        let mut bench = Bench::new("accumulators");
        bench.reset("clk", "rst");
        bench.set("filling", 0);
        Self { bench, sum: 0, overflows: 0 }
    }

    fn clock(&mut self, place: u64, sum: u64) {
        self.bench.set("place", place);
        self.bench.set("sum", self.sum);
        self.sum = sum;
        self.overflows += self.bench.get("overflow") as usize;
        self.bench.edge("clk");
    }

    fn read(&mut self, index: u64, complement: bool) -> u64 {
        for _ in 0..8 {
            self.clock(0, 0);
        }
        self.bench.set("filling", 1);
        self.bench.set("host_address", u64::from(complement) << 10 | index);
        for _ in 0..3 {
            self.bench.edge("clk");
        }
        let word = self.bench.get("host_word");
        self.bench.set("filling", 0);
        word
    }
}

#[test]
fn every_slot_is_added_once_however_soon_it_comes_again() {
    let mut sums = Accumulators::new();
    let dice = &mut Dice::new(5);
    let mut expected = [[0u64; 2]; 1024];
    for (index, pair) in expected.iter_mut().enumerate() {
        for (complement, sum) in [false, true].into_iter().zip(pair) {
            *sum = dice.range(0, (1 << 30) - 1);
            sums.clock(last_sample(index as u64, complement, true), *sum);
        }
    }
    // Of few addresses, so that they come back after 1, 2, 3... clocks; with clocks between.
    for round in 0..30_000 {
        if dice.once_in(3) {
            sums.clock(0, dice.range(0, (1 << 30) - 1));
        }
        let index = dice.range(0, 1 + round / 5000);
        let complement = dice.once_in(2);
        let sum = dice.range(0, (1 << 30) - 1);
        let first = dice.once_in(50);
        let so_far = &mut expected[index as usize][usize::from(complement)];
        *so_far = if first { sum } else { *so_far + sum };
        sums.clock(last_sample(index, complement, first), sum);
    }
    for index in [0, 1, 2, 3, 4, 5, 6, 7, 511, 512, 1023] {
        for complement in [false, true] {
            let expected = expected[index as usize][usize::from(complement)];
            assert_eq!(sums.read(index, complement), expected, "{index} {complement}");
        }
    }
    assert_eq!(sums.overflows, 0);
}

#[test]
fn a_word_wraps_at_48_bits_and_says_so_in_that_clock() {
    let mut sums = Accumulators::new();
    const LARGEST: u64 = (1 << 30) - 1;
    let mut exact = 0;
    for slot in 0..1 << 18 {
        sums.clock(last_sample(7, true, slot == 0), LARGEST);
        exact += LARGEST;
    }
    let short_of_it = (1 << 48) - 1 - exact;
    sums.clock(last_sample(7, true, false), short_of_it);
    assert_eq!(sums.read(7, true), (1 << 48) - 1);
    assert_eq!(sums.overflows, 0);
    sums.clock(last_sample(7, true, false), 5);
    assert_eq!(sums.read(7, true), 4);
    assert_eq!(sums.overflows, 1);
}
