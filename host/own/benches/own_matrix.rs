//! Times reconstructions from patterns of a user's own, more of them than pixels.
//!
//! `cargo bench -p nirspi-own --bench own_matrix`
#![expect(clippy::unwrap_used, reason = "a failed unwrap ends the benchmark")]

use divan::{Bencher, black_box};
use nirspi_own::OwnMatrix;
use nirspi_recon::Side;
use nirspi_recon::reconstruct::{MatrixMethod, MatrixSettings, Penalty};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

const PATTERNS: usize = 3999;

fn main() {
    divan::main();
}

/// Random patterns of zeros and ones, and their measurements of a disc, with noise and a dark level.
fn measured() -> (OwnMatrix, Vec<f64>) {
    let side = Side::new(16).unwrap();
    let mut random = Pcg64::seed_from_u64(1);
    let weights: Vec<f64> = (0..PATTERNS * side.area())
        .map(|_| f64::from(u8::from(random.random::<f64>() < 0.5)))
        .collect();
    let disc = |p: usize| {
        let (x, y) = (p as f64 % 16.0 - 7.5, (p / 16) as f64 - 7.5);
        f64::from(u8::from(x.hypot(y) < 5.0))
    };
    let light = |pattern: &[f64]| pattern.iter().enumerate().map(|(p, w)| w * disc(p)).sum::<f64>();
    let y = weights
        .chunks_exact(side.area())
        .map(|pattern| 5.0 + light(pattern) + random.random::<f64>())
        .collect();
    (OwnMatrix::new(side, &weights).unwrap(), y)
}

const METHODS: [(&str, MatrixMethod); 4] = [
    ("tikhonov", MatrixMethod::Penalty(Penalty::Tikhonov)),
    ("fista", MatrixMethod::Penalty(Penalty::Sparse)),
    ("tv", MatrixMethod::Penalty(Penalty::TotalVariation)),
    ("omp", MatrixMethod::Omp),
];

#[divan::bench(args = METHODS.map(|(name, _)| name), sample_count = 5, sample_size = 1)]
fn method(bencher: Bencher, name: &str) {
    let (own, y) = measured();
    let (_, method) = METHODS.into_iter().find(|(found, _)| *found == name).unwrap();
    let settings = MatrixSettings::new(method);
    bencher.bench(|| own.reconstruct(black_box(&y), &settings).unwrap());
}
