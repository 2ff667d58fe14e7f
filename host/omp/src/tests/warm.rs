//! Tests of pursuits that start from the support of the frame before.

use super::*;

fn frames(count: usize) -> (DenseDictionary<f32>, Vec<Vec<f32>>) {
    let problem = problem(Kind::Noisy, 64, 192, 12, 9);
    let mut random = Pcg64::seed_from_u64(2);
    let (dictionary, y) = dense::<f32>(&problem);
    let noisy = |_| y.iter().map(|y| y + 0.02 * normal(&mut random) as f32).collect();
    (dictionary, (0..count).map(noisy).collect())
}

#[test]
fn atoms_taken_over_with_their_columns_are_those_taken_over_without_to_the_bit() {
    let (dictionary, frames) = frames(7);
    let limits = Limits::atoms(16);
    let mut keeping = Solver::new(&dictionary, &limits).unwrap();
    let mut start = Vec::new();
    // More atoms, fewer, none, in another order, and others than those whose columns the solver
    // has.
    for (y, kept) in frames.iter().zip([12, 16, 5, 7, 0, 12, 16]) {
        let mut forgetful = Solver::new(&dictionary, &limits).unwrap();
        let found = keeping.solve_from(y, &start).unwrap();
        let fresh = forgetful.solve_from(y, &start).unwrap();
        assert!(found.support.starts_with(&start));
        assert_eq!(found.support, fresh.support);
        assert_eq!(found.coefficients(16), fresh.coefficients(16));
        assert_eq!(found.residual_norms, fresh.residual_norms);
        start = found.support;
        start.truncate(kept);
        if kept == 5 {
            start.swap(1, 3);
        }
        if kept == 7 {
            start.reverse();
        }
    }
}

#[test]
fn a_start_ends_where_enough_is_explained() {
    let (dictionary, frames) = frames(2);
    let mut solver = Solver::new(&dictionary, &Limits::atoms(16)).unwrap();
    let start = solver.solve(&frames[0]).unwrap();
    let mut solver =
        Solver::new(&dictionary, &Limits { residual: 0.5, ..Limits::atoms(16) }).unwrap();
    for _ in 0..2 {
        let found = solver.solve_from(&frames[1], &start.support).unwrap();
        assert_eq!(found.stop, Stop::Residual);
        assert!(found.support.len() < 16 && start.support.starts_with(&found.support));
    }
}
