//! A target that moves before the projector.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use nirspi_optics::{CameraModel, Motion, MovingTarget, Projector, Scene, Specular};
use proptest::prelude::*;

const DISTANCE_MM: f64 = 300.0;

/// A patch of grey levels, smaller than the field, before a dark ground.
fn patch(side_mm: f64) -> Scene {
    let smooth = |i: usize| {
        let (x, y) = ((i % 64) as f64 / 64.0 - 0.5, (i / 64) as f64 / 64.0 - 0.5);
        let window = (1.0 - 4.0 * x * x).max(0.0) * (1.0 - 4.0 * y * y).max(0.0);
        (window * (0.6 + 0.4 * (9.0 * x + 4.0 * y).sin())) as f32
    };
    Scene::new((0..4096).map(smooth).collect(), 64, side_mm).unwrap()
}

fn projector() -> Projector {
    CameraModel::paper().projector()
}

fn moving(motion: Motion, scene: &Scene, distance_mm: f64) -> MovingTarget {
    MovingTarget::new(motion, &projector(), scene, distance_mm).unwrap()
}

fn largest_difference(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn a_target_starts_where_it_rests_and_comes_back() {
    for distance_mm in [300.0, 600.0] {
        let scene = patch(projector().field_mm(distance_mm) * 0.6);
        let rest = projector().footprint(&scene, distance_mm).unwrap();
        let motion = Motion { speed_m_per_s: 0.5, direction_deg: 30.0, turning_deg_per_s: 90.0 };
        let target = moving(motion, &scene, distance_mm);
        assert!(largest_difference(&target.seen(0.0), rest.weights()) < 1e-5);
        let away = (0..1000).map(|ms| f64::from(ms) / 1e3);
        let light = |seconds: f64| target.seen(seconds).iter().sum::<f32>();
        let dark: Vec<f64> = away.filter(|&seconds| light(seconds) < 1e-3 * light(0.0)).collect();
        assert!(!dark.is_empty(), "the target never leaves the field");
        let last = dark.last().unwrap();
        assert!((0..2000).any(|ms| light(last + f64::from(ms) / 1e3) > 0.8 * light(0.0)));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    /// A target that has moved by whole pixels is the image moved by whole pixels.
    #[test]
    fn a_target_moves_as_its_image_does(right in -8i32..8, down in -8i32..8) {
        let pixel_mm = projector().field_mm(DISTANCE_MM) / 32.0;
        let scene = patch(20.0);
        let rest = projector().footprint(&scene, DISTANCE_MM).unwrap();
        let gone_mm = f64::from(right).hypot(f64::from(down)) * pixel_mm;
        let motion = Motion {
            speed_m_per_s: gone_mm * 1e-3,
            direction_deg: f64::from(down).atan2(f64::from(right)).to_degrees(),
            turning_deg_per_s: 0.0,
        };
        let seen = moving(motion, &scene, DISTANCE_MM).seen(1.0);
        for (at, seen) in seen.iter().enumerate() {
            let (x, y) = ((at % 32) as i32 - right, (at / 32) as i32 - down);
            let inside = (0..32).contains(&x) && (0..32).contains(&y);
            let expected = if inside { rest.weights()[(y * 32 + x) as usize] } else { 0.0 };
            prop_assert!((seen - expected).abs() < 0.01, "{at}: {seen} {expected}");
        }
    }
}

/// Within the field: the light of the lens's blur that comes from beyond it is the surround's.
#[test]
fn a_target_at_rest_elsewhere_is_seen_as_the_moving_one() {
    let spot = Specular { times: 3.0, x_mm: 4.0, y_mm: -2.0, side_mm: 2.0 };
    let shining = patch(20.0).with_specular(spot).unwrap();
    // The sides of a spot do not turn.
    for (scene, turning_deg_per_s) in [(patch(20.0), 900.0), (shining, 0.0)] {
        let motion = Motion { speed_m_per_s: 0.05, direction_deg: 30.0, turning_deg_per_s };
        for seconds in [0.0, 0.02, 0.1, 0.15] {
            let target = moving(motion, &scene, DISTANCE_MM);
            let posed = scene.posed(target.pose(seconds), projector().field_mm(DISTANCE_MM));
            let found = projector().footprint(&posed, DISTANCE_MM).unwrap();
            let difference = largest_difference(&target.seen(seconds), found.weights());
            assert!(difference < 0.02, "after {seconds} s: {difference}");
        }
    }
}

#[test]
fn a_quarter_turn_turns_the_image() {
    let scene = patch(30.0);
    let rest = projector().footprint(&scene, DISTANCE_MM).unwrap();
    let motion = Motion { turning_deg_per_s: 90.0, ..Motion::default() };
    let seen = moving(motion, &scene, DISTANCE_MM).seen(1.0);
    // Clockwise: what was at the left is at the top.
    let turned: Vec<f32> =
        (0..1024).map(|at| rest.weights()[(31 - at % 32) * 32 + at / 32]).collect();
    assert!(largest_difference(&seen, &turned) < 0.01);
    assert!(largest_difference(&seen, rest.weights()) > 0.1);
}

#[test]
fn a_motion_out_of_range_names_the_number() {
    let fast = Motion { speed_m_per_s: 200.0, ..Motion::default() };
    assert_eq!(
        fast.validate().unwrap_err().to_string(),
        "target speed in m/s is 200, expected 0 to 100"
    );
    let not = Motion { turning_deg_per_s: f64::NAN, ..Motion::default() };
    assert!(not.validate().unwrap_err().to_string().contains("turning in degrees a second is NaN"));
}
