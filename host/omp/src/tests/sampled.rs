//! Tests of the sampled Hadamard dictionary against the written-out matrix.

use super::{Problem, agreeing};
use crate::sampled::{Prior, SampledHadamard};
use crate::testing::{normal, side};
use crate::{Backend, Dictionary, Limits, Solver, padded, reference};
use nalgebra::DMatrix;
use nirspi_patterns::basis::{Basis, Transform};
use nirspi_patterns::{Order, fwht};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_pcg::Pcg64;

/// The matrix of a [`SampledHadamard`], with its prior, written out in `f64`.
fn written_out(transform: &Transform, rows: &[u32], prior: &Prior) -> DMatrix<f64> {
    let area = transform.side().area();
    let n = transform.side().pixels() as f64;
    let mut dictionary = DMatrix::zeros(rows.len() + area, area);
    for atom in 0..area {
        let mut image = vec![0.0_f32; area];
        image[atom] = 1.0;
        transform.synthesise(&mut image);
        let mut seen: Vec<f64> = image.into_iter().map(f64::from).collect();
        fwht(&mut seen).unwrap();
        let scale = f64::from(prior.scale[atom]);
        for (m, &row) in rows.iter().enumerate() {
            dictionary[(m, atom)] = seen[row as usize] / n * scale;
        }
        dictionary[(rows.len() + atom, atom)] = f64::from(prior.noise);
    }
    dictionary
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn fast_transforms_stand_for_the_dictionary_and_its_prior(
        basis in prop::sample::select(Basis::ALL.to_vec()),
        random_rows: bool,
        with_prior: bool,
        share in 0.1..1.0,
        seed: u64,
    ) {
        let side = side(8);
        let order = if random_rows { Order::Random(seed) } else { Order::ZigZag };
        let rows = order.rows(side).unwrap().first((share * 64.0) as usize);
        let mut random = Pcg64::seed_from_u64(seed);
        let transform = Transform::new(basis, side);
        let mut prior = Prior::none(64);
        if with_prior {
            let frequencies = basis.frequencies(side);
            prior.scale = frequencies.iter().map(|f| 1.0 / f.max(1.0)).collect();
            prior.noise = 0.1;
        }
        let gram = SampledHadamard::new(&transform, &rows, &prior);
        let dictionary = written_out(&transform, &rows, &prior);
        let dense = dictionary.tr_mul(&dictionary);
        let mut column = vec![0.0; padded(64)];
        for atom in 0..64 {
            gram.gram_column(atom, &mut column);
            for (k, value) in column.iter().enumerate() {
                prop_assert!((f64::from(*value) - dense[(k, atom)]).abs() < 1e-5);
            }
            let energy = f64::from(gram.atoms().energies()[atom]);
            prop_assert!((energy - dense[(atom, atom)]).abs() < 1e-5);
        }

        let measured: Vec<f32> = rows.iter().map(|_| normal(&mut random) as f32).collect();
        let mut y: Vec<f64> = measured.iter().map(|&y| y.into()).collect();
        y.resize(rows.len() + 64, 0.0);
        let limits = Limits { residual: 0.05, ..Limits::atoms(rows.len() / 4) };
        let path = Solver::new(&gram, &limits).unwrap().solve(&measured).unwrap().solution();
        let exact = reference::solve(&dictionary, &y, &limits).unwrap();
        prop_assert_eq!(&path.unseen, &exact.unseen);
        let problem = Problem { recipe: String::new(), dictionary, y, sparse: vec![] };
        let same = agreeing(&problem, &exact, &path, 1e-5);
        prop_assert_eq!(exact.support.is_empty(), path.support.is_empty());
        if same == exact.support.len() && same == path.support.len() {
            for (a, b) in exact.coefficients.iter().zip(&path.coefficients) {
                prop_assert!((a - b).abs() < 1e-3 * a.abs().max(1.0), "{} and {}", a, b);
            }
        }
    }
}

#[test]
fn dct_atoms_that_a_random_half_does_not_see_are_left_out() {
    let side = side(32);
    let rows =
        Order::Table(nirspi_patterns::order::shuffled(1024, 1)).rows(side).unwrap().first(512);
    let transform = Transform::new(Basis::Dct, side);
    let prior = Prior::none(1024);
    let gram = SampledHadamard::new(&transform, &rows, &prior);
    let y: Vec<f32> = (0..512).map(|m| (m as f32).sin()).collect();
    let limits = Limits { residual: 1e-2, ..Limits::atoms(500) };
    let found = Solver::new(&gram, &limits).unwrap().solve(&y).unwrap().solution();
    let missed: Vec<usize> = (0..1024).filter(|&k| gram.atoms().energies()[k] < 1e-9).collect();
    // These atoms have only a few Walsh functions; the mean is one of them.
    assert_eq!(missed, [0, 520, 528, 536]);
    assert_eq!(found.unseen, missed);
    assert!(found.coefficients.iter().all(|c| c.is_finite()));
    assert!(found.support.iter().all(|k| !missed.contains(k)));
}

#[test]
fn cosines_are_projected_as_by_transforms_on_every_side() {
    for n in [2, 4, 8, 16, 32, 64] {
        let side = side(n);
        let rows = Order::Random(2).rows(side).unwrap().first(side.area() / 2);
        let transform = Transform::new(Basis::Dct, side);
        let prior = Prior::none(side.area());
        let dictionary = SampledHadamard::new(&transform, &rows, &prior);
        let y: Vec<f32> = (0..rows.len()).map(|m| (1.0 + m as f32).sin()).collect();
        let mut found = vec![9.0; padded(side.area())];
        dictionary.project(&y, &mut found);
        let mut grid = vec![0.0; side.area()];
        rows.iter().zip(&y).for_each(|(&row, &y)| grid[row as usize] = y / n as f32);
        fwht::transform(&mut grid);
        transform.analyse(&mut grid);
        for (atom, (a, b)) in found.iter().zip(&grid).enumerate() {
            assert!((a - b).abs() < 1e-5, "atom {atom} of {n} x {n}: {a} and {b}");
        }
        assert!(found[side.area()..].iter().all(|&p| p == 0.0), "{n} x {n}");
    }
}

#[test]
fn a_batch_over_fast_transforms_is_a_loop() {
    let side = side(16);
    let rows = Order::Random(1).rows(side).unwrap().first(100);
    let transform = Transform::new(Basis::Dct, side);
    let prior = Prior::none(256);
    let dictionary = SampledHadamard::new(&transform, &rows, &prior);
    let limits = Limits::atoms(5);
    let y: Vec<f32> = (0..100 * 7).map(|m| (m as f32).sin()).collect();
    let batch = crate::Problem { dictionary: &dictionary, limits };
    let together = crate::solve_batch(&batch, &y, Backend::Cpu).unwrap();
    let mut solver = Solver::new(&dictionary, &limits).unwrap();
    for (y, found) in y.chunks_exact(100).zip(&together) {
        assert_eq!(&solver.solve(y).unwrap().solution(), found);
    }
}
