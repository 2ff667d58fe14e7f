//! The fast way to Tikhonov's images, beside the one that all penalties have.

use super::super::folds::Products;
use super::super::gram::{are_independent, gram};
use super::super::many::{Kept, Many};
use super::super::problem::Prepared;
use super::super::{MatrixMethod, MatrixSettings, OwnMatrix, Penalty, STRENGTHS, images, rank};
use super::{normal, patterns, scene, seen, side};
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_pcg::Pcg64;

#[test]
fn all_folds_at_once_give_what_each_alone_gives() {
    let side = side(8);
    for (kind, count, dark) in [(0, 40, true), (1, 64, true), (2, 30, false), (0, 20, false)] {
        let image = scene(side, 2);
        let weights = patterns(kind, count, 64, 4);
        let own = OwnMatrix::new(side, &weights).unwrap();
        let y: Vec<f64> = seen(&weights, &image, 0.05).iter().map(|y| 1e-3 * y + 0.04).collect();
        let method = MatrixMethod::Penalty(Penalty::Tikhonov);
        let settings = MatrixSettings { dark, ..MatrixSettings::new(method) };
        let alone = Many::new(&own, &settings, &[&y], &Kept::default())
            .errors(method, &[0], |prepared| {
                Ok(vec![prepared.problem(&y).penalised(Penalty::Tikhonov, &STRENGTHS)])
            })
            .unwrap()
            .remove(0);
        let products = Products::new(&own, &settings).unwrap();
        let folds = products.folds(&own, &y, None);
        let case = format!("kind {kind}, {count} patterns, dark {dark}");
        for (k, (one, all)) in alone.iter().zip(folds.errors()).enumerate() {
            assert!((all / one - 1.0).abs() < 0.02, "{case}, {}: {one}, {all}", STRENGTHS[k]);
        }
        let every: Vec<usize> = (0..y.len()).collect();
        let whole = Prepared::new(&own, &settings, every).unwrap();
        let (found, strength) = folds.chosen();
        let at = STRENGTHS.iter().position(|&known| known == strength).unwrap();
        let expected = whole.problem(&y).penalised(Penalty::Tikhonov, &STRENGTHS).remove(at);
        let apart = (&found.pixels - &expected.pixels).norm() / expected.pixels.norm();
        assert!(apart < 2e-3, "{case}: {apart}");
        let (dark, other) = (found.dark.value(), expected.dark.value());
        assert!((dark - other).abs() < 1e-4, "{case}: {dark}, {other}");
    }
}

/// Sizes around those of the blocks.
#[test]
fn products_of_images_are_those_of_the_definition() {
    let mut random = Pcg64::seed_from_u64(2);
    for (pixels, count) in [(1, 1), (1030, 3), (40, 255), (33, 256), (70, 258)] {
        let images = DMatrix::from_fn(pixels, count, |_, _| normal(&mut random) as f32);
        let exact = images.map(f64::from);
        let exact = exact.transpose() * &exact;
        assert!((gram(&images) - &exact).amax() < 1e-4 * exact.amax(), "{count} of {pixels}");
    }
}

/// A pattern that is nearly a combination of others is one, wherever it stands.
#[test]
fn only_independent_images_are_said_to_be_independent() {
    let mut random = Pcg64::seed_from_u64(3);
    let (count, pixels) = (600, 700);
    let weights = DMatrix::from_fn(count, pixels, |_, _| normal(&mut random));
    let products = |weights: &DMatrix<f64>| {
        gram(&images(weights, |image| image.iter().map(|&weight| weight as f32).collect()))
    };
    assert!(are_independent(products(&weights), 1e-4));
    assert_eq!(rank(&weights), count);
    for at in [1, 255, 256, 300, 599] {
        let mut other = weights.clone();
        let sum = (other.row(0) + other.row(if at == 300 { 17 } else { 0 })) * 0.5;
        other.row_mut(at).copy_from(&sum);
        assert!(!are_independent(products(&other), 1e-4), "{at}");
        assert_eq!(rank(&other), count - 1, "{at}");
    }
}
