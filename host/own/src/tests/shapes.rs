//! Images that are no square, or squares without a Hadamard matrix.

use super::{METHODS, patterns, seen};
use crate::testing::{correlation_of, side};
use crate::{MatrixError, OwnMatrix};
use nalgebra::DMatrix;
use nirspi_recon::reconstruct::{MatrixMethod, MatrixSettings, Penalty};
use nirspi_recon::{Basis, Image, Size};

/// A dark image with two bright parts, which no symmetry maps onto itself.
fn scene(size: Size) -> Vec<f64> {
    let (height, width) = (size.height(), size.width());
    let at = |p: usize| ((p / width) as f64 / height as f64, (p % width) as f64 / width as f64);
    let value = |(r, c): (f64, f64)| match () {
        () if (0.2..0.5).contains(&r) && (0.1..0.7).contains(&c) => 1.0,
        () if r > 0.6 && c > 0.5 => 0.6,
        () => 0.1,
    };
    (0..size.area()).map(|p| value(at(p))).collect()
}

#[test]
fn images_of_any_shape_are_found_by_every_method() {
    for (height, width) in [(12, 15), (10, 10), (7, 20), (33, 3)] {
        let size = Size::new(height, width).unwrap();
        let truth = scene(size);
        let weights = patterns(0, size.area() * 9 / 10, size.area(), 3);
        let y = seen(&weights, &truth, 0.01);
        let exact = Image::new(size, truth.iter().map(|&v| v as f32).collect());
        let own = OwnMatrix::new(size, &weights).unwrap();
        for method in METHODS.into_iter().chain([MatrixMethod::Best]) {
            let found = own.reconstruct(&y, &MatrixSettings::new(method)).unwrap();
            assert_eq!(found.image.size(), size);
            let alike = correlation_of(&found.image, &exact);
            let enough = match method {
                MatrixMethod::PseudoInverse => 0.85,
                MatrixMethod::Best => 0.97,
                _ => 0.92,
            };
            assert!(alike > enough, "{size}, {method:?}: {alike}");
        }
    }
}

/// Turned patterns give the turned image: rows and columns are nowhere mistaken for each other.
#[test]
fn transposed_patterns_give_the_transposed_image() {
    let (size, turned) = (Size::new(9, 14).unwrap(), Size::new(14, 9).unwrap());
    let weights = patterns(0, 80, size.area(), 7);
    let turn = |image: &[f64]| DMatrix::from_row_slice(9, 14, image).as_slice().to_vec();
    let turned_weights: Vec<f64> = weights.chunks_exact(size.area()).flat_map(turn).collect();
    let y = seen(&weights, &scene(size), 0.01);
    for method in METHODS {
        let settings = MatrixSettings::new(method);
        let of = |size, weights: &[f64]| {
            OwnMatrix::new(size, weights).unwrap().reconstruct(&y, &settings).unwrap().image
        };
        let (image, other) = (of(size, &weights), of(turned, &turned_weights));
        let image: Vec<f64> = image.pixels().iter().map(|&v| v.into()).collect();
        for (a, b) in turn(&image).iter().zip(other.pixels()) {
            assert!((a - f64::from(*b)).abs() < 0.02, "{method:?}: {a} and {b}");
        }
    }
}

/// As many orthogonal patterns as pixels: the cosines of the size.
#[test]
fn complete_orthogonal_sets_of_any_shape_are_inverted_in_one_step() {
    let size = Size::new(6, 10).unwrap();
    let cosine = |n: usize, k: usize, p: usize| nirspi_recon::basis::cosine(n, k, p);
    let weights: Vec<f64> = (0..60 * 60)
        .map(|at| (at / 60, at % 60))
        .map(|(k, p)| cosine(6, k / 10, p / 10) * cosine(10, k % 10, p % 10))
        .collect();
    let own = OwnMatrix::new(size, &weights).unwrap();
    assert!(super::super::complete::is_complete(&own));
    let truth = scene(size);
    let (dark, strength) = (false, Some(1e-9));
    let settings = MatrixSettings { dark, strength, ..MatrixSettings::new(MatrixMethod::Best) };
    let found = own.reconstruct(&seen(&weights, &truth, 0.0), &settings);
    for (found, truth) in found.unwrap().image.pixels().iter().zip(&truth) {
        assert!((f64::from(*found) - truth).abs() < 1e-3, "{found} and {truth}");
    }
}

/// A complete set has the detail of the scene, and readings taken twice tell it from noise.
#[test]
fn fine_detail_of_a_complete_set_is_kept_where_the_noise_is_known_to_be_less() {
    let sign = |at: usize| ((at / 256) & (at % 256)).count_ones().is_multiple_of(2);
    let weights: Vec<f64> = (0..256 * 256).map(|at| if sign(at) { 1.0 } else { -1.0 }).collect();
    let own = OwnMatrix::new(side(16), &weights).unwrap();
    // Half of the pixels, in no order.
    let truth: Vec<f64> =
        (0..256_u32).map(|p| f64::from(p.wrapping_mul(2_654_435_761) >> 31)).collect();
    for sigma in [0.0, 0.5] {
        let y = seen(&weights, &truth, sigma);
        let error = |most_noise| {
            let most_noise = vec![most_noise];
            let method = MatrixMethod::Penalty(Penalty::Tikhonov);
            let settings = MatrixSettings { most_noise, ..MatrixSettings::new(method) };
            let found = own.reconstruct(&y, &settings).unwrap();
            let missed = found.image.pixels().iter().zip(&truth);
            missed.map(|(a, b)| (f64::from(*a) - b).powi(2)).sum::<f64>() / 256.0
        };
        let (alone, told) = (error(None), error(Some(sigma)));
        // Without its mean, the scene has a variance of 1/4.
        assert!(alone > 0.05 && told < 0.005 + sigma * sigma / 64.0, "{sigma}: {alone}, {told}");
        assert_eq!(error(Some(1e3)), alone, "a limit above the estimated noise changes nothing");
    }
    // Each of several measurements has its own.
    let y = seen(&weights, &truth, 0.5);
    let method = MatrixMethod::Penalty(Penalty::Tikhonov);
    let of = |most_noise: Vec<Option<f64>>, all: &[&[f64]]| {
        let settings = MatrixSettings { most_noise, ..MatrixSettings::new(method) };
        own.reconstruct_all(all, &settings).unwrap()
    };
    let both = of(vec![None, Some(0.5)], &[&y, &y]);
    assert_eq!(both[..1], of(vec![None], &[&y])[..]);
    assert_eq!(both[1..], of(vec![Some(0.5)], &[&y])[..]);
    assert_ne!(both[0], both[1]);
}

#[test]
fn wavelets_are_refused_where_there_are_none() {
    let size = Size::new(12, 15).unwrap();
    let own = OwnMatrix::new(size, &patterns(0, 40, 180, 3)).unwrap();
    for basis in [Basis::Haar, Basis::Daubechies4] {
        let settings = MatrixSettings { basis, ..MatrixSettings::new(MatrixMethod::Omp) };
        let wrong = own.reconstruct(&[0.0; 40], &settings).unwrap_err();
        assert_eq!(wrong, MatrixError::Basis { basis, size });
        assert!(wrong.to_string().contains("basis of 12 x 15 images, expected dct or pixel"));
    }
}
