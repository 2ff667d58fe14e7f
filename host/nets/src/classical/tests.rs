use super::total_variation::{difference, divergence};
use super::*;
use proptest::prelude::*;

const SIDE: usize = 64;

/// A letter E, bright on dark, with a margin.
fn letter() -> Vec<f32> {
    let ink = |r: usize, c: usize| {
        let stem = (12..52).contains(&r) && (16..23).contains(&c);
        let arms = [12, 29, 46].iter().any(|&top| (top..top + 6).contains(&r));
        stem || (arms && (16..46).contains(&c))
    };
    (0..SIDE * SIDE).map(|at| if ink(at / SIDE, at % SIDE) { 0.9 } else { 0.05 }).collect()
}

/// White noise of standard deviation 1 from a seed: the sum of twelve uniform numbers (PCG's
/// multiplier), minus six.
fn noise(count: usize, mut state: u64) -> Vec<f32> {
    let mut uniform = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1_u64 << 24) as f32
    };
    (0..count).map(|_| (0..12).map(|_| uniform()).sum::<f32>() - 6.0).collect()
}

fn degraded(sigma_px: f32, strength: f32) -> Vec<f32> {
    let blurred = Blur::new(SIDE, SIDE, sigma_px).apply(&letter());
    let noise = noise(blurred.len(), 7);
    blurred.iter().zip(noise).map(|(b, n)| (b + strength * n).clamp(0.0, 1.0)).collect()
}

fn psnr_db(test: &[f32]) -> f64 {
    let reference = letter();
    let squares: f64 =
        reference.iter().zip(test).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
    10.0 * (reference.len() as f64 / squares).log10()
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}

/// Images of 7 x 5, smaller than most kernels.
fn small() -> impl Strategy<Value = Vec<f32>> {
    prop::collection::vec(0.0_f32..=1.0, 35)
}

proptest! {
    #[test]
    fn differences_and_divergence_are_adjoint(image in small(), edges in small(), more in small()) {
        let field: Vec<[f32; 2]> = edges.iter().zip(&more).map(|(&a, &b)| [a, b]).collect();
        let left: f64 = (0..35)
            .map(|at| {
                let [right, down] = difference(&image, at, 5);
                f64::from(right * field[at][0] + down * field[at][1])
            })
            .sum();
        let back: Vec<f32> = (0..35).map(|at| -divergence(&field, at, 5)).collect();
        prop_assert!((left - dot(&image, &back)).abs() < 1e-4);
    }

    #[test]
    fn every_result_is_an_image_and_each_image_on_its_own(
        a in small(), b in small(), sigma in 0.0_f32..3.0, noise in 0.0_f32..0.2
    ) {
        let stack: Vec<f32> = a.iter().chain(&b).copied().collect();
        for method in Method::ALL {
            let both = deblur(method, &stack, (7, 5), sigma, noise).unwrap();
            prop_assert!(both.iter().all(|v| (0.0..=1.0).contains(v)), "{method}: {both:?}");
            prop_assert_eq!(&both[35..], &deblur(method, &b, (7, 5), sigma, noise).unwrap()[..]);
        }
    }

    #[test]
    fn what_nothing_has_touched_comes_back_as_it_was(image in small()) {
        for method in Method::ALL {
            prop_assert_eq!(&deblur(method, &image, (7, 5), 0.0, 0.0).unwrap(), &image);
        }
    }

    #[test]
    fn a_flat_image_stays_flat(level in 0.01_f32..0.99, sigma in 0.0_f32..3.0, noise in 0.0_f32..0.1) {
        for method in Method::ALL {
            let flat = deblur(method, &[level; 35], (7, 5), sigma, noise).unwrap();
            prop_assert!(flat.iter().all(|v| (v - level).abs() < 1e-3), "{method}: {flat:?}");
        }
    }
}

#[test]
fn each_method_brings_a_blurred_letter_closer_to_itself() {
    for (sigma_px, strength) in [(1.0, 0.02), (2.0, 0.03), (3.0, 0.01)] {
        let given = degraded(sigma_px, strength);
        let before = psnr_db(&given);
        for method in Method::ALL {
            let sharp = deblur(method, &given, (SIDE, SIDE), sigma_px, strength).unwrap();
            let after = psnr_db(&sharp);
            assert!(after > before + 0.5, "{method}, sigma {sigma_px}: {before} to {after} dB");
        }
    }
}

#[test]
fn richardson_lucy_stops_before_it_draws_the_noise() {
    let given = degraded(2.0, 0.05);
    let told = deblur(Method::RichardsonLucy, &given, (SIDE, SIDE), 2.0, 0.05).unwrap();
    let not_told = deblur(Method::RichardsonLucy, &given, (SIDE, SIDE), 2.0, 0.0).unwrap();
    assert!(psnr_db(&told) > psnr_db(&not_told) + 1.0);
}

#[test]
fn least_total_variation_leaves_what_noise_explains() {
    let given = degraded(2.0, 0.03);
    let sharp = deblur(Method::TotalVariation, &given, (SIDE, SIDE), 2.0, 0.03).unwrap();
    let again = Blur::new(SIDE, SIDE, 2.0).apply(&sharp);
    let residual: f32 = again.iter().zip(&given).map(|(a, b)| (a - b).powi(2)).sum();
    let quotient = residual / noise_budget(&given, 0.03);
    assert!((0.9..1.1).contains(&quotient), "{quotient} of the noise's power");
}

#[test]
fn what_cannot_be_deblurred_is_named() {
    let by = |stack: &[f32], size, sigma_px, noise| {
        deblur(Method::Wiener, stack, size, sigma_px, noise).unwrap_err()
    };
    let flat = [0.5; 24];
    let shape = |height, width, found| ClassicalError::Shape { found, height, width };
    assert_eq!(by(&flat, (5, 5), 1.0, 0.0), shape(5, 5, 24));
    assert_eq!(by(&flat, (0, 5), 1.0, 0.0), shape(0, 5, 24));
    assert_eq!(by(&[], (4, 6), 1.0, 0.0), shape(4, 6, 0));
    assert_eq!(by(&flat, (usize::MAX, 2), 1.0, 0.0), shape(usize::MAX, 2, 24));
    for found in [-1.0, 6.5] {
        assert_eq!(by(&flat, (4, 6), found, 0.0), ClassicalError::Sigma { found, most: 6 });
        assert_eq!(by(&flat, (4, 6), 1.0, found), ClassicalError::Noise { found });
    }
    assert!(matches!(by(&flat, (4, 6), f32::NAN, 0.0), ClassicalError::Sigma { .. }));
    let mut bright = flat;
    bright[12 + 6 + 2] = 1.5;
    let pixel = ClassicalError::Pixel { image: 1, row: 1, column: 2, value: 1.5 };
    assert_eq!(by(&bright, (2, 6), 1.0, 0.0), pixel);
    assert_eq!("rl".parse(), Ok(Method::RichardsonLucy));
    assert!("lucy".parse::<Method>().is_err());
}
