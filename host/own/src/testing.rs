//! Shared test support: scenes and their measurements, as in `nirspi-recon`.

use nirspi_recon::{Image, Measurements, Rows, Shape, Side, fwht};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

pub(crate) fn side(n: u64) -> Side {
    Side::new(n).unwrap()
}

/// The scene of this kind: 0 random, 1 blobs and an edge, 2 a letter-like figure, 3 a point, 4
/// flat.
pub(crate) fn scene(side: Side, kind: u8) -> Vec<f64> {
    let n = side.pixels();
    let mut random = Pcg64::seed_from_u64(7);
    (0..side.area())
        .map(|p| {
            let (r, c) = ((p / n) as f64 / n as f64, (p % n) as f64 / n as f64);
            match kind {
                0 => random.random::<f64>(),
                1 => {
                    let blob = (-((r - 0.3).powi(2) + (c - 0.6).powi(2)) / 0.02).exp();
                    0.1 + blob + if c + 0.5 * r < 0.45 { 0.4 } else { 0.0 }
                }
                2 => {
                    let stem = (0.2..0.8).contains(&r) && (0.3..0.42).contains(&c);
                    let bar = (0.2..0.32).contains(&r) && (0.3..0.75).contains(&c);
                    0.05 + if stem || bar { 0.9 } else { 0.0 }
                }
                3 => f64::from(p == side.area() / 3),
                _ => 0.5,
            }
        })
        .collect()
}

/// Weights of patterns of zeros and ones, one after another, and their measurements of a scene with
/// normal noise of this deviation.
pub(crate) fn binary_patterns(
    count: usize,
    scene: &[f64],
    sigma: f64,
    seed: u64,
) -> (Vec<f64>, Vec<f64>) {
    let mut random = Pcg64::seed_from_u64(seed);
    let weights: Vec<f64> =
        (0..count * scene.len()).map(|_| f64::from(u8::from(random.random::<bool>()))).collect();
    let y = weights
        .chunks_exact(scene.len())
        .map(|pattern| {
            let light: f64 = pattern.iter().zip(scene).map(|(w, v)| w * v).sum();
            light + sigma * normal(&mut random)
        })
        .collect();
    (weights, y)
}

/// All of a scene's measurements, in natural order.
pub(crate) fn measured(side: Side, scene: &[f64]) -> Measurements {
    let mut d = scene.to_vec();
    fwht(&mut d).unwrap();
    Measurements::from_differential(&Rows::natural(side), &d).unwrap()
}

/// A random number of the standard normal distribution (Box and Muller).
pub(crate) fn normal(random: &mut Pcg64) -> f64 {
    let (u, v): (f64, f64) = (1.0 - random.random::<f64>(), random.random());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

pub(crate) fn correlation_of(a: &Image<impl Shape>, b: &Image<impl Shape>) -> f64 {
    let size = a.size();
    assert_eq!(b.size(), size);
    nirspi_recon::metrics::correlation(a.pixels(), b.pixels(), size.width(), size.height()).unwrap()
}
