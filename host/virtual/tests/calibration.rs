//! Latency belongs to the instrument: a scene too dim to show it never gives a picture with a wrong one.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi::calibration::CalibrationError;
use nirspi::capture::{Calibration, CaptureError, CaptureOptions, capture};
use nirspi::response::Settling;
use nirspi::scene::SceneSource;
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi_optics::{CameraModel, Scene};
use nirspi_recon::{Order, metrics, reconstruct};
use nirspi_virtual::{MemoryLink, VirtualOptics, calibrate_against_white, shoot};
use std::ops::ControlFlow;

/// A 43 mm letter, as the demo shows it.
fn letter(distance_mm: f64) -> VirtualOptics {
    let map = "letter:R".parse::<SceneSource>().unwrap().load(256).unwrap();
    let scene = Scene::new(map.reflectance, map.size_px, map.side_mm.unwrap()).unwrap();
    VirtualOptics::new(scene, distance_mm).unwrap()
}

/// Correlation with the scene of an image that was captured with this latency and response.
fn likeness(optics: &VirtualOptics, settling: &Settling, frames: u32) -> f64 {
    let setup = MeasurementSetup::new(&Order::CakeCutting, 0.5).unwrap();
    let go_on = &mut |_: &_| ControlFlow::Continue(());
    let shot = shoot(optics, setup, settling, frames, 1, go_on).unwrap();
    let image = reconstruct::hadamard(&shot.measurements().unwrap());
    let truth = optics.focused_footprint().unwrap().weights().to_vec();
    metrics::correlation(&truth, image.pixels(), 32, 32).unwrap()
}

#[test]
fn a_dark_scene_uses_the_kept_latency_or_fails() {
    let optics = letter(1000.0);
    let settling = calibrate_against_white(&optics, 1).unwrap();
    let setup = MeasurementSetup::new(&Order::CakeCutting, 0.5).unwrap();
    let with = |calibration| {
        let link = MemoryLink::new(optics.camera(1).unwrap());
        let mut session = Session::open(Box::new(link)).unwrap();
        let setup = setup.clone();
        let options = CaptureOptions { setup, frames: Some(2), calibration, record: None };
        capture(&mut session, &options, &mut |_| ControlFlow::Continue(()))
    };
    let error = with(Calibration::Measure).unwrap_err();
    assert!(
        matches!(error, CaptureError::Calibration(CalibrationError::NoStep { .. })),
        "{error:?}"
    );
    let line = error.to_string();
    assert!(line.contains("nirspi camera calibrate") && line.contains("--adc-latency"), "{line}");

    let captured = with(Calibration::MeasureOr(settling.clone())).unwrap();
    assert_eq!(captured.setup.adc_latency, settling.adc_latency);
    assert!(matches!(captured.calibration_problem, Some(CalibrationError::NoStep { .. })));
    let used = captured.settling.unwrap();
    assert_eq!(used.response, settling.response);
    // The dark level is that of this burst, in front of this scene.
    assert!(used.step_counts.abs() < 0.1 * settling.step_counts, "{}", used.step_counts);
}

#[test]
fn the_latency_measured_against_white_is_the_instruments() {
    let optics = letter(1000.0);
    let settling = calibrate_against_white(&optics, 1).unwrap();
    assert_eq!(settling.adc_latency, optics.chain().adc_latency_clocks);
}

#[test]
fn a_far_letter_is_dim_and_never_inverted() {
    for (distance_mm, least, better) in [(700.0, 0.3, 0.2), (1000.0, 0.05, 0.05)] {
        let optics = letter(distance_mm);
        let settling = calibrate_against_white(&optics, 1).unwrap();
        let right = likeness(&optics, &settling, 120);
        let wrong = likeness(&optics, &Settling { adc_latency: 0, ..settling }, 120);
        // What a latency of 0 in place of the measured one would do.
        assert!(right > least && wrong < right - better, "{distance_mm} mm: {right}, {wrong}");
    }
}

/// A capture without complements takes a burst of its own for the dark level, and keeps the sag of the supplies, which only a
/// whole calibration measures: the image is that of a capture with complements.
#[test]
fn a_capture_that_takes_its_dark_level_keeps_the_sag() {
    let camera = CameraModel::parse("[leds]\npower_mw = 40\ntile_sag = 0.1").unwrap();
    let optics = VirtualOptics::of(&camera, Scene::white(), 300.0).unwrap();
    let settling = calibrate_against_white(&optics, 1).unwrap();
    assert!((settling.tile_sag - 0.1).abs() < 0.01, "{settling:?}");
    let mean = |differential| {
        let setup = optics.setup(&Order::Natural, 1.0).unwrap();
        let setup =
            MeasurementSetup { differential, alternating: differential, sweeps: 4, ..setup };
        let go_on = &mut |_: &_| ControlFlow::Continue(());
        let shot = shoot(&optics, setup, &settling, 8, 1, go_on).unwrap();
        let image = reconstruct::hadamard(&shot.measurements().unwrap());
        image.pixels().iter().map(|&value| f64::from(value)).sum::<f64>() / 1024.0
    };
    let (pairs, single) = (mean(true), mean(false));
    assert!((single / pairs - 1.0).abs() < 0.02, "{single} {pairs}");
}
