//! What an image shows of LEDs that rise unlike they fall, and of a supply that sags: through the whole virtual camera,
//! without noise.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use nirspi::capture::Progress;
use nirspi::response::Settling;
use nirspi::setup::MeasurementSetup;
use nirspi_optics::{CameraModel, ChainSettings, Scene};
use nirspi_recon::{Order, reconstruct};
use nirspi_virtual::{VirtualOptics, calibrate_against_white, shoot};
use std::ops::ControlFlow;

/// The circuit's, boards/electronics/camera.toml.
const EDGES: &str = "[leds]\nrise_ns = 12.76\nfall_ns = 16.36\nturn_on_delay_ns = 1.22\n";

/// Grey levels that differ from LED to LED.
fn grey() -> Scene {
    Scene::new((0..1024).map(|i| (i * 7919 % 1000) as f32 / 1000.0).collect(), 32, 48.0).unwrap()
}

/// The image of all patterns in units of the light of one LED on white, and the light that each LED would give.
fn image(camera: &str, scene: Scene, shown: Shown) -> (Vec<f64>, Vec<f64>, ChainSettings) {
    let camera = CameraModel::parse(camera).unwrap();
    let optics = VirtualOptics::of(&camera, scene, 300.0).unwrap().noiseless();
    // What a sagging supply takes is left in the image.
    let settling = Settling { tile_sag: 0.0, ..calibrate_against_white(&optics, 1).unwrap() };
    let setup = optics.setup(&shown.order, 1.0).unwrap();
    let setup = MeasurementSetup { alternating: shown.alternating, ..setup };
    let mut go_on = |_: &Progress| ControlFlow::Continue(());
    let shot = shoot(&optics, setup, &settling, 12, 1, &mut go_on).unwrap();
    let unit = optics.chain().electrons_per_count / optics.budget().electrons_per_led;
    let image = reconstruct::hadamard(&shot.measurements().unwrap());
    let pixels = image.pixels().iter().map(|&counts| f64::from(counts) * unit).collect();
    let light = optics.footprint().weights().iter().map(|&weight| f64::from(weight)).collect();
    (pixels, light, *optics.chain())
}

/// Order of the patterns, and whether sweeps alternate.
#[derive(Debug, Clone)]
struct Shown {
    order: Order,
    alternating: bool,
}

fn alternating(order: Order) -> Shown {
    Shown { order, alternating: true }
}

fn pattern_first(order: Order) -> Shown {
    Shown { order, alternating: false }
}

/// The largest difference of two images, all pixels but the first.
fn largest_of_rest(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).skip(1).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn the_difference_of_rise_and_fall_is_in_pixel_0_0_alone_and_alternation_cancels_it() {
    for order in [Order::CakeCutting, Order::ZigZag] {
        // Of a scene with structure, pixel (0, 0) also shows what neighbouring patterns have in common. Of a white sheet, all
        // pairs are rounded alike, because no noise dithers them.
        let scenes: [(fn() -> Scene, f64); 2] = [(grey, 0.08), (Scene::white, 0.05)];
        for (scene, tolerance) in scenes {
            let (alike, light, _) = image("", scene(), alternating(order.clone()));
            assert!((alike[0] - light[0]).abs() < 0.02, "{order:?}: {} {}", alike[0], light[0]);

            let (seen, _, chain) = image(EDGES, scene(), pattern_first(order.clone()));
            let total: f64 = light.iter().sum();
            let expected = light[0] + total / 1024.0 * chain.first_pixel_off(5, 2);
            assert!(expected < -1.0, "{expected}");
            let off = (seen[0] / expected - 1.0).abs();
            assert!(off < tolerance, "{order:?}: {} {expected}", seen[0]);
            // What a pattern and the one before have in common lies in all pixels.
            let error = largest_of_rest(&seen, &alike);
            assert!(error < 0.05, "{order:?}: {error}");

            let (seen, ..) = image(EDGES, scene(), alternating(order.clone()));
            let error = (seen[0] - light[0]).abs().max(largest_of_rest(&seen, &alike));
            assert!(error < 0.02, "{order:?}: {error}");
        }
    }
}

#[test]
fn a_sagging_supply_takes_half_from_the_pixel_and_half_from_its_tile() {
    let sag = 0.1;
    let (stiff, ..) = image("", grey(), alternating(Order::CakeCutting));
    let (seen, ..) =
        image(&format!("[leds]\ntile_sag = {sag}"), grey(), alternating(Order::CakeCutting));
    let tile_mean = |at: usize| {
        let (row, column) = (at / 32 / 8 * 8, at % 32 / 8 * 8);
        (0..64).map(|i| stiff[(row + i / 8) * 32 + column + i % 8]).sum::<f64>() / 64.0
    };
    let expected: Vec<f64> =
        (0..1024).map(|at| stiff[at] - sag / 2.0 * (stiff[at] + tile_mean(at))).collect();
    let error = largest_of_rest(&seen, &expected);
    assert!(error < 0.01, "{error}");
}

/// 0.02 fF from each line is seen in the first column, and four sweeps that alternate cancel it.
#[test]
fn crosstalk_of_the_row_lines_is_in_the_first_column_and_alternation_cancels_it() {
    let order = Order::CakeCutting;
    let (shielded, ..) = image("", Scene::white(), alternating(order.clone()));
    let off = |shown: Shown| {
        let (seen, ..) = image("[leds]\nline_crosstalk_ff = 0.02", Scene::white(), shown);
        let off: Vec<f64> = seen.iter().zip(&shielded).map(|(a, b)| (a - b).abs()).collect();
        let column = off.iter().step_by(32).sum::<f64>() / 32.0;
        (column, (off.iter().sum::<f64>() - 32.0 * column) / 992.0)
    };
    let (column, rest) = off(pattern_first(order.clone()));
    assert!(column > 10.0 * rest, "{column} {rest}");
    let (cancelled, rest) = off(alternating(order));
    assert!(cancelled < column / 10.0 && rest < 0.002, "{cancelled} of {column}, {rest}");
}
