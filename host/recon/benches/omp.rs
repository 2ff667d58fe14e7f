//! Orthogonal matching pursuit on one frame: N = 1024 atoms, M = 512 measurements, K = 64 atoms chosen.
//!
//! `cargo bench -p nirspi-recon --bench omp`
//!
//! The Gram matrix is computed beforehand where the name does not say otherwise, as the paper does it.
use divan::{Bencher, black_box};
use nalgebra::{DMatrix, DVector};
use nirspi_recon::basis::Transform;
use nirspi_recon::omp::fast::{DenseGram, pursue};
use nirspi_recon::omp::sampled::{Prior, SampledHadamard};
use nirspi_recon::omp::{Limits, fast, reference};
use nirspi_recon::reconstruct::{OmpSettings, omp};
use nirspi_recon::{Basis, Measurements, Order, Side};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

const ATOMS: usize = 1024;
const MEASUREMENTS: usize = 512;
const LIMITS: Limits = Limits { sparsity: 64, residual: 0.0 };

fn main() {
    divan::main();
}

fn problem() -> (DMatrix<f32>, Vec<f32>) {
    let mut random = Pcg64::seed_from_u64(1);
    let dictionary =
        DMatrix::from_fn(MEASUREMENTS, ATOMS, |_, _| random.random_range(-1.0..1.0_f32));
    let y = (0..MEASUREMENTS).map(|_| random.random_range(-1.0..1.0_f32)).collect();
    (dictionary, y)
}

#[divan::bench]
fn fast_f32_gram_given(bencher: Bencher) {
    let (dictionary, y) = problem();
    let gram = DenseGram::new(&dictionary);
    let y = DVector::from_vec(y);
    bencher.bench_local(|| {
        let p0 = dictionary.tr_mul(black_box(&y));
        let energy = f64::from(y.norm_squared());
        pursue(&gram, p0.as_slice(), energy, &LIMITS).map(|path| path.coefficients(LIMITS.sparsity))
    });
}

#[divan::bench]
fn fast_f32_with_its_gram(bencher: Bencher) {
    let (dictionary, y) = problem();
    bencher.bench_local(|| fast::solve(&dictionary, black_box(&y), &LIMITS));
}

#[divan::bench(sample_count = 10)]
fn reference_f64_with_its_gram(bencher: Bencher) {
    let (dictionary, y) = problem();
    let dictionary = dictionary.map(f64::from);
    let y: Vec<f64> = y.into_iter().map(f64::from).collect();
    bencher.bench_local(|| reference::solve(&dictionary, black_box(&y), &LIMITS));
}

#[divan::bench(args = [Basis::Dct, Basis::Haar])]
fn fast_f32_gram_by_transforms(bencher: Bencher, basis: Basis) {
    let Ok(mut rows) = Order::Random(1).rows(Side::INSTRUMENT) else { return };
    rows.truncate(MEASUREMENTS);
    let mut grid = vec![0.0; ATOMS];
    rows.iter().zip(problem().1).for_each(|(&row, y)| grid[row as usize] = y);
    let energy = grid.iter().map(|&v| f64::from(v * v)).sum();
    let transform = Transform::new(basis, Side::INSTRUMENT);
    let prior = Prior::none(ATOMS);
    let gram = SampledHadamard::new(&transform, &rows, &prior);
    bencher.bench_local(|| {
        let p0 = gram.project(black_box(&grid).clone());
        pursue(&gram, &p0, energy, &LIMITS).map(|path| path.coefficients(LIMITS.sparsity))
    });
}

/// The whole of [`omp`] with its defaults (cross-validation and all) on 30 % of a frame.
#[divan::bench(args = [32, 64, 128], sample_count = 3, sample_size = 1)]
fn reconstruct_default_30_percent(bencher: Bencher, side: u64) {
    let Ok(side) = Side::new(side) else { return };
    let n = side.pixels();
    let mut image: Vec<f64> = (0..side.area())
        .map(|p| {
            let (r, c) = (p / n * 64 / n, p % n * 64 / n);
            f64::from(u8::from(
                r > 12 && r < 50 && (c > 20 && c < 28 || r < 20 && c > 20 && c < 48),
            ))
        })
        .collect();
    if nirspi_recon::fwht(&mut image).is_err() {
        return;
    }
    let rows: Vec<i64> = (0..side.area() as i64).collect();
    let part = Measurements::from_differential(side, &rows, &image)
        .and_then(|all| all.take(Some(&Order::CakeCutting), 0.3));
    let Ok(part) = part else { return };
    bencher.bench_local(|| omp(black_box(&part), &OmpSettings::default()));
}
