//! What the LED array promises: light that follows the lines.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use crate::footprint;
use nirspi_optics::{Footprint, LEDS, LedArray, SIDE};
use proptest::prelude::*;
use std::sync::LazyLock;

#[test]
fn nothing_is_lit_unless_enabled() {
    let mut leds = LedArray::new(&footprint(), 100.0);
    assert!(leds.light(0, 0, true) > 0.0);
    assert_eq!(leds.light(0, 0, false), 0.0);
}

#[test]
fn lines_light_the_leds_of_the_walsh_pattern_they_stand_for() {
    let footprint = footprint();
    let mut leds = LedArray::new(&footprint, 1.0);
    for k in [0_usize, 1, 31, 32, 33, 500, 777, 1023] {
        // DESIGN section 3: sign = (-1)^(popcount(k_hi & r) + popcount(k_lo & c))
        let parity = |k: usize, i: usize| (k & i).count_ones() & 1;
        let line = |k: usize| (0..SIDE).fold(0_u32, |lines, i| lines | parity(k, i) << i);
        let mut expected = 0.0;
        for (i, &w) in footprint.weights().iter().enumerate() {
            if (parity(k / SIDE, i / SIDE) + parity(k % SIDE, i % SIDE)) % 2 == 0 {
                expected += f64::from(w);
            }
        }
        let found = f64::from(leds.light(line(k / SIDE), line(k % SIDE), true));
        assert!((found - expected).abs() < 1e-3, "pattern {k}: {found} against {expected}");
    }
}

proptest! {
    #[test]
    fn a_pattern_and_its_complement_light_every_led_once(rows: u32, cols: u32) {
        let mut leds = LedArray::new(&footprint(), 26.0);
        let all = leds.light(0, 0, true);
        let both = leds.light(rows, cols, true) + leds.light(!rows, cols, true);
        prop_assert!((both / all - 1.0).abs() < 1e-6, "{both} of {all}");
        // Inverting both sides of every XOR changes nothing.
        prop_assert_eq!(leds.light(rows, cols, true), leds.light(!rows, !cols, true));
    }

    #[test]
    fn remembering_a_state_never_changes_its_light(states in prop::collection::vec(any::<(u8, u8)>(), 1..200)) {
        let footprint = footprint();
        let mut remembering = LedArray::new(&footprint, 26.0);
        for (rows, cols) in states {
            let (rows, cols) = (u32::from(rows).pow(3), u32::from(cols).pow(3));
            let fresh = LedArray::new(&footprint, 26.0).light(rows, cols, true);
            prop_assert_eq!(remembering.light(rows, cols, true), fresh);
        }
    }
}

#[test]
fn states_that_differ_in_one_line_are_remembered_apart() {
    let footprint = footprint();
    let mut remembering = LedArray::new(&footprint, 26.0);
    let lines = |bit: u32| if bit < 32 { (1 << bit, 0) } else { (0, 1 << (bit - 32)) };
    for (rows, cols) in (0..64).map(lines) {
        remembering.light(rows, cols, true);
    }
    for (rows, cols) in (0..64).map(lines) {
        let fresh = LedArray::new(&footprint, 26.0).light(rows, cols, true);
        assert_eq!(remembering.light(rows, cols, true), fresh, "{rows:#x} {cols:#x}");
    }
}

static SEEN: LazyLock<Footprint> = LazyLock::new(footprint);

/// Light of the LEDs for which this holds, one by one.
fn one_by_one(electrons: f64, lit: impl Fn(usize, usize) -> f64) -> f64 {
    let light = |(i, &w): (usize, &f32)| f64::from(w) * electrons * lit(i / SIDE, i % SIDE);
    SEEN.weights().iter().enumerate().map(light).sum()
}

fn is_lit((rows, cols, enabled): (u32, u32, bool), row: usize, column: usize) -> bool {
    enabled && rows >> row & 1 == cols >> column & 1
}

proptest! {
    #[test]
    fn the_light_of_switched_leds_is_that_of_leds_that_differ(
        // Few states, so that each comes after several others.
        rows: [u32; 3], cols: [u32; 3], order in prop::collection::vec((0_usize..3, 0_usize..3, 0..4), 1..40)
    ) {
        let mut leds = LedArray::new(&SEEN, 26.0);
        let mut before = (0, 0, false);
        for (row, col, off) in order {
            let now = (rows[row], cols[col], off != 0);
            let light = leds.step(now.0, now.1, now.2);
            let differs = |row, column| {
                f64::from(u8::from(is_lit(now, row, column) != is_lit(before, row, column)))
            };
            let expected = one_by_one(26.0, differs);
            prop_assert!((f64::from(light.switched) - expected).abs() < 0.01, "{} {}", light.switched, expected);
            prop_assert_eq!(light.settled, leds.light(now.0, now.1, now.2));
            let high = |(rows, cols, _): (u32, u32, bool)| (rows.count_ones() + cols.count_ones()) as i8;
            prop_assert_eq!(light.lines_risen, high(now) - high(before));
            // A second clock with the same lines switches nothing.
            let again = leds.step(now.0, now.1, now.2);
            prop_assert_eq!((again.switched, again.lines_risen, again.settled), (0.0, 0, light.settled));
            before = now;
        }
    }

    #[test]
    fn a_tile_loses_light_by_its_own_lit_leds(rows: u32, cols: u32, sag in 0.0..0.5) {
        let mut leds = LedArray::new(&SEEN, 26.0).with_tile_sag(sag);
        let now = (rows, cols, true);
        let mut lit_of_tile = [[0.0; 4]; 4];
        for (row, column) in (0..LEDS).map(|i| (i / SIDE, i % SIDE)) {
            lit_of_tile[row / 8][column / 8] += f64::from(u8::from(is_lit(now, row, column)));
        }
        let expected = one_by_one(26.0, |row, column| {
            f64::from(u8::from(is_lit(now, row, column))) * (1.0 - sag * lit_of_tile[row / 8][column / 8] / 64.0)
        });
        let found = f64::from(leds.light(rows, cols, true));
        prop_assert!((found - expected).abs() < 0.01, "{found} {expected}");
        // Switched light is of LEDs that lose nothing.
        let switched = f64::from(leds.step(rows, cols, true).switched);
        let lit = one_by_one(26.0, |row, column| f64::from(u8::from(is_lit(now, row, column))));
        prop_assert!((switched - lit).abs() < 0.01, "{switched} {lit}");
    }
}

#[test]
fn more_states_than_are_remembered_are_still_right() {
    let footprint = footprint();
    let mut leds = LedArray::new(&footprint, 26.0);
    for rows in 0..5000 {
        leds.light(rows, 5, true);
    }
    let fresh = LedArray::new(&footprint, 26.0).light(17, 5, true);
    assert_eq!(leds.light(17, 5, true), fresh);
}
