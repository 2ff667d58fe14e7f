//! A flat field takes the pattern of unequal LEDs out of images, at any distance and of any scene.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use nirspi::calibration::{Measured, Sweeps, pattern_noise};
use nirspi::capture::{FlatFieldError, measure_flat_field};
use nirspi::imaging::score;
use nirspi::response::Settling;
use nirspi::scene::SceneSource;
use nirspi::session::Session;
use nirspi_optics::Scene;
use nirspi_recon::{Image, Order, reconstruct};
use nirspi_virtual::{CameraModel, MemoryLink, VirtualOptics, calibrate_against_white, shoot};
use std::ops::ControlFlow;

/// Bright LEDs, so that few sweeps show the pattern, which differ by 10 %, two of them dead, behind a lens that vignettes.
const UNEQUAL: &str = "[leds]\npower_mw = 40\npower_spread = 0.1\npointing_spread_deg = 1\n\
                       dead = [[3, 7], [20, 31]]\n[projector]\ncorner_vignetting = 0.2";

fn sheet(toml: &str) -> (VirtualOptics, Settling) {
    let camera = CameraModel::parse(toml).unwrap();
    let optics = VirtualOptics::of(&camera, Scene::white(), 300.0).unwrap();
    let settling = calibrate_against_white(&optics, 1).unwrap();
    (optics, settling)
}

fn measured(toml: &str, sweeps: u32) -> Result<Measured, FlatFieldError> {
    let (optics, settling) = sheet(toml);
    let setup = optics.setup(&Order::Natural, 1.0).unwrap();
    let mut session = Session::open(Box::new(MemoryLink::new(optics.camera(1).unwrap()))).unwrap();
    let mut go_on = |_: &_| ControlFlow::Continue(());
    measure_flat_field(&mut session, &setup, &settling, Sweeps::of_map(sweeps), &mut go_on)
}

fn image(optics: &VirtualOptics, settling: &Settling, sampling: f64, seed: u64) -> Image {
    let setup = optics.setup(&Order::CakeCutting, sampling).unwrap();
    let mut go_on = |_: &_| ControlFlow::Continue(());
    let shot = shoot(optics, setup, settling, 40, seed, &mut go_on).unwrap();
    reconstruct::hadamard(&shot.measurements().unwrap())
}

#[test]
fn a_flat_field_takes_the_pattern_of_unequal_leds_away() {
    let Measured { flat, pattern_before, pattern_after, noise } = measured(UNEQUAL, 800).unwrap();
    println!("pattern {pattern_before:.4} before, {pattern_after:.5} after; noise {noise:.5}");
    assert!(pattern_before > 0.1 && pattern_before < 0.2, "{pattern_before}");
    assert!(pattern_after < pattern_before / 10.0, "{pattern_before} {pattern_after}");
    assert_eq!(flat.dead_leds(), [[3, 7], [20, 31]]);

    let camera = CameraModel::parse(UNEQUAL).unwrap();
    let (_, settling) = sheet(UNEQUAL);
    // It was measured at 0.3 m and holds at 0.45 m, out of focus, for another order of patterns.
    let far = VirtualOptics::of(&camera, Scene::white(), 450.0).unwrap();
    let [a, b] = [7, 8].map(|seed| image(&far, &settling, 1.0, seed));
    let before = pattern_noise(&a, &b);
    let after = pattern_noise(&flat.correct(&a), &flat.correct(&b));
    println!("450 mm: pattern {before:.4} before, {after:.5} after");
    assert!(before > 0.1 && after < before / 10.0, "{before} {after}");

    // And for another scene, from all patterns and from half of them.
    let letter = "letter:R".parse::<SceneSource>().unwrap().load(256).unwrap();
    let optics = VirtualOptics::before(&camera, &letter, 300.0).unwrap();
    let truth = optics.focused_footprint().unwrap().weights().to_vec();
    for (sampling, gained_db) in [(1.0, 4.0), (0.5, 0.2)] {
        let seen = image(&optics, &settling, sampling, 7);
        let psnr = |image: &Image| score(image, &truth).unwrap().psnr_db.unwrap();
        let (before, after) = (psnr(&seen), psnr(&flat.correct(&seen)));
        println!("a letter, sampling {sampling}: {before:.2} dB before, {after:.2} after");
        assert!(after > before + gained_db, "{sampling}: {before} {after}");
    }
}

#[test]
fn equal_leds_get_no_flat_field_and_a_dim_sheet_says_so() {
    let equal = measured("[leds]\npower_mw = 40", 80).unwrap_err();
    assert!(matches!(equal, FlatFieldError::NothingGained { .. }), "{equal}");
    let dim = measured("[leds]\npower_spread = 0.1", 8).unwrap_err();
    assert!(matches!(dim, FlatFieldError::Noisy { .. }), "{dim}");
    assert!(dim.to_string().contains("hold the sheet nearer"));
}
