//! Light that a real bench adds: the veil of a cover glass, and a specular spot of the target.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use nirspi::imaging::share_of_white;
use nirspi::setup::MeasurementSetup;
use nirspi_optics::{CameraModel, Scene};
use nirspi_recon::{Order, reconstruct};
use nirspi_virtual::{VirtualOptics, calibrate_against_white, shoot, white_level_at_target};
use std::ops::ControlFlow;

/// Sweeps of four in a picture: 20 ms of light.
const FRAMES: u32 = 61;

/// The image of a grey sheet, in shares of the white sheet that the same camera saw.
fn image(description: &str, spot: Option<&str>) -> Vec<f32> {
    let camera = CameraModel::parse(description).unwrap();
    let of = |scene| VirtualOptics::of(&camera, scene, 300.0).unwrap();
    let white = of(Scene::white());
    let settling = calibrate_against_white(&white, 1).unwrap();
    let white_level = white_level_at_target(&white, &settling, None, 2).unwrap();
    let mut grey = of(Scene::new(vec![0.4; 4], 2, 60.0).unwrap());
    if let Some(spot) = spot {
        grey = grey.with_specular(spot.parse().unwrap()).unwrap();
    }
    let setup = grey.setup(&Order::CakeCutting, 1.0).unwrap();
    let setup = MeasurementSetup { sweeps: 4, ..setup };
    let mut go_on = |_: &_| ControlFlow::Continue(());
    let shot = shoot(&grey, setup, &settling, FRAMES, 3, &mut go_on).unwrap();
    let image = reconstruct::hadamard(&shot.measurements().unwrap());
    share_of_white(&image, white_level).pixels().to_vec()
}

/// Mean and standard deviation of the pixels but those of the third row, where the spot and what settles of it lie.
fn levels(image: &[f32]) -> (f64, f64) {
    let rest: Vec<f64> =
        image.iter().enumerate().filter(|(at, _)| at / 32 != 3).map(|(_, &v)| v.into()).collect();
    let mean = rest.iter().sum::<f64>() / rest.len() as f64;
    let square = rest.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / rest.len() as f64;
    (mean, square.sqrt())
}

/// A veil of 0.25 of white is read beside the target's 0.4, and beside the white sheet's 1.
#[test]
fn a_cover_glass_lays_the_same_veil_over_target_and_white_sheet() {
    let (clear, clear_noise) = levels(&image("", None));
    let (veiled, veiled_noise) = levels(&image("[collector]\ncover_veil = 0.25", None));
    println!("clear {clear:.3} {clear_noise:.4}, veiled {veiled:.3} {veiled_noise:.4}");
    assert!((clear - 0.4).abs() < 0.01, "{clear}");
    assert!((veiled - (0.4 + 0.25) / 1.25).abs() < 0.01, "{veiled}");
}

#[test]
fn a_specular_spot_lies_in_its_pixel_and_its_noise_in_all() {
    let (_, dull_noise) = levels(&image("", None));
    for times in [10.0, 100.0, 1000.0] {
        let shining = image("", Some(&format!("{times}@3,4")));
        let (level, noise) = levels(&shining);
        let spot = f64::from(shining[3 * 32 + 4]);
        println!(
            "{times} times white: reads {spot:.2}, rest {level:.3}, noise {noise:.4} ({dull_noise:.4})"
        );
        assert!((level - 0.4).abs() < 0.02, "{times}: {level}");
        assert!((spot / (times + 0.4) - 1.0).abs() < 0.05, "{times}: {spot}");
    }
}
