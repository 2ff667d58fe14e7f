//! Reconstruction where the light is nearly all scattered: a faint, blurred scene in a smooth glow,
//! with noise. There the unmeasured rows hold nothing to predict.

use super::*;
use crate::testing::{correlation_of, measured, normal, scene, side};
use rand::SeedableRng;
use rand_pcg::Pcg64;

/// A normal distribution of light around each point of the scene, of `sigma` pixels, without
/// reflection at the borders.
fn blurred(n: usize, scene: &[f64], sigma: f64) -> Vec<f64> {
    let reach = (3.0 * sigma).ceil() as isize;
    let weights: Vec<f64> =
        (-reach..=reach).map(|d| (-0.5 * (d as f64 / sigma).powi(2)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    let pass = |from: &[f64], step: usize, other: usize| -> Vec<f64> {
        let mut to = vec![0.0; n * n];
        for line in 0..n {
            for at in 0..n {
                for (w, d) in weights.iter().zip(-reach..) {
                    let p = (at as isize + d).clamp(0, n as isize - 1) as usize;
                    to[line * other + at * step] += w / sum * from[line * other + p * step];
                }
            }
        }
        to
    };
    pass(&pass(scene, 1, n), n, 1)
}

/// The scene seen through scatter: a share of its light blurred by `pixels`, the rest in a wide glow.
fn scattered(n: usize, kind: u8, share: f64, pixels: f64) -> Vec<f64> {
    let image = scene(side(n as u64), kind);
    let seen = blurred(n, &image, pixels);
    let glow = blurred(n, &image, n as f64 / 3.0);
    seen.iter().zip(&glow).map(|(s, g)| (1.0 - share) * s + share * g).collect()
}

/// What a method does to the correlation with a reference, against zero filling.
struct Tally {
    lost: usize,
    worst: f64,
    sum: f64,
}

#[test]
fn where_nearly_all_light_is_scattered_no_method_loses_against_zero_filling() {
    // The most correlation that a method may lose; the eye does not see such a loss.
    const MOST_LOST: f64 = 1e-4;
    let mut random = Pcg64::seed_from_u64(5);
    let mut tallies = METHODS.map(|_| Tally { lost: 0, worst: 0.0, sum: 0.0 });
    let mut cases = 0;
    for kind in [1, 2, 3] {
        for (scatter, pixels) in [(0.9, 2.0), (0.97, 2.0), (0.97, 4.0)] {
            let all = measured(side(32), &scattered(32, kind, scatter, pixels));
            let detail: f64 = all.values()[1..].iter().map(|v| v * v).sum();
            for noise in [0.002, 0.02] {
                let sigma = noise * detail.sqrt();
                let with_noise = |v: &f64| v + sigma * normal(&mut random);
                let noisy: Vec<f64> = all.values().iter().map(with_noise).collect();
                let noisy = Measurements::from_differential(all.rows(), &noisy).unwrap();
                for share in [0.1, 0.3] {
                    let part = noisy.take(Some(&Order::ZigZag), share).unwrap();
                    let images = METHODS.map(|method| image_by(method, &part));
                    // Without noise: an image with the noise of the readings favours zero filling.
                    let full = hadamard(&all);
                    let zero = correlation_of(&hadamard(&part), &full);
                    for (image, tally) in images.iter().zip(&mut tallies) {
                        let gain = correlation_of(image, &full) - zero;
                        tally.lost += usize::from(gain < -1e-5);
                        tally.worst = tally.worst.min(gain);
                        tally.sum += gain;
                    }
                    cases += 1;
                }
            }
        }
    }
    for (method, tally) in METHODS.iter().zip(&tallies) {
        let mean = tally.sum / f64::from(cases);
        println!(
            "{method}: {} of {cases} lost, at most {:.5}, mean {mean:+.4}",
            tally.lost, -tally.worst
        );
        assert!(tally.worst > -MOST_LOST, "{method} loses {}", -tally.worst);
        assert!(mean > 0.003, "{method} gains {mean}");
    }
}

const METHODS: [&str; 4] = ["omp", "fista", "tv", "tikhonov"];

fn image_by(method: &str, part: &Measurements) -> Image {
    let penalty = match method {
        "omp" => return omp(part, &OmpSettings::default()).unwrap().image,
        "fista" => Penalty::Sparse,
        "tv" => Penalty::TotalVariation,
        _ => Penalty::Tikhonov,
    };
    regularised(part, &RegularisedSettings::new(penalty)).unwrap().image
}
