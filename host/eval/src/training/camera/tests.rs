//! Compares the linear camera with the whole virtual camera.

use super::*;
use nirspi::capture::{Calibration, CaptureOptions, capture};
use nirspi::setup::MeasurementSetup;
use nirspi_nets::data::shapes::Shape;
use nirspi_nets::data::{Purpose, stream};
use nirspi_optics::Projector;
use std::ops::ControlFlow;

fn star() -> Vec<f32> {
    Shape::Star.draw(&mut stream(4, Purpose::Training, 0))
}

/// The same scene by a capture: firmware, gateware model, packets, calibration, frames.
fn captured(scene: &[f32], conditions: Conditions, seed: u64) -> Vec<f32> {
    let field_mm = Projector::default().field_mm(conditions.distance_mm);
    let wide = Scene::new(mirrored(scene), 2 * SIDE_PX, 2.0 * field_mm).unwrap();
    let optics = VirtualOptics::new(wide, conditions.distance_mm).unwrap();
    let link = MemoryLink::new(optics.camera(seed).unwrap());
    let mut session = Session::open(Box::new(link)).unwrap();
    let options = CaptureOptions {
        setup: MeasurementSetup::new(&Order::CakeCutting, f64::from(conditions.sampling)).unwrap(),
        frames: Some(conditions.sweeps),
        calibration: Calibration::Measure,
        record: None,
    };
    let captured = capture(&mut session, &options, &mut |_| ControlFlow::Continue(())).unwrap();
    let measured = captured
        .integrated
        .measurements(&captured.setup, captured.settling.as_ref(), false)
        .unwrap();
    let white = white_counts(&optics) as f32;
    reconstruct::hadamard(&measured).pixels().iter().map(|v| (v / white).clamp(0.0, 1.0)).collect()
}

fn mean_and_deviation(a: &[f32], b: &[f32]) -> (f64, f64) {
    let of = |f: &dyn Fn(f64) -> f64| {
        a.iter().zip(b).map(|(a, b)| f(f64::from(a - b))).sum::<f64>() / a.len() as f64
    };
    let mean = of(&|d| d);
    (mean, of(&|d| (d - mean).powi(2)).sqrt())
}

#[test]
fn a_camera_that_is_not_linear_in_its_patterns_is_refused() {
    for key in [
        "leds.fall_ns = 16",
        "leds.turn_on_delay_ns = 1",
        "leds.tile_sag = 0.01",
        "leds.line_crosstalk_ff = 1",
        "collector.cover_veil = 0.1",
    ] {
        let camera = CameraModel::parse(key).unwrap();
        let refused = LinearCamera::new(&camera, 1).map(|_| ()).unwrap_err();
        assert!(matches!(refused, TrainingCameraError::NotLinear(_)), "{key}: {refused}");
        assert!(!refused.to_string().contains('\n'), "{refused}");
    }
}

#[test]
fn a_picture_by_the_short_way_differs_from_a_capture_by_noise_alone() {
    let camera = LinearCamera::new(CameraModel::paper(), 1).unwrap();
    // Grey levels in the middle of the range, so that noise is not clipped.
    let scene: Vec<f32> = star().iter().map(|v| 0.3 + 0.4 * v).collect();
    for (distance_mm, sweeps, sampling) in [(300.0, 60, 1.0), (450.0, 120, 0.5)] {
        let conditions = Conditions { distance_mm, rain: Rainfall::None, sweeps, sampling };
        let mut rng = stream(2, Purpose::Training, 0);
        let short = camera.picture(&scene, conditions, &mut rng).unwrap().reading;
        let whole = captured(&scene, conditions, 3);
        let (mean, deviation) = mean_and_deviation(&short.image, &whole);
        // Both pictures have their own noise: the difference has sqrt(2) times the noise, with an
        // error of 1/sqrt(2 * 1024) = 2 %.
        let expected = 2f64.sqrt() * f64::from(short.noise_std);
        assert!((deviation / expected - 1.0).abs() < 0.1, "{deviation} against {expected}");
        assert!(mean.abs() < 5.0 * expected / 32.0, "{mean}");
    }
}

/// The scene averaged over squares of 2 x 2 pixels.
fn sampled(scene: &[f32]) -> Vec<f32> {
    let pair = |row: usize, column: usize| scene[row * SIDE_PX + column..][..2].iter().sum::<f32>();
    (0..SIDE_PX * SIDE_PX / 4)
        .map(|pixel| (2 * (pixel / (SIDE_PX / 2)), 2 * (pixel % (SIDE_PX / 2))))
        .map(|(row, column)| (pair(row, column) + pair(row + 1, column)) / 4.0)
        .collect()
}

#[test]
fn light_that_is_enough_shows_the_scene_as_the_lens_does() {
    let camera = LinearCamera::new(CameraModel::paper(), 1).unwrap();
    let mut rng = stream(2, Purpose::Training, 0);
    let conditions =
        Conditions { distance_mm: 400.0, rain: Rainfall::Heavy, sweeps: 100_000, sampling: 1.0 };
    let reading = camera.picture(&star(), conditions, &mut rng).unwrap().reading;
    let (mean, deviation) = mean_and_deviation(&reading.image, &sampled(&reading.optical));
    // Rain takes less than a percent. Emitters of 2/3 of the pitch see slightly different areas
    // than whole pixels.
    assert!(mean.abs() < 0.02 && deviation < 0.03, "{mean} {deviation}");
    let (_, sharp) = mean_and_deviation(&reading.image, &sampled(&star()));
    assert!(sharp > 2.0 * deviation, "no blur: {sharp}");
}

#[test]
fn pictures_are_of_their_seed_alone_and_in_range() {
    let camera = LinearCamera::new(CameraModel::paper(), 1).unwrap();
    for index in 0..12 {
        let taken = || {
            let mut rng = stream(9, Purpose::Training, index);
            let conditions = camera.conditions(&mut rng).unwrap();
            camera.picture(&star(), conditions, &mut rng).unwrap().reading
        };
        let reading = taken();
        assert_eq!(reading, taken());
        assert!(reading.image.iter().all(|v| (0.0..=1.0).contains(v)));
        assert!(reading.noise_std < 0.2 && reading.sigma_px < 5.1, "{reading:?}");
    }
}
