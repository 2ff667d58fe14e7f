//! A scene in rain, as the single-pixel camera and an ordinary one see it.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use crate::beams;
use nirspi_optics::rain::{Air, Drops, RainySpots, Weather};
use nirspi_optics::visible::VisibleCamera;
use nirspi_optics::water::Water;
use nirspi_optics::{Footprint, LEDS, LedArray, Projector, Scene};

fn white(distance_mm: f64) -> Footprint {
    let scene = Scene::new(vec![1.0], 1, 10_000.0).unwrap();
    Projector::default().footprint(&scene, distance_mm).unwrap()
}

fn spots(drops: Drops, distance_mm: f64, seed: u64) -> RainySpots {
    let weather = Weather::new(drops, 1550.0, Water::Segelstein).unwrap();
    RainySpots::new(&weather, &white(distance_mm), beams(distance_mm), seed).unwrap()
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64
}

#[test]
fn without_rain_a_spot_shows_the_scene() {
    let spots = spots(Drops::none(), 300.0, 1);
    assert_eq!(spots.reflectance(), white(300.0).weights());
}

#[test]
fn over_time_single_drops_cost_what_the_mean_says() {
    let drops = Drops::monodisperse(100.0, 1.0).unwrap();
    let weather = Weather::new(drops.clone(), 1550.0, Water::Segelstein).unwrap();
    let mut rain = spots(drops, 1000.0, 5);
    let (mut sum, looks) = (0.0, 1500);
    for _ in 0..looks {
        rain.advance(0.05);
        // The middle of the field, whose halo is whole.
        sum += f64::from(rain.reflectance()[16 * 32 + 16]) / f64::from(looks);
    }
    let blur = weather.blur(1000.0).unwrap();
    let field = Projector::default().field_mm(1000.0);
    let out = blur.unscattered() + blur.scattered_within(field / 2.0);
    let expected = out * blur.returned(field / 1000.0);
    // About 1 % of the light is lost. A fifth of that may differ: by chance, and because the square field has corners.
    assert!((sum - expected).abs() < 0.2 * (1.0 - expected), "{sum} against {expected}");
}

#[test]
fn a_drop_close_to_the_lens_dims_many_spots_and_one_close_to_the_target_few() {
    let mut rain = spots(Drops::monodisperse(50.0, 3.0).unwrap(), 1000.0, 2);
    let mut deepest = 1.0_f32;
    let mut changed = 0;
    for _ in 0..400 {
        rain.advance(0.05);
        let now = rain.reflectance();
        deepest = now.iter().copied().fold(deepest, f32::min);
        changed += usize::from(mean(&now) < 0.995);
    }
    assert!(deepest < 0.95, "no drop was seen: {deepest}");
    assert!(changed > 4, "{changed}");
}

#[test]
fn fog_dims_evenly_and_adds_its_halo() {
    let fog = Drops::fog(10.0, 0.1).unwrap();
    let weather = Weather::new(fog.clone(), 1550.0, Water::Segelstein).unwrap();
    let foggy = spots(fog, 1000.0, 1).reflectance();
    let two_ways = weather.medium().transmission(2.0);
    let middle = f64::from(foggy[16 * 32 + 16]);
    assert!(middle > two_ways && middle < 1.0, "{middle} {two_ways}");
    // Less is scattered into a corner from a field that ends there.
    assert!(foggy[0] < foggy[16 * 32 + 16]);
}

#[test]
fn thicker_fog_leaves_less_contrast_and_a_brighter_black() {
    let black_and_white = |text: &str| {
        let air: Air = text.parse().unwrap();
        let weather = air.weather(1550.0).unwrap();
        let half = Scene::new(vec![0.0, 1.0, 0.0, 1.0], 2, 2000.0).unwrap();
        let footprint = Projector::default().footprint(&half, 1000.0).unwrap();
        let seen = RainySpots::new(&weather, &footprint, beams(1000.0), 1).unwrap().reflectance();
        // Far from the edge, which is out of focus.
        (seen[16 * 32 + 4], seen[16 * 32 + 27])
    };
    let mut last = black_and_white("none");
    assert!(last.0 < 1e-3 && last.1 > 0.999, "{last:?}");
    // Visibilities of 50 to 1 m: optical depths of 0.08 to 3.9 over the metre.
    for text in ["fog:50m", "fog:8m", "fog:3m", "fog:1m"] {
        let now = black_and_white(text);
        assert!(now.1 - now.0 < last.1 - last.0, "{text}: {now:?} after {last:?}");
        assert!(now.0 > 0.0, "{text}: {now:?}");
        last = now;
    }
}

#[test]
fn drops_on_the_window_take_light_and_spread_it_over_the_field() {
    let seen = |text: &str, scene: Vec<f32>| {
        let weather = text.parse::<Air>().unwrap().weather(1550.0).unwrap();
        let scene = Scene::new(scene, 2, 96.0).unwrap();
        let footprint = Projector::default().footprint(&scene, 300.0).unwrap();
        RainySpots::new(&weather, &footprint, beams(300.0), 1).unwrap().reflectance()
    };
    // 20 % is lost there and back; flat drops leave it in the spot's neighbourhood on the way there.
    let white = |text: &str| f64::from(seen(text, vec![1.0; 4])[16 * 32 + 16]);
    assert!((white("window:0.2,1") / 0.8 - 1.0).abs() < 0.01, "{}", white("window:0.2,1"));
    assert!((0.64..0.8).contains(&white("window:0.2,60")), "{}", white("window:0.2,60"));
    // The dark half of a scene gets light of the other.
    let dark = |text: &str| seen(text, vec![0.0, 1.0, 0.0, 1.0])[16 * 32 + 5];
    assert!(dark("window:0.2,30") > 0.01 && dark("none") < 1e-6, "{}", dark("window:0.2,30"));
}

#[test]
fn relit_leds_give_what_new_ones_would() {
    let pixels: Vec<f32> = (0..LEDS).map(|i| (i * 31 % 97) as f32 / 97.0).collect();
    let one =
        Projector::default().footprint(&Scene::new(pixels, 32, 48.0).unwrap(), 300.0).unwrap();
    let other = white(300.0);
    let mut leds = LedArray::new(&one, 26.0);
    for (rows, cols) in [(0, 0), (7, 99), (u32::MAX, 12345)] {
        leds.light(rows, cols, true);
        leds.relight(other.weights(), 13.0);
        assert_eq!(
            leds.light(rows, cols, true),
            LedArray::new(&other, 13.0).light(rows, cols, true)
        );
        leds.relight(one.weights(), 26.0);
        assert_eq!(leds.light(rows, cols, true), LedArray::new(&one, 26.0).light(rows, cols, true));
    }
}

#[test]
fn an_ordinary_camera_sees_the_scene_with_its_own_noise_and_some_drops() {
    let camera = VisibleCamera::default();
    let scene = Scene::new(vec![0.0, 1.0, 1.0, 0.0], 2, 2000.0).unwrap();
    let see =
        |air: &Air, seed| camera.picture(&scene, &Projector::default(), 1000.0, air, seed).unwrap();
    let dry = see(&Air::dry(), 1);
    let quarter = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| -> f64 {
        let values: Vec<f32> =
            rows.flat_map(|r| columns.clone().map(move |c| r * 32 + c)).map(|i| dry[i]).collect();
        mean(&values)
    };
    // Shot noise of 7000 electrons over 256 pixels: 1.2 % / 16.
    assert!((quarter(0..16, 16..32) - 1.0).abs() < 0.004 && quarter(0..16, 0..16).abs() < 0.001);
    assert_eq!(dry, see(&Air::dry(), 1));
    assert_ne!(dry, see(&Air::dry(), 2));
    // A drop before the black quarter shines.
    let downpour: Air = "rain:100,mono:3".parse().unwrap();
    let brightest = (0..40).map(|seed| {
        let wet = see(&downpour, seed);
        (0..16).flat_map(|r| (0..16).map(move |c| r * 32 + c)).map(|i| wet[i]).fold(0.0, f32::max)
    });
    assert!(brightest.fold(0.0, f32::max) > 0.1);
    // Fog greys the black, and what is left of white.
    let fog = see(&"fog:5m".parse().unwrap(), 1);
    assert!(fog[5] > 0.2 && fog[26] > fog[5], "{} {}", fog[5], fog[26]);
    // Exposure: 15 klx, f/2.8, 5 um, 7000 electrons.
    assert!((camera.exposure_s() / 2.65e-4 - 1.0).abs() < 0.05, "{}", camera.exposure_s());
}
