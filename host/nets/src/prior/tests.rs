use super::*;
use nirspi_recon::reconstruct::{Method, MethodSettings, Reconstruct, Reconstruction};
use nirspi_recon::{Measurements, Order, Rows, fwht};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

use crate::data::shapes::Shape;

fn method(network: Option<SharedNetwork>, word: &str) -> Box<dyn Reconstruct> {
    let settings = MethodSettings { network, ..MethodSettings::default() };
    word.parse::<Method>().unwrap().prepare(&settings).unwrap()
}

/// Measurements of a scene of `side` x `side`, with noise on each orthonormal coefficient.
fn measured(scene: &[f32], order: &Order, share: f64, noise: f64) -> Measurements {
    let n = scene.len().isqrt();
    let mut random = Pcg64::seed_from_u64(4);
    let mut d: Vec<f64> = scene.iter().map(|&v| v.into()).collect();
    fwht(&mut d).unwrap();
    for value in &mut d {
        *value += noise * n as f64 * random.sample::<f64, _>(StandardNormal);
    }
    let rows = Rows::natural(Side::new(n as u64).unwrap());
    Measurements::from_differential(&rows, &d).unwrap().take(Some(order), share).unwrap()
}

fn psnr_db(made: &Reconstruction, scene: &[f32]) -> f64 {
    let squared = |(a, b): (&f32, &f32)| f64::from(a - b).powi(2);
    let error: f64 = made.image.pixels().iter().zip(scene).map(squared).sum();
    -10.0 * (error / scene.len() as f64).log10()
}

/// Six scenes that are no training data: blobs, polygons, a star, bars, strokes and gradients.
fn scenes() -> Vec<Vec<f32>> {
    let shapes =
        [Shape::Blobs, Shape::Polygons, Shape::Star, Shape::Bars, Shape::Strokes, Shape::Gradient];
    let mut random = Pcg64::seed_from_u64(11);
    shapes.iter().map(|shape| shape.draw(&mut random)).collect()
}

fn mean_db(network: Option<SharedNetwork>, word: &str, share: f64, noise: f64) -> f64 {
    let method = method(network, word);
    let scenes = scenes();
    let db = scenes.iter().map(|scene| {
        let part = measured(scene, &Order::ZigZag, share, noise);
        // A scene without error would decide the mean.
        psnr_db(&method.reconstruct(&part).unwrap(), scene).min(60.0)
    });
    db.sum::<f64>() / scenes.len() as f64
}

#[test]
fn the_shipped_network_beats_the_classical_methods_on_drawn_scenes() {
    for (share, noise) in [(0.1, 0.0), (0.25, 0.02)] {
        let ours = mean_db(Some(shipped()), "prior", share, noise);
        for word in ["hadamard", "tikhonov", "tv"] {
            let theirs = mean_db(None, word, share, noise);
            println!("{share} {noise}: prior {ours:.2} dB, {word} {theirs:.2} dB");
            assert!(ours > theirs + 0.3, "{share}, {noise}: {ours}, {word} {theirs}");
        }
    }
}

#[test]
fn gain_and_offset_of_the_readings_are_those_of_the_image() {
    let method = method(Some(shipped()), "prior");
    let scene = &scenes()[1];
    let other: Vec<f32> = scene.iter().map(|v| 300.0 * v + 40.0).collect();
    for share in [0.08, 0.4, 1.0] {
        let image = |scene: &[f32]| {
            let part = measured(scene, &Order::CakeCutting, share, 0.0);
            method.reconstruct(&part).unwrap().image
        };
        let (one, two) = (image(scene), image(&other));
        for (a, b) in one.pixels().iter().zip(two.pixels()) {
            assert!((300.0 * a + 40.0 - b).abs() < 1.0, "{share}: {a}, {b}");
        }
    }
}

#[test]
fn any_order_share_and_side_gives_an_image_with_the_shipped_network() {
    let method = method(Some(shipped()), "prior");
    let orders =
        [Order::Natural, Order::Sequency, Order::RussianDolls, Order::Random(2), Order::Walsh2d];
    for n in [32_usize, 64, 128] {
        let scene: Vec<f32> =
            (0..n * n).map(|p| f32::from(u8::from(p / n > n / 3)) * 0.5 + 0.2).collect();
        for (order, share) in orders.iter().zip([0.01, 0.1, 0.3, 0.6, 1.0]) {
            let part = measured(&scene, order, share, 0.01);
            let made = method.reconstruct(&part).unwrap();
            assert!(made.image.pixels().iter().all(|pixel| pixel.is_finite()));
            let falls_back = share < 0.03;
            assert!(!falls_back || made.report.note.is_some(), "{n}, {order}: {}", made.report);
        }
    }
}

#[test]
fn a_side_without_training_is_an_error_that_names_a_method_for_it() {
    for n in [16_usize, 256] {
        let part = measured(&vec![0.5; n * n], &Order::Natural, 0.1, 0.01);
        let error = method(Some(shipped()), "prior").reconstruct(&part).unwrap_err().to_string();
        let words = format!(
            "the network prior does not complete images of {n} x {n} pixels: choose another \
             method, such as tikhonov"
        );
        assert_eq!(error, words);
    }
}

#[test]
fn every_method_can_be_prepared_with_the_settings_of_this_crate() {
    let part = measured(&scenes()[0], &Order::ZigZag, 0.2, 0.01);
    for ready in Method::ALL {
        let made = ready.prepare(&settings()).unwrap().reconstruct(&part).unwrap();
        // Every method but the network's own fit is told apart by its name in the report.
        // A choice reports the method that it chose.
        let chosen = made.report.chosen.map(|word| word.parse::<Method>().unwrap().name());
        assert_eq!(made.report.name, chosen.unwrap_or(ready.name()));
        assert!(made.report.note.is_none(), "{ready}: {}", made.report);
    }
}

#[test]
fn weights_of_another_network_are_refused_by_name() {
    let folder = std::env::temp_dir().join(format!("nirspi-prior-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("fsrcnn.safetensors");
    let weights = Weights::embedded("fsrcnn").unwrap();
    std::fs::write(&file, weights.to_bytes(crate::weights::Precision::Single).unwrap()).unwrap();
    let error = from_file(&file).unwrap_err().to_string();
    assert!(error.contains("weights of network fsrcnn, expected prior"), "{error}");
    std::fs::remove_dir_all(&folder).unwrap();
}
