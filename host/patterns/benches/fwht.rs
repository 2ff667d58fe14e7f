//! Counts Walsh-Hadamard transforms per second: this crate's, the published crate `fwht`'s, and a
//! matrix product.
//!
//! `cargo bench -p nirspi-patterns --bench fwht`
use divan::{Bencher, black_box, counter::ItemsCount};
use nalgebra::{DMatrix, DVector};

const SIDES: [usize; 3] = [32, 64, 256];

fn main() {
    divan::main();
}

fn image(side: usize) -> Vec<f32> {
    (0..side * side).map(|i| (i * 7919 % 1009) as f32 / 1009.0 - 0.5).collect()
}

#[divan::bench(args = SIDES)]
fn ours(bencher: Bencher, side: usize) {
    bencher
        .counter(ItemsCount::new(1_usize))
        .with_inputs(|| image(side))
        .bench_local_refs(|x| nirspi_patterns::fwht(black_box(x)));
}

#[divan::bench(args = SIDES)]
fn published_crate_fwht(bencher: Bencher, side: usize) {
    bencher
        .counter(ItemsCount::new(1_usize))
        .with_inputs(|| image(side))
        .bench_local_refs(|x| fwht::fwht_mut::<[f32], f32>(black_box(&mut x[..])));
}

// 256 x 256 would need a 17 GB matrix.
#[divan::bench(args = [32, 64])]
fn matrix_product(bencher: Bencher, side: usize) {
    let n = side * side;
    let sign =
        |i: usize, j: usize| if (i & j).count_ones().is_multiple_of(2) { 1.0 } else { -1.0_f32 };
    let h = DMatrix::from_fn(n, n, sign);
    let x = DVector::from_vec(image(side));
    let mut y = DVector::zeros(n);
    bencher.counter(ItemsCount::new(1_usize)).bench_local(|| y.gemv(1.0, &h, black_box(&x), 0.0));
}
