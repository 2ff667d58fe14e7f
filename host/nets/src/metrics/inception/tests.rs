//! Tests against PyTorch, with 22 million weights that both sides compute by one formula.

use super::plan::{Plan, network};
use super::*;
use crate::weights::Array;

/// Pseudo-random numbers in [-1, 1): entry `at` of tensor `seed`.
fn noise(seed: u32, at: u32) -> f32 {
    let mut x =
        at.wrapping_mul(2_654_435_761).wrapping_add(seed.wrapping_mul(40_503)).wrapping_add(1);
    x ^= x >> 15;
    x = x.wrapping_mul(2_246_822_519);
    x ^= x >> 13;
    // 24 bits, which a float represents exactly.
    (x >> 8) as f32 / 8_388_608.0 - 1.0
}

fn array(shape: &[usize], seed: u32, middle: f32, spread: f32) -> Array {
    let count = shape.iter().product::<usize>() as u32;
    let values = (0..count).map(|at| middle + spread * noise(seed, at)).collect();
    Array { shape: shape.to_vec(), values }
}

/// Weights for all layers of the plan, numbered in its order.
fn fill(
    plans: &[Plan],
    block: &str,
    mut channels: usize,
    seed: &mut u32,
    out: &mut Weights,
) -> usize {
    for plan in plans {
        match plan {
            Plan::Convolution { name, outputs, kernel, .. } => {
                let shape = [*outputs, channels, kernel[0], kernel[1]];
                let fan_in = (channels * kernel[0] * kernel[1]) as f32;
                let parts: [(&str, &[usize], f32, f32); 5] = [
                    ("conv.weight", &shape, 0.0, (6.0 / fan_in).sqrt()),
                    ("bn.weight", &shape[..1], 1.0, 0.2),
                    ("bn.bias", &shape[..1], 0.0, 0.2),
                    ("bn.running_mean", &shape[..1], 0.0, 0.1),
                    ("bn.running_var", &shape[..1], 1.0, 0.5),
                ];
                for (part, shape, middle, spread) in parts {
                    out.insert(
                        format!("{block}{name}.{part}"),
                        array(shape, *seed, middle, spread),
                    );
                    *seed += 1;
                }
                channels = *outputs;
            }
            Plan::Branches { name, branches } => {
                let name = format!("{block}{name}");
                channels = branches.iter().map(|b| fill(b, &name, channels, seed, out)).sum();
            }
            Plan::Mean | Plan::Maximum { .. } => {}
        }
    }
    channels
}

fn weights() -> Weights {
    let mut weights = Weights::new("made up");
    assert_eq!(fill(&network(), "", 3, &mut 0, &mut weights), FEATURES);
    weights
}

/// An image of 32 x 20.
fn image() -> Vec<f32> {
    (0..32 * 20).map(|at| 0.5 + 0.5 * noise(9999, at)).collect()
}

/// Results of torch 2.15.0 with pytorch-fid 0.3.0's network, by `scripts/inception_reference.py`:
/// every 128th feature.
const PYTORCH: [f32; 16] = [
    1.74558, 1.62287, 0.0594491, 0.365007, 0.0062791, 9.7032, 0.0124156, 0.43627, 2.02133, 0.0,
    0.404889, 0.0, 1.27437, 2.51141, 0.37613, 0.980802,
];

#[test]
fn features_are_those_of_pytorch() {
    let network = Inception::new(&weights()).unwrap();
    let features = network.features(&image(), (32, 20)).unwrap();
    assert_eq!(features.len(), FEATURES);
    for (found, expected) in features.iter().step_by(128).zip(PYTORCH) {
        let off = (found - expected).abs();
        assert!(off < 1e-4 * expected.abs().max(1.0), "{found}, expected {expected}");
    }
    assert!(!network.is_of_fid(), "no classifier, so nothing says what weights these are");
}

#[test]
fn weights_of_another_network_and_odd_images_are_refused() {
    let mut weights = weights();
    let network = Inception::new(&weights).unwrap();
    assert_eq!(
        network.features(&[0.5; 6], (2, 4)),
        Err(ImageSize { found: 6, height: 2, width: 4 })
    );
    assert!(network.features(&[], (0, 4)).is_err());
    weights.insert(
        "Mixed_6c.branch7x7_2.conv.weight".to_owned(),
        array(&[160, 160, 7, 1], 1, 0.0, 1.0),
    );
    let error = Inception::new(&weights).unwrap_err().to_string();
    assert!(
        error.contains("Mixed_6c.branch7x7_2") && error.contains("160 x 160 x 1 x 7"),
        "{error}"
    );
}
