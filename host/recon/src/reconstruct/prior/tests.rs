use super::*;
use crate::reconstruct::{Method, MethodSettings, Reconstruct, WITHIN, stack};
use crate::testing::{measured, noisy, normal, scene, side};
use crate::{Order, fwht as walsh};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_pcg::Pcg64;

/// A network that knows the scene, or draws noise.
struct Oracle {
    truth: Option<Vec<f64>>,
    seed: u64,
}

impl Network for Oracle {
    fn name(&self) -> &str {
        "oracle"
    }

    fn takes(&self, side: Side) -> bool {
        side.pixels() >= 16
    }

    fn complete(&self, seen: &Seen) -> Result<Vec<f32>, String> {
        let mut random = Pcg64::seed_from_u64(self.seed);
        Ok(match &self.truth {
            Some(truth) => {
                let mut d = truth.clone();
                walsh(&mut d).map_err(|error| error.to_string())?;
                d.iter().map(|&d| seen.in_units(d)).collect()
            }
            None => seen.values().iter().map(|_| 9.0 * normal(&mut random) as f32).collect(),
        })
    }
}

fn ready(network: Oracle) -> Box<dyn Reconstruct> {
    let network = Some(SharedNetwork::new(network));
    Method::PRIOR.prepare(&MethodSettings { network, ..MethodSettings::default() }).unwrap()
}

fn coefficients(image: &Image) -> Vec<f64> {
    let mut d: Vec<f64> = image.pixels().iter().map(|&p| p.into()).collect();
    walsh(&mut d).unwrap();
    d
}

fn worst(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn a_network_that_is_right_is_believed_and_one_that_is_wrong_is_not() {
    let truth = scene(side(32), 1);
    let part = measured(side(32), &truth).take(Some(&Order::ZigZag), 0.3).unwrap();
    let right = ready(Oracle { truth: Some(truth.clone()), seed: 0 }).reconstruct(&part).unwrap();
    assert_eq!(right.report.trust, Some(1.0));
    let truth: Vec<f32> = truth.iter().map(|&v| v as f32).collect();
    assert!(worst(right.image.pixels(), &truth) < 0.02, "{}", right.report);
    let wrong = ready(Oracle { truth: None, seed: 3 }).reconstruct(&part).unwrap();
    let tikhonov = Method::TIKHONOV.prepare(&MethodSettings::default()).unwrap();
    assert_eq!(wrong.image, tikhonov.reconstruct(&part).unwrap().image, "{}", wrong.report);
    assert!(wrong.report.to_string().contains("do not support the network"), "{}", wrong.report);
}

#[test]
fn what_the_network_cannot_complete_is_tikhonov_and_says_so() {
    let tikhonov = Method::TIKHONOV.prepare(&MethodSettings::default()).unwrap();
    let part = |n: u64, share: f64| {
        let truth = scene(side(n), 1);
        measured(side(n), &truth).take(Some(&Order::ZigZag), share).unwrap()
    };
    let flat = measured(side(32), &scene(side(32), 4)).take(None, 0.5).unwrap();
    let dark = measured(side(32), &[0.0; 1024]).take(None, 0.5).unwrap();
    for (part, words) in [
        (part(32, 0.01), "10 patterns measured, expected at least 40 for the network"),
        (part(64, 0.02), "82 patterns measured, expected at least 123 for the network"),
        (flat, "the measurements show no contrast"),
        (dark, "the measurements show no contrast"),
    ] {
        let made = ready(Oracle { truth: None, seed: 1 }).reconstruct(&part).unwrap();
        assert_eq!(made.image, tikhonov.reconstruct(&part).unwrap().image);
        assert_eq!(made.report.note, Some(format!("Tikhonov instead: {words}")));
        assert!(made.report.to_string().ends_with(words), "{}", made.report);
    }
    // One pattern more than the fewest that are refused.
    let least = ready(Oracle { truth: Some(scene(side(32), 1)), seed: 0 });
    let made = least.reconstruct(&part(32, 40.0 / 1024.0)).unwrap();
    assert!(!made.report.note.is_some_and(|note| note.contains("expected at least")));
}

#[test]
fn a_side_that_the_network_does_not_take_is_an_error() {
    let small = measured(side(8), &scene(side(8), 1));
    let error = ready(Oracle { truth: None, seed: 1 }).reconstruct(&small).unwrap_err().to_string();
    let words = "the network oracle does not complete images of 8 x 8 pixels: choose another \
                 method, such as tikhonov";
    assert_eq!(error, words);
}

#[test]
fn a_constant_image_stays_constant() {
    let flat = measured(side(32), &scene(side(32), 4)).take(Some(&Order::ZigZag), 0.4).unwrap();
    let made = ready(Oracle { truth: None, seed: 1 }).reconstruct(&flat).unwrap();
    assert!(made.image.pixels().iter().all(|&pixel| (pixel - 0.5).abs() < 1e-5));
}

#[test]
fn readings_without_noise_are_kept_exactly() {
    let truth = scene(side(32), 1);
    let all = measured(side(32), &truth);
    let blurred: Vec<f64> = truth.iter().map(|v| v * 0.99).collect();
    let network = Some(SharedNetwork::new(Oracle { truth: Some(blurred), seed: 0 }));
    let settings = MethodSettings { network, ..MethodSettings::default() };
    let part = all.take(Some(&Order::ZigZag), 0.3).unwrap().with_noise(0.0).unwrap();
    let made = Method::PRIOR.prepare(&settings).unwrap().reconstruct(&part).unwrap();
    assert!(made.report.trust.unwrap() > 0.5, "{}", made.report);
    let found = coefficients(&made.image);
    for (&row, value) in part.rows().iter().zip(part.values()) {
        assert!((found[row as usize] - value).abs() < 1e-2);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn measured_values_stay_within_their_noise(
        kind in 0_u8..4, share in 0.05..1.0, order in 0_usize..3, seed in 0_u64..99, off in 0.5..1.5
    ) {
        let truth = scene(side(32), kind);
        let order = [Order::ZigZag, Order::CakeCutting, Order::Random(seed)][order].clone();
        let part = measured(side(32), &truth).take(Some(&order), share).unwrap();
        let near: Vec<f64> = truth.iter().map(|v| v * off).collect();
        for truth in [Some(near), None] {
            let made = ready(Oracle { truth, seed }).reconstruct(&part).unwrap();
            let found = coefficients(&made.image);
            let rounding = 2e-6 * part.values().iter().fold(0.0_f64, |m, v| m.max(v.abs())) * 32.0;
            let within = f64::from(WITHIN) * made.report.noise.unwrap() + rounding;
            for (&row, value) in part.rows().iter().zip(part.values()) {
                prop_assert!((found[row as usize] - value).abs() <= within);
            }
        }
    }

    #[test]
    fn gain_and_offset_go_through(gain in 1e-6..1e6_f64, offset in -3.0..3.0_f64, share in 0.1..1.0_f64) {
        // The network is given the same numbers, so its image is the same.
        let truth = scene(side(32), 1);
        let other: Vec<f64> = truth.iter().map(|v| gain * (v + offset)).collect();
        let seen = |truth: &[f64]| {
            let part = measured(side(32), truth).take(Some(&Order::ZigZag), share).unwrap();
            Seen::new(&part).unwrap()
        };
        let (one, two) = (seen(&truth), seen(&other));
        for (a, b) in [(one.values(), two.values()), (one.start(), two.start())] {
            prop_assert!(worst(a, b) < 1e-3, "{}", worst(a, b));
        }
        prop_assert!(worst(one.conditions(), two.conditions()) < 1e-3);
        prop_assert!((two.unit() / one.unit() / gain - 1.0_f64).abs() < 1e-5);
        prop_assert!((two.mean() / gain - one.mean() - offset).abs() < 1e-5);
    }
}

#[test]
fn a_choice_leaves_out_a_network_that_does_not_take_the_side() {
    let network = Some(SharedNetwork::new(Oracle { truth: None, seed: 1 }));
    let settings = MethodSettings { network, ..MethodSettings::default() };
    let auto = Method::AUTO.prepare(&settings).unwrap();
    let rows = Order::ZigZag.rows(side(8)).unwrap();
    let small = noisy(&rows, &scene(side(8), 1), 0.1, 1);
    let chosen = auto.reconstruct(&small).unwrap().report.chosen;
    assert!(chosen.is_some_and(|chosen| chosen != "prior"), "{chosen:?}");
}

#[test]
fn the_frames_of_a_kind_are_believed_together() {
    let truth = scene(side(32), 1);
    let rows = Order::ZigZag.rows(side(32)).unwrap().first(512);
    let frames: Vec<_> = (0..10).map(|k| noisy(&rows, &truth, 3.0, k)).collect();
    let error = |made: &[Reconstruction]| {
        let pixels = made.iter().flat_map(|made| made.image.pixels().iter().zip(&truth));
        pixels.map(|(found, truth)| (f64::from(*found) - truth).powi(2)).sum::<f64>().sqrt()
    };
    let right = ready(Oracle { truth: Some(truth.clone()), seed: 0 });
    let alone: Vec<_> = frames.iter().map(|frame| right.reconstruct(frame).unwrap()).collect();
    let together = stack(&*right, &frames).unwrap();
    assert!(together.iter().all(|made| made.report.trust == Some(1.0)));
    assert!(error(&together) < 1.02 * error(&alone), "{} {}", error(&together), error(&alone));
    // A network that is wrong is not believed for any.
    let wrong = ready(Oracle { truth: None, seed: 3 });
    for made in stack(&*wrong, &frames).unwrap() {
        assert!(made.report.to_string().contains("do not support the network"), "{}", made.report);
    }
}
