//! Tests of the three banks of sums.

use super::bundles::Place;
use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;

laws![
    every_slot_is_added_once_however_soon_it_comes_again,
    a_word_wraps_at_48_bits_and_says_so_in_that_clock,
    the_host_reads_any_bank_while_another_is_being_filled,
];

/// The place of a slot's last sample, as a number.
fn last_sample(index: u64, complement: bool, sweep_first: bool) -> u64 {
    let place = Place { slot_last: true, index, complement, sweep_first, ..Place::default() };
    Place::fields(Some(place)).iter().fold(0, |word, &(value, width)| word << width | value)
}

/// The module; all sums go to bank 0.
struct Accumulators {
    bench: Bench,
    /// The sum of the slot before: a sum comes a clock after its slot.
    sum: u64,
    overflows: usize,
}

impl Accumulators {
    fn new(project: &Project) -> Self {
        let mut bench = Bench::new(project, "accumulators");
        bench.set("filling", 1u64);
        Self { bench, sum: 0, overflows: 0 }
    }

    fn clock(&mut self, place: u64, sum: u64) {
        self.bench.set("place", place);
        self.bench.set("sum", self.sum);
        self.sum = sum;
        self.overflows += self.bench.get("overflow") as usize;
        self.bench.tick();
    }

    fn read(&mut self, index: u64, complement: bool) -> u64 {
        for _ in 0..8 {
            self.clock(0, 0);
        }
        self.bench.set("filling", 2u64);
        self.bench.set("reading", 1u64);
        self.bench.set("host_address", u64::from(complement) << 10 | index);
        for _ in 0..3 {
            self.bench.tick();
        }
        let word = self.bench.get("host_word");
        self.bench.set("filling", 1u64);
        word
    }
}

fn every_slot_is_added_once_however_soon_it_comes_again(project: &Project) {
    let mut sums = Accumulators::new(project);
    let dice = &mut Dice::new(5);
    let mut expected = [[0u64; 2]; 1024];
    for (index, pair) in expected.iter_mut().enumerate() {
        for (complement, sum) in [false, true].into_iter().zip(pair) {
            *sum = dice.range(0, (1 << 30) - 1);
            sums.clock(last_sample(index as u64, complement, true), *sum);
        }
    }
    // Few addresses, so that an address comes back after 1, 2, 3... clocks, with idle clocks
    // between.
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

fn a_word_wraps_at_48_bits_and_says_so_in_that_clock(project: &Project) {
    let mut sums = Accumulators::new(project);
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

fn the_host_reads_any_bank_while_another_is_being_filled(project: &Project) {
    let mut sums = Accumulators::new(project);
    // One bank after the other, each with its own sums of two sweeps.
    for bank in 0..3u64 {
        sums.bench.set("filling", 1u64 << bank);
        for first in [true, false] {
            for index in 0..1024 {
                let sum = if first { 100 * bank } else { index };
                sums.clock(last_sample(index, true, first), sum);
            }
        }
        for _ in 0..8 {
            sums.clock(0, 0);
        }
    }
    for (filling, reading) in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)] {
        // The bank changes after the last stage of what was summed.
        for _ in 0..8 {
            sums.clock(0, 0);
        }
        sums.bench.set("filling", 1u64 << filling);
        sums.bench.set("reading", 1u64 << reading);
        for index in [0, 1, 700, 1023] {
            sums.bench.set("host_address", 1 << 10 | index);
            // Meanwhile the other bank is summed into.
            let slot = last_sample(index, true, false);
            for _ in 0..3 {
                sums.clock(slot, 0);
            }
            assert_eq!(sums.bench.get("host_word"), 100 * reading + index, "{filling} {reading}");
        }
    }
}
