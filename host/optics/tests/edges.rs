//! What the LEDs' edges promise: the light that 1024 LEDs give, each with a state of its own.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use crate::footprint;
use nirspi_optics::{Chain, ChainSettings, LedArray, LedEdges, SIDE};
use proptest::prelude::*;

/// Parts of an ADC clock in which the slow simulation advances.
const PARTS: u32 = 128;
const CLOCK_NS: f64 = 8.0;

/// One LED.
#[derive(Clone, Copy)]
struct Led {
    electrons: f64,
    light: f64,
    /// As its line has it, and as it acts until it has waited.
    goal: f64,
    acts: f64,
    /// Parts of a clock until the LED follows its line.
    waits: u32,
}

/// LEDs and amplifier in steps of a small part of a clock.
struct Slow {
    leds: Vec<Led>,
    rise: f64,
    fall: f64,
    delays: [u32; 2],
    amplifier: f64,
    amplified: f64,
    sum: f64,
}

impl Slow {
    fn new(electrons: &[f64], edges: &LedEdges, delays: [u32; 2], bandwidth_hz: f64) -> Self {
        let part_ns = CLOCK_NS / f64::from(PARTS);
        let kept = |edge_ns: f64| (-part_ns * 9.0_f64.ln() / edge_ns).exp();
        let led = |&electrons: &f64| Led { electrons, light: 0.0, goal: 0.0, acts: 0.0, waits: 0 };
        Self {
            leds: electrons.iter().map(led).collect(),
            rise: kept(edges.rise_ns),
            fall: kept(edges.fall_ns),
            delays,
            amplifier: (-part_ns * 1e-9 * std::f64::consts::TAU * bandwidth_hz).exp(),
            amplified: 0.0,
            sum: 0.0,
        }
    }

    /// The amplifier's output at the end of a clock in which these LEDs are lit.
    fn clock(&mut self, lit: impl Fn(usize) -> bool) -> f64 {
        for (at, led) in self.leds.iter_mut().enumerate() {
            let goal = f64::from(u8::from(lit(at)));
            if led.waits == 0 {
                led.acts = led.goal;
            }
            if goal != led.goal {
                (led.goal, led.waits) = (goal, self.delays[usize::from(goal == 0.0)]);
            }
        }
        for _ in 0..PARTS {
            let before = self.sum;
            self.sum = 0.0;
            for led in &mut self.leds {
                if led.waits == 0 {
                    led.acts = led.goal;
                }
                let kept = if led.acts == 0.0 { self.fall } else { self.rise };
                led.light = led.acts + (led.light - led.acts) * kept;
                led.waits = led.waits.saturating_sub(1);
                self.sum += led.electrons * led.light;
            }
            let mean = (before + self.sum) / 2.0;
            self.amplified = mean + (self.amplified - mean) * self.amplifier;
        }
        self.amplified
    }
}

/// Lines from a seed: mostly Walsh patterns and their complements, as of the gateware.
fn lines(seed: u32, slot: u32) -> (u32, u32, bool) {
    let mixed = (seed ^ (slot / 2)).wrapping_mul(0x9e37_79b1);
    let parity = |k: u32| (0..32).fold(0_u32, |lines, i| lines | ((k & i).count_ones() & 1) << i);
    let (rows, columns) = (parity(mixed >> 27), parity(mixed >> 22 & 31));
    let enabled = mixed >> 12 & 7 != 0;
    (if slot % 2 == 1 { !rows } else { rows }, columns, enabled)
}

/// The largest difference to the slow simulation, in shares of the light of all LEDs.
fn largest_error(
    edges: LedEdges,
    delays: [u32; 2],
    bandwidth_mhz: f64,
    dwell: u32,
    seed: u32,
) -> f64 {
    let footprint = footprint();
    let all: f64 = footprint.weights().iter().map(|&weight| f64::from(weight)).sum();
    let per_led = 13_000.0 / all;
    let electrons: Vec<f64> =
        footprint.weights().iter().map(|&weight| f64::from(weight) * per_led).collect();
    let bandwidth_hz = bandwidth_mhz * 1e6;
    let settings = ChainSettings {
        led: edges,
        amplifier_bandwidth_hz: bandwidth_hz,
        adc_offset_counts: 1000,
        ..ChainSettings::ideal()
    };
    let mut chain = Chain::new(settings, 0).unwrap();
    let mut array = LedArray::new(&footprint, per_led);
    let mut slow = Slow::new(&electrons, &edges, delays, bandwidth_hz);
    let mut largest = 0.0_f64;
    for slot in 0..24 {
        let (rows, columns, enabled) = lines(seed, slot);
        for _ in 0..dwell {
            let found = f64::from(chain.sample(array.step(rows, columns, enabled)).counts) - 1000.0;
            let lit =
                |at: usize| enabled && (rows >> (at / SIDE) & 1) == (columns >> (at % SIDE) & 1);
            largest = largest.max((found - slow.clock(lit)).abs() / 13_000.0);
        }
    }
    largest
}

/// Parts of a clock, as a time.
fn ns(parts: u32) -> f64 {
    f64::from(parts) * CLOCK_NS / f64::from(PARTS)
}

/// The circuit's edges (boards/electronics).
fn circuit() -> LedEdges {
    LedEdges { rise_ns: 12.8, fall_ns: 16.3, turn_on_delay_ns: ns(20), turn_off_delay_ns: 0.0 }
}

/// Rounding to counts is 0.00004 of 13 000; the slow simulation's parts leave the rest.
const ROUNDING: f64 = 3e-4;

#[test]
fn the_pools_agree_with_1024_leds_of_their_own() {
    for seed in [1, 77, 4096] {
        let error = largest_error(circuit(), [20, 0], 60.5, 5, seed);
        assert!(error < 3e-4, "{error}");
    }
}

/// The chain's three ways give the same samples, with noise.
#[test]
fn a_clock_without_a_change_is_one_with_the_same_light() {
    let settings = ChainSettings { led: circuit(), line_electrons: 2000.0, ..Default::default() };
    let mut array = LedArray::new(&footprint(), 26.0);
    let [mut every, mut changes] = [(); 2].map(|()| Chain::new(settings, 3).unwrap());
    assert!(every.sees_switching());
    for slot in 0..24 {
        let (rows, columns, enabled) = lines(5, slot);
        for clock in 0..5 {
            let light = array.step(rows, columns, enabled);
            let new = (clock == 0).then_some(light);
            assert_eq!(every.sample(light), changes.sample_switching(new), "{slot} {clock}");
        }
    }
    let settings = ChainSettings::default();
    let [mut any, mut linear] = [(); 2].map(|()| Chain::new(settings, 3).unwrap());
    assert!(!any.sees_switching());
    for light in (0..200_u16).map(|i| f32::from(i / 5 * 977 % 9000)) {
        assert_eq!(any.sample(light), linear.sample_sum(light));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// The error is that of the rest which an LED keeps in the wrong pool.
    #[test]
    fn any_edges_agree_within_what_an_unsettled_led_keeps(
        rise_ns in 3.0..20.0, fall_ns in 3.0..20.0, on in 0_u32..=PARTS, off in 0_u32..=PARTS,
        bandwidth_mhz in 20.0..200.0, dwell in 4_u32..7, seed: u32,
    ) {
        let edges = LedEdges { rise_ns, fall_ns, turn_on_delay_ns: ns(on), turn_off_delay_ns: ns(off) };
        let error = largest_error(edges, [on, off], bandwidth_mhz, dwell, seed);
        let [rise, fall] = [rise_ns, fall_ns].map(|edge: f64| edge / 9.0_f64.ln());
        let between = f64::from(dwell) * CLOCK_NS - ns(on.max(off));
        let rest = (-between / rise.max(fall)).exp();
        let apart = |t: f64| {
            let left = |tau: f64, delay: f64| if t < delay { 1.0 } else { ((delay - t) / tau).exp() };
            // The pool of the old switch decays on while an LED waits for the new one.
            (left(rise, ns(on)) - (-t / fall).exp()).abs().max((left(fall, ns(off)) - (-t / rise).exp()).abs())
        };
        let most = (0..400).map(|i| apart(f64::from(i) * 0.1)).fold(0.0, f64::max);
        prop_assert!(error < ROUNDING + rest * most, "{} > {}", error, ROUNDING + rest * most);
    }

    /// With rise and fall alike nothing is left of the difference, however slow the LEDs.
    #[test]
    fn edges_that_are_alike_are_exact(edge_ns in 3.0..60.0, delay in 1_u32..=PARTS, dwell in 1_u32..7, seed: u32) {
        let edges = LedEdges {
            turn_on_delay_ns: ns(delay),
            turn_off_delay_ns: ns(delay),
            ..LedEdges::alike(edge_ns)
        };
        prop_assert!(edges.are_alike());
        let error = largest_error(edges, [delay; 2], 60.0, dwell, seed);
        prop_assert!(error < ROUNDING, "{}", error);
    }
}
