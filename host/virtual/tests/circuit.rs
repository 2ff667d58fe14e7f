//! A camera with the edges, the sag and the crosstalk of a real circuit gives the images of one whose LEDs are ideal:
//! calibrated and measured as a user would, with noise.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use nirspi::imaging::share_of_white;
use nirspi::response::Settling;
use nirspi::scene::SceneSource;
use nirspi::setup::MeasurementSetup;
use nirspi_optics::{CameraModel, Scene};
use nirspi_recon::{Image, Order, Rows, fwht, reconstruct};
use nirspi_virtual::{VirtualOptics, calibrate_against_white, shoot, white_level_at_target};
use std::ops::ControlFlow;

/// boards/electronics/camera.toml, and 0.1 pF from all 64 lines together to the amplifier.
const CIRCUIT: &str = "rise_ns = 12.76\nfall_ns = 16.36\nturn_on_delay_ns = 1.22\ntile_sag = 0.0165\n\
                       line_crosstalk_ff = 1.6";
/// Rise and fall alike, no sag, no crosstalk.
const IDEAL: &str = "edge_ns = 14.6";
/// Bright LEDs, so that few sweeps give pictures of 35 to 39 dB.
const LEDS: &str = "[leds]\npower_mw = 40\n";
const SWEEPS: u32 = 16;

/// A camera that knows its latency, its settling and a white sheet at the target.
struct Calibrated {
    camera: CameraModel,
    settling: Settling,
    white: f32,
}

impl Calibrated {
    fn new(leds: &str) -> Self {
        let camera = CameraModel::parse(&format!("{LEDS}{leds}")).unwrap();
        let optics = VirtualOptics::of(&camera, Scene::white(), 300.0).unwrap();
        let settling = calibrate_against_white(&optics, 1).unwrap();
        let white = white_level_at_target(&optics, &settling, None, 2).unwrap();
        Self { camera, settling, white }
    }

    /// The image in shares of the white sheet, and that of a camera without LEDs, receiver and noise.
    fn image(&self, scene: &Scene, shown: &Shown) -> (Image, Vec<f32>) {
        let optics = VirtualOptics::of(&self.camera, scene.clone(), 300.0).unwrap();
        let setup = optics.setup(&shown.order, shown.sampling).unwrap();
        let setup = MeasurementSetup { sweeps: 4, alternating: shown.alternating, ..setup };
        let truth = of_rows(optics.footprint().weights(), &setup.rows);
        let mut go_on = |_: &_| ControlFlow::Continue(());
        let shot = shoot(&optics, setup, &self.settling, SWEEPS / 4, 3, &mut go_on).unwrap();
        let image = reconstruct::hadamard(&shot.measurements().unwrap());
        (share_of_white(&image, self.white), truth)
    }
}

#[derive(Debug, Clone)]
struct Shown {
    order: Order,
    sampling: f64,
    alternating: bool,
}

/// The part of an image that these patterns see.
fn of_rows(image: &[f32], rows: &Rows) -> Vec<f32> {
    let mut light: Vec<f64> = image.iter().map(|&pixel| f64::from(pixel)).collect();
    fwht(&mut light).unwrap();
    let mut seen = vec![0.0; light.len()];
    for &row in rows.iter() {
        seen[row as usize] = light[row as usize] / light.len() as f64;
    }
    fwht(&mut seen).unwrap();
    seen.iter().map(|&pixel| pixel as f32).collect()
}

/// Grey levels that fall as one over frequency, as of natural scenes.
fn natural() -> Scene {
    let wave = |x: f64, y: f64| -> f64 {
        let term = |n: f64| {
            ((1.3 * n * x + 0.7 * n * n * y + 5.0 * n).sin() + (0.9 * n * y + n * n).cos()) / n
        };
        (1..12).map(|n| term(f64::from(n))).sum()
    };
    let grey = |i: usize| 0.5 + 0.14 * wave((i % 64) as f64 / 12.0, (i / 64) as f64 / 12.0);
    Scene::new((0..4096).map(|i| grey(i).clamp(0.0, 1.0) as f32).collect(), 64, 48.0).unwrap()
}

fn scenes() -> [(&'static str, Scene); 3] {
    let letter = SceneSource::Letter('R').load(256).unwrap();
    let letter = Scene::new(letter.reflectance, letter.size_px, 43.0).unwrap();
    [("white", Scene::white()), ("letter", letter), ("natural", natural())]
}

/// How far the corner is from that of the ideal camera, in shares of white, and what the image loses, in dB.
fn loss(circuit: &Calibrated, ideal: &Calibrated, scene: &Scene, shown: &Shown) -> (f64, f64) {
    let seen = [circuit, ideal].map(|camera| {
        let (image, truth) = camera.image(scene, shown);
        let error = image.pixels().iter().zip(&truth).map(|(a, b)| f64::from(a - b).powi(2));
        let psnr = -10.0 * (error.sum::<f64>() / truth.len() as f64).log10();
        (f64::from(image.pixels()[0]), psnr)
    });
    let [(corner, psnr), (ideal_corner, ideal_psnr)] = seen;
    ((corner - ideal_corner).abs(), ideal_psnr - psnr)
}

#[test]
fn a_circuits_camera_gives_the_images_of_ideal_leds() {
    let (circuit, ideal) = (Calibrated::new(CIRCUIT), Calibrated::new(IDEAL));
    for (name, scene) in scenes() {
        for order in [Order::ZigZag, Order::CakeCutting] {
            for sampling in [1.0, 0.5] {
                let shown = Shown { order: order.clone(), sampling, alternating: true };
                let (corner, lost_db) = loss(&circuit, &ideal, &scene, &shown);
                println!("{name}, {order}, {sampling}: corner {corner:.4}, {lost_db:.2} dB");
                assert!(corner < 0.02 && lost_db < 0.5, "{name}, {shown:?}: {corner} {lost_db}");
            }
        }
    }
}

/// What the sag of the circuit, and one that is six times as large, take from images.
#[test]
fn a_sag_that_was_measured_is_taken_back() {
    let ideal = Calibrated::new(IDEAL);
    let shown = Shown { order: Order::ZigZag, sampling: 1.0, alternating: true };
    // LEDs that sag by a tenth give less light.
    for (sag, most_db) in [(0.0165, 0.2), (0.1, 0.6)] {
        let sagging = Calibrated::new(&format!("{IDEAL}\ntile_sag = {sag}"));
        assert!((sagging.settling.tile_sag / sag - 1.0).abs() < 0.05, "{:?}", sagging.settling);
        for (name, scene) in scenes() {
            let (_, lost_db) = loss(&sagging, &ideal, &scene, &shown);
            println!("{name}, sag {sag}: {lost_db:.2} dB");
            assert!(lost_db < most_db, "{name}, sag {sag}: {lost_db}");
        }
    }
    assert_eq!(ideal.settling.tile_sag, 0.0);
}

#[test]
fn without_alternation_the_corner_is_lost() {
    let (circuit, ideal) = (Calibrated::new(CIRCUIT), Calibrated::new(IDEAL));
    for (name, scene) in scenes() {
        let shown = Shown { order: Order::ZigZag, sampling: 1.0, alternating: false };
        let (corner, lost_db) = loss(&circuit, &ideal, &scene, &shown);
        assert!(corner > 0.5 && lost_db > 5.0, "{name}: {corner} {lost_db}");
    }
}

/// A burst in which the lines are not inverted takes their charge for light, and finds the latency one clock late.
#[test]
fn with_the_latency_of_a_burst_that_does_not_invert_its_lines_the_images_are_lost() {
    let (mut circuit, ideal) = (Calibrated::new(CIRCUIT), Calibrated::new(IDEAL));
    circuit.settling.adc_latency += 1;
    for (name, scene) in scenes() {
        let shown = Shown { order: Order::ZigZag, sampling: 1.0, alternating: true };
        let (_, lost_db) = loss(&circuit, &ideal, &scene, &shown);
        println!("{name}: {lost_db:.1} dB");
        assert!(lost_db > 3.0, "{name}: {lost_db}");
    }
}
