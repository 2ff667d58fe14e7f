//! Times orthogonal matching pursuit over N = 1024 atoms: one frame with a prepared dictionary, and
//! the preparation.
//!
//! `cargo bench -p nirspi-recon --bench omp`. `benches/peers.py` beside this file times other
//! programs.
use divan::{Bencher, black_box, counter::ItemsCount};
use nalgebra::DMatrix;
use nirspi_recon::basis::Transform;
use nirspi_recon::omp::sampled::{Prior, SampledHadamard};
use nirspi_recon::omp::{
    Backend, DenseDictionary, Dictionary, Limits, Problem, Scalar, Solver, reference, solve_batch,
};
use nirspi_recon::reconstruct::{OmpSettings, omp};
use nirspi_recon::{Basis, Measurements, Order, Rows, Side};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

const ATOMS: usize = 1024;
const MEASUREMENTS: usize = 512;
const SPARSITY: usize = 64;

fn main() {
    divan::main();
}

fn dictionary<T: Scalar>(measurements: usize) -> DMatrix<T> {
    let mut random = Pcg64::seed_from_u64(1);
    DMatrix::from_fn(measurements, ATOMS, |_, _| T::from_f64(random.random_range(-1.0..1.0)))
}

fn frames<T: Scalar>(measurements: usize, count: usize) -> Vec<T> {
    let mut random = Pcg64::seed_from_u64(2);
    (0..measurements * count).map(|_| T::from_f64(random.random_range(-1.0..1.0))).collect()
}

#[divan::bench(types = [f32, f64])]
fn one_frame<T: Scalar>(bencher: Bencher) {
    let dictionary = DenseDictionary::<T>::new(&dictionary(MEASUREMENTS));
    let y = frames(MEASUREMENTS, 1);
    let Ok(mut solver) = Solver::new(&dictionary, &Limits::atoms(SPARSITY)) else { return };
    bencher.bench_local(|| solver.solve(black_box(&y)).map(|path| path.coefficients(SPARSITY)));
}

#[divan::bench(args = [(256, 16), (256, 64), (512, 16), (512, 256), (1024, 64), (1024, 256)])]
fn one_frame_of_m_and_k(bencher: Bencher, (measurements, sparsity): (usize, usize)) {
    let dictionary = DenseDictionary::<f32>::new(&dictionary(measurements));
    let y = frames(measurements, 1);
    let Ok(mut solver) = Solver::new(&dictionary, &Limits::atoms(sparsity)) else { return };
    bencher.bench_local(|| solver.solve(black_box(&y)).map(|path| path.coefficients(sparsity)));
}

#[divan::bench]
fn projection_of_one_frame(bencher: Bencher) {
    let dictionary = DenseDictionary::<f32>::new(&dictionary(MEASUREMENTS));
    let (y, mut p0) = (frames(MEASUREMENTS, 1), vec![0.0; ATOMS]);
    bencher.bench_local(|| dictionary.project(black_box(&y), &mut p0));
}

#[divan::bench(types = [f32, f64])]
fn batch_of_256<T: Scalar>(bencher: Bencher) {
    let dictionary = DenseDictionary::<T>::new(&dictionary(MEASUREMENTS));
    let y = frames(MEASUREMENTS, 256);
    let problem = Problem { dictionary: &dictionary, limits: Limits::atoms(SPARSITY) };
    bencher
        .counter(ItemsCount::new(256_usize))
        .bench_local(|| solve_batch(&problem, black_box(&y), Backend::Cpu));
}

#[divan::bench(types = [f32, f64])]
fn preparation<T: Scalar>(bencher: Bencher) {
    let matrix = dictionary::<T>(MEASUREMENTS);
    bencher.bench_local(|| DenseDictionary::new(black_box(&matrix)));
}

#[divan::bench(sample_count = 10)]
fn reference_with_its_gram(bencher: Bencher) {
    let dictionary = dictionary::<f64>(MEASUREMENTS);
    let y = frames::<f64>(MEASUREMENTS, 1);
    let limits = Limits::atoms(SPARSITY);
    bencher.bench_local(|| reference::solve(&dictionary, black_box(&y), &limits));
}

#[divan::bench(args = Basis::ALL)]
fn one_frame_by_transforms(bencher: Bencher, basis: Basis) {
    let Ok(rows) = Order::Random(1).rows(Side::INSTRUMENT) else { return };
    let rows = rows.first(MEASUREMENTS);
    let y = frames(MEASUREMENTS, 1);
    let transform = Transform::new(basis, Side::INSTRUMENT);
    let prior = Prior::none(ATOMS);
    let dictionary = SampledHadamard::new(&transform, &rows, &prior);
    let Ok(mut solver) = Solver::new(&dictionary, &Limits::atoms(SPARSITY)) else { return };
    bencher.bench_local(|| solver.solve(black_box(&y)).map(|path| path.coefficients(SPARSITY)));
}

/// The whole of [`omp`] with its default settings, cross-validation included, on 30 % of a frame.
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
    let part = Measurements::from_differential(&Rows::natural(side), &image)
        .and_then(|all| all.take(Some(&Order::CakeCutting), 0.3));
    let Ok(part) = part else { return };
    bencher.bench_local(|| omp(black_box(&part), &OmpSettings::default()));
}
