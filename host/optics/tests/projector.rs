//! What the projector promises: the geometry, and that a spot is a weighted mean.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use nirspi_optics::{Footprint, LEDS, Projector, ProjectorError, SIDE, Scene};
use proptest::prelude::*;

const SIZE: usize = 24;

fn flat(reflectance: f32, side_mm: f64) -> Scene {
    Scene::new(vec![reflectance; 4], 2, side_mm).unwrap()
}

fn seen(scene: &Scene, distance_mm: f64) -> Footprint {
    Projector::default().footprint(scene, distance_mm).unwrap()
}

fn assert_close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} against {expected}");
}

#[test]
fn field_and_blur_have_the_sizes_the_design_was_chosen_for() {
    let projector = Projector::default();
    assert_close(projector.array_distance_mm(), 600.0, 1e-9);
    for (distance_mm, field_mm, blur_mm) in
        [(300.0, 48.0, 0.0), (600.0, 96.0, 20.0), (1000.0, 160.0, 140.0 / 3.0)]
    {
        assert_close(projector.field_mm(distance_mm), field_mm, 1e-9);
        assert_close(projector.blur_mm(distance_mm), blur_mm, 1e-9);
    }
}

#[test]
fn a_flat_target_is_seen_flat_at_every_distance() {
    for distance_mm in [150.0, 299.0, 300.0, 301.0, 450.0, 600.0, 1000.0, 3000.0] {
        for &w in seen(&flat(0.37, 5000.0), distance_mm).weights() {
            assert_close(w.into(), 0.37, 1e-6);
        }
    }
}

#[test]
fn the_surround_is_seen_beside_the_target() {
    let scene = flat(0.0, 4.0).with_surround(0.8).unwrap();
    let footprint = seen(&scene, 300.0);
    assert_close(footprint.weights()[0].into(), 0.8, 1e-6);
    assert_close(footprint.weights()[16 * SIDE + 16].into(), 0.0, 1e-6);
}

#[test]
fn row_0_is_the_top_and_column_0_the_left() {
    // 32 x 32 pixels exactly over the field at the focus: each LED sees its own pixel.
    let pixels: Vec<f32> = (0..LEDS).map(|i| i as f32 / LEDS as f32).collect();
    let footprint = seen(&Scene::new(pixels.clone(), SIDE, 48.0).unwrap(), 300.0);
    for (&found, &expected) in footprint.weights().iter().zip(&pixels) {
        assert_close(found.into(), expected.into(), 1e-6);
    }
}

#[test]
fn the_image_of_a_point_is_as_wide_as_the_emitter_and_the_blur() {
    // A 0.2 mm dot: its footprint extends half of (emitter image + blur) around it.
    for distance_mm in [300.0, 400.0, 600.0] {
        let projector = Projector::default();
        let footprint = seen(&flat(1.0, 0.2), distance_mm);
        let pitch_mm = projector.field_mm(distance_mm) / SIDE as f64;
        let reach_mm = projector.blur_mm(distance_mm) / 2.0 + pitch_mm / 3.0;
        let row = &footprint.weights()[15 * SIDE..16 * SIDE];
        for (column, &w) in row.iter().enumerate() {
            let x = (column as f64 - 15.5) * pitch_mm;
            let away_mm = x.hypot(pitch_mm / 2.0);
            if away_mm > reach_mm * 1.02 + 0.2 + pitch_mm / 3.0 {
                assert_eq!(w, 0.0, "column {column} at {distance_mm} mm");
            }
            // The emitter image reaches farther than its edge only along a diagonal.
            if away_mm < reach_mm * 0.98 - 0.2 - pitch_mm / 4.0 {
                assert!(w > 0.0, "column {column} at {distance_mm} mm");
            }
        }
    }
}

#[test]
fn the_image_of_a_point_spreads_as_a_disc_does() {
    // Variances along x add: blur disc d^2 / 16, emitter (which tiles the field here) and dot
    // w^2 / 12. Where the disc is many LEDs wide, sampling it at the LEDs changes this little.
    let projector = Projector { emitter_mm: 3.0, ..Projector::default() };
    for distance_mm in [600.0, 750.0, 900.0] {
        let footprint = projector.footprint(&flat(1.0, 0.5), distance_mm).unwrap();
        let pitch_mm = projector.field_mm(distance_mm) / SIDE as f64;
        let (mut mass, mut moment) = (0.0, 0.0);
        for (i, &w) in footprint.weights().iter().enumerate() {
            let x = ((i % SIDE) as f64 - 15.5) * pitch_mm;
            mass += f64::from(w);
            moment += f64::from(w) * x * x;
        }
        let expected_mm2 =
            projector.blur_mm(distance_mm).powi(2) / 16.0 + (pitch_mm.powi(2) + 0.25) / 12.0;
        assert_close(moment / mass / expected_mm2, 1.0, 0.01);
    }
}

/// Brute force: the spot integrated over a fine grid of disc points, each a mean over the emitter.
fn by_quadrature(scene: &[f32], side_mm: f64, distance_mm: f64, led: (usize, usize)) -> f64 {
    let projector = Projector::default();
    let pitch_mm = projector.field_mm(distance_mm) / SIDE as f64;
    let centre = |i: usize| (i as f64 - 15.5) * pitch_mm;
    let emitter_mm = projector.emitter_mm / projector.led_pitch_mm * pitch_mm;
    let radius_mm = projector.blur_mm(distance_mm) / 2.0;
    let at = |x: f64, y: f64| {
        let pixel = |v: f64| ((v / side_mm + 0.5) * SIZE as f64).floor();
        let (column, row) = (pixel(x), pixel(y));
        let inside = |v: f64| (0.0..SIZE as f64).contains(&v);
        if inside(column) && inside(row) {
            f64::from(scene[row as usize * SIZE + column as usize])
        } else {
            0.0
        }
    };
    let (disc_points, square_points) = (60, 12);
    let (mut sum, mut count) = (0.0, 0.0);
    for (i, j) in (0..disc_points).flat_map(|i| (0..disc_points).map(move |j| (i, j))) {
        let unit = |k: usize| (k as f64 + 0.5) / f64::from(disc_points as u32) * 2.0 - 1.0;
        if unit(i).hypot(unit(j)) > 1.0 {
            continue;
        }
        for (p, q) in (0..square_points).flat_map(|p| (0..square_points).map(move |q| (p, q))) {
            let part = |k: usize| (k as f64 + 0.5) / f64::from(square_points as u32) - 0.5;
            let x = centre(led.1) + unit(j) * radius_mm + part(q) * emitter_mm;
            let y = centre(led.0) + unit(i) * radius_mm + part(p) * emitter_mm;
            sum += at(x, y);
            count += 1.0;
        }
    }
    sum / count
}

#[test]
fn spots_agree_with_brute_force_integration() {
    let scene: Vec<f32> =
        (0..SIZE * SIZE).map(|i| (i * i % 97) as f32 / 96.0 * ((i / 5) % 2) as f32).collect();
    for distance_mm in [305.0, 330.0, 600.0, 1000.0] {
        let footprint = seen(&Scene::new(scene.clone(), SIZE, 60.0).unwrap(), distance_mm);
        for led in [(16, 16), (12, 19), (5, 9), (20, 13)] {
            let expected = by_quadrature(&scene, 60.0, distance_mm, led);
            let found = footprint.weights()[led.0 * SIDE + led.1];
            assert_close(found.into(), expected, 0.012);
        }
    }
}

#[test]
fn emitters_without_gaps_see_all_of_a_scene_inside_the_field() {
    // Squares tile the field, blur only moves light about: the sum is the scene's integral.
    let projector = Projector { emitter_mm: 3.0, ..Projector::default() };
    let pixels: Vec<f32> = (0..SIZE * SIZE).map(|i| (i % 7) as f32 / 6.0).collect();
    let mean = pixels.iter().map(|&v| f64::from(v)).sum::<f64>() / pixels.len() as f64;
    let scene = Scene::new(pixels, SIZE, 40.0).unwrap();
    for distance_mm in [300.0, 350.0, 500.0, 600.0] {
        let spot_mm2 = (projector.field_mm(distance_mm) / SIDE as f64).powi(2);
        let footprint = projector.footprint(&scene, distance_mm).unwrap();
        let seen_mm2 = footprint.mean() * LEDS as f64 * spot_mm2;
        assert_close(seen_mm2 / (mean * 1600.0), 1.0, 1e-5);
    }
}

#[test]
fn what_cannot_be_projected_is_refused() {
    let scene = flat(1.0, 40.0);
    let default = Projector::default();
    for (field, projector) in [
        ("led_pitch_mm", Projector { led_pitch_mm: 0.0, ..default }),
        ("emitter_mm", Projector { emitter_mm: -1.0, ..default }),
        ("focal_length_mm", Projector { focal_length_mm: f64::NAN, ..default }),
        ("focus_distance_mm", Projector { focus_distance_mm: f64::INFINITY, ..default }),
        ("aperture_mm", Projector { aperture_mm: 0.0, ..default }),
    ] {
        let error = projector.footprint(&scene, 300.0).unwrap_err();
        assert!(matches!(error, ProjectorError::Length { name, .. } if name == field), "{error}");
    }
    for distance_mm in [0.0, -300.0, f64::NAN, f64::INFINITY] {
        let error = default.footprint(&scene, distance_mm).unwrap_err();
        assert!(matches!(error, ProjectorError::Length { name: "distance_mm", .. }), "{error}");
    }
    let behind = Projector { focus_distance_mm: 200.0, ..default };
    assert!(matches!(behind.footprint(&scene, 300.0), Err(ProjectorError::NoRealImage { .. })));
    let wide = Projector { emitter_mm: 3.1, ..default };
    assert!(matches!(wide.footprint(&scene, 300.0), Err(ProjectorError::Emitter { .. })));
    assert!(matches!(default.footprint(&scene, 1.0), Err(ProjectorError::WashedOut { .. })));
}

fn pixels() -> impl Strategy<Value = Vec<f32>> {
    prop::collection::vec(0.0_f32..=1.0, SIZE * SIZE)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn the_footprint_is_linear_in_reflectance(
        a in pixels(), b in pixels(), share in 0.0_f32..=1.0, distance_mm in 200.0..1500.0,
    ) {
        let mixed = a.iter().zip(&b).map(|(a, b)| share * a + (1.0 - share) * b).collect();
        let view = |p| seen(&Scene::new(p, SIZE, 60.0).unwrap(), distance_mm);
        let (of_mixed, of_a, of_b) = (view(mixed), view(a), view(b));
        for i in 0..LEDS {
            let expected = share * of_a.weights()[i] + (1.0 - share) * of_b.weights()[i];
            prop_assert!((of_mixed.weights()[i] - expected).abs() < 1e-5);
        }
    }

    #[test]
    fn turning_the_scene_over_turns_the_footprint_over(
        pixels in pixels(), distance_mm in 200.0..1500.0,
    ) {
        let mirror = |v: &[f32], side: usize| -> Vec<f32> {
            v.chunks_exact(side).flat_map(|row| row.iter().rev().copied()).collect()
        };
        let view = |p| seen(&Scene::new(p, SIZE, 60.0).unwrap(), distance_mm);
        let mirrored = view(mirror(&pixels, SIZE));
        let upside_down = view(pixels.iter().rev().copied().collect());
        let upright = view(pixels);
        for (m, u) in mirrored.weights().iter().zip(mirror(upright.weights(), SIDE)) {
            prop_assert!((m - u).abs() < 1e-5);
        }
        for (d, u) in upside_down.weights().iter().zip(upright.weights().iter().rev()) {
            prop_assert!((d - u).abs() < 1e-5);
        }
    }

    #[test]
    fn a_spot_never_sees_more_than_the_brightest_or_less_than_the_darkest(
        pixels in pixels(), distance_mm in 100.0..3000.0,
    ) {
        let footprint = seen(&Scene::new(pixels, SIZE, 60.0).unwrap(), distance_mm);
        prop_assert!(footprint.weights().iter().all(|w| (-1e-6..=1.0 + 1e-6).contains(w)));
    }
}

#[test]
fn the_finest_line_is_that_of_disc_and_emitter() {
    let projector = Projector::default();
    // By Bessel functions: disc of 20 and 46.67 mm, emitter of 2 and 3.33 mm; a line is half a cycle.
    for (distance_mm, contrast, expected_mm) in
        [(600.0, 0.5, 14.26), (600.0, 0.1, 9.21), (1000.0, 0.5, 33.18), (1000.0, 0.1, 21.46)]
    {
        let line_mm = projector.finest_line_mm(distance_mm, contrast).unwrap();
        assert!((line_mm / expected_mm - 1.0).abs() < 5e-3, "{line_mm} against {expected_mm}");
    }
    // In focus a pixel is the limit.
    assert_eq!(projector.finest_line_mm(300.0, 0.1), Some(1.5));
}
