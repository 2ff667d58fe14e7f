//! All stages together, without a camera around them: differential Hadamard readings of a target,
//! inverted by the definition, with the noise, daylight and settling of the default settings.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use nirspi_optics::{
    Budget, BudgetSettings, Chain, ChainSettings, Footprint, LEDS, LedArray, Projector, SIDE, Scene,
};

const SAMPLES_PER_PATTERN: u32 = 5;

/// A letter E that fills the field, 16 x 16.
fn letter(field_mm: f64) -> Scene {
    let rows: [u16; 16] = [
        0, 0, 0x1ff8, 0x1ff8, 0x1800, 0x1800, 0x1800, 0x1fe0, 0x1fe0, 0x1800, 0x1800, 0x1800,
        0x1ff8, 0x1ff8, 0, 0,
    ];
    let pixels =
        rows.iter().flat_map(|row| (0..16).rev().map(move |bit| f32::from(row >> bit & 1)));
    Scene::new(pixels.collect(), 16, field_mm).unwrap()
}

fn lines(k: usize) -> u32 {
    (0..SIDE).fold(0, |lines, i| lines | ((k & i).count_ones() & 1) << i)
}

/// The image from `sweeps` differential sweeps in natural order.
fn capture(footprint: &Footprint, budget: &Budget, sweeps: u32) -> Vec<f64> {
    let mut settings = ChainSettings {
        ambient_electrons: budget.ambient_electrons(footprint.mean()),
        adc_latency_clocks: 0,
        ..ChainSettings::default()
    };
    settings.electrons_per_count = settings.auto_gain(budget).unwrap();
    let mut chain = Chain::new(settings, 2023).unwrap();
    let mut leds = LedArray::new(footprint, budget.electrons_per_led);
    let mut readings = vec![0.0; LEDS];
    for _ in 0..sweeps {
        for (k, reading) in readings.iter_mut().enumerate() {
            for (sign, rows) in [(1.0, lines(k / SIDE)), (-1.0, !lines(k / SIDE))] {
                let light = leds.light(rows, lines(k % SIDE), true);
                for sample in 0..SAMPLES_PER_PATTERN {
                    let sample_counts = chain.sample(light).counts;
                    // the LEDs are still settling in the first two
                    if sample >= 2 {
                        *reading += sign * f64::from(sample_counts);
                    }
                }
            }
        }
    }
    let sign = |k: usize, i: usize| 1.0 - 2.0 * f64::from((k & i).count_ones() & 1);
    (0..LEDS).map(|i| readings.iter().enumerate().map(|(k, y)| sign(k, i) * y).sum()).collect()
}

fn correlation(a: &[f64], b: &[f32]) -> f64 {
    let n = a.len() as f64;
    let mean_a = a.iter().sum::<f64>() / n;
    let mean_b = b.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (&a, &b) in a.iter().zip(b) {
        let (a, b) = (a - mean_a, f64::from(b) - mean_b);
        (ab, aa, bb) = (ab + a * b, aa + a * a, bb + b * b);
    }
    ab / (aa * bb).sqrt()
}

fn seen_at(distance_mm: f64, sweeps: u32) -> f64 {
    let projector = Projector::default();
    let scene = letter(projector.field_mm(distance_mm));
    let footprint = projector.footprint(&scene, distance_mm).unwrap();
    let budget = Budget::new(&BudgetSettings::default(), &projector, distance_mm).unwrap();
    let correlation = correlation(&capture(&footprint, &budget, sweeps), footprint.weights());
    println!("{distance_mm} mm, {sweeps} sweeps: correlation {correlation:.3}");
    correlation
}

#[test]
fn a_letter_is_plain_at_the_focus_and_still_there_at_one_metre() {
    // 244 differential sweeps are 20 ms, the paper's T_pre (Table 1).
    assert!(seen_at(300.0, 1) > 0.3);
    assert!(seen_at(300.0, 244) > 0.98);
    assert!(seen_at(600.0, 244) > 0.8);
    assert!(seen_at(1000.0, 244) > 0.4);
}
