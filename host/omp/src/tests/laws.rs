//! Property tests of orthogonal matching pursuit, for every implementation.

use super::*;

/// Solutions of reference, `f32` and `f64`, each with the tolerance for its rounding.
fn all_paths(problem: &Problem, limits: &Limits) -> [(Solution, f64); 3] {
    [
        (solve_exactly(problem, limits), 1e-8),
        (solve::<f32>(problem, limits), 1e-4),
        (solve::<f64>(problem, limits), 1e-8),
    ]
}

proptest! {
    #[test]
    fn what_remains_is_orthogonal_to_the_support_and_never_grows(problem in problems()) {
        let length = DVector::from_column_slice(&problem.y).norm();
        for (solution, tolerance) in all_paths(&problem, &Limits::atoms(10)) {
            // The reference's energies are differences of numbers near 1, so their roots are right
            // to 1e-7.
            prop_assert!(solution.residual_norms.is_sorted_by(|a, b| a + 1e-7 >= *b));
            let left = residual(&problem, &solution.support, &solution.coefficients);
            for &k in &solution.support {
                let atom = problem.dictionary.column(k);
                prop_assert!(atom.dot(&left).abs() <= tolerance * atom.norm() * length);
            }
            let stated = *solution.residual_norms.last().unwrap() * length;
            prop_assert!((left.norm() - stated).abs() <= 1e-3 * length, "{} stated {}", left.norm(), stated);
            prop_assert!(solution.coefficients.iter().all(|c| c.is_finite()));
        }
    }

    /// J. Tropp, *Greed is good* (2004), Theorem B: fewer than (1 + 1 / coherence) / 2 atoms are
    /// found exactly.
    #[test]
    fn under_the_coherence_bound_recovery_is_exact(seed: u64, count in 1_usize..8) {
        // Spikes and Walsh functions: coherence 1 / sqrt(256), so up to 8 atoms of the 512.
        let mut random = Pcg64::seed_from_u64(seed);
        let sign = |i: usize, j: usize| if (i & j).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
        let dictionary = DMatrix::from_fn(256, 512, |m, k| match k.checked_sub(256) {
            None => f64::from(u8::from(m == k)),
            Some(k) => sign(m, k) / 16.0,
        });
        let mut sparse: Vec<(usize, f64)> = Vec::new();
        while sparse.len() < count {
            let (atom, size) = (random.random_range(0..512), random.random_range(0.5..2.0_f32));
            if sparse.iter().all(|(a, _)| *a != atom) {
                sparse.push((atom, if random.random() { size.into() } else { -f64::from(size) }));
            }
        }
        sparse.sort_unstable_by_key(|(atom, _)| *atom);
        let mut y = DVector::zeros(256);
        sparse.iter().for_each(|(atom, value)| y += dictionary.column(*atom) * *value);
        let y = y.iter().copied().collect();
        let problem = Problem { recipe: String::new(), dictionary, y, sparse };
        for (solution, tolerance) in all_paths(&problem, &Limits { residual: 1e-3, ..Limits::atoms(20) }) {
            let mut found: Vec<(usize, f64)> =
                solution.support.iter().copied().zip(solution.coefficients).collect();
            found.sort_unstable_by_key(|(atom, _)| *atom);
            prop_assert_eq!(found.len(), count);
            for ((a, x), (b, truth)) in found.iter().zip(&problem.sparse) {
                prop_assert_eq!(a, b);
                prop_assert!((x - truth).abs() <= tolerance);
            }
        }
    }

    #[test]
    fn a_start_from_the_same_atoms_ends_with_the_same_coefficients(problem in problems()) {
        let limits = Limits { residual: 2e-3, ..Limits::atoms(10) };
        let (dictionary, y) = dense::<f64>(&problem);
        let mut solver = Solver::new(&dictionary, &limits).unwrap();
        let cold = solver.solve(&y).unwrap().solution();
        let warm = solver.solve_from(&y, &cold.support).unwrap().solution();
        prop_assert_eq!(&warm.support, &cold.support);
        prop_assert_eq!(&warm.coefficients, &cold.coefficients);
        // The same atoms in another order have the same least-squares solution.
        let backwards: Vec<usize> = cold.support.iter().rev().copied().collect();
        let warm = solver.solve_from(&y, &backwards).unwrap().solution();
        let left = |s: &Solution| residual(&problem, &s.support, &s.coefficients).norm();
        let length = DVector::from_column_slice(&problem.y).norm();
        prop_assert!(left(&warm) <= left(&cold) + 1e-6 * length);
    }
}

#[test]
fn a_start_spares_choices_in_a_video_and_keeps_to_the_laws() {
    let before = problem(Kind::Sparse, 128, 256, 12, 3);
    let (dictionary, y) = dense::<f32>(&before);
    let limits = Limits { residual: 1e-3, ..Limits::atoms(40) };
    let mut solver = Solver::new(&dictionary, &limits).unwrap();
    let first = solver.solve(&y).unwrap().solution();
    // The next frame: every coefficient changes a little, and one atom is added.
    let next: Vec<f32> = y
        .iter()
        .zip(before.dictionary.column(200).iter())
        .map(|(y, a)| 1.1 * y + 0.2 * *a as f32)
        .collect();
    let warm = solver.solve_from(&next, &first.support).unwrap().solution();
    assert_eq!(warm.stop, Stop::Residual);
    assert_eq!(warm.support[..first.support.len()], first.support);
    assert_eq!(warm.support.len(), first.support.len() + 1);
    assert!(warm.residual_norms.is_sorted_by(|a, b| a >= b));
    // An unseen or repeated atom of the start is skipped.
    let blind = problem(Kind::Blind, 32, 64, 3, 1);
    let (dictionary, y) = dense::<f32>(&blind);
    let mut solver = Solver::new(&dictionary, &Limits::atoms(3)).unwrap();
    let found = solver.solve_from(&y, &[0, 7, 9, 9]).unwrap();
    assert_eq!((found.support[0], found.support.len()), (9, 3));
}

#[test]
fn a_power_of_two_in_the_measurement_is_one_in_the_coefficients_and_changes_nothing_else() {
    fn scaled<T: Scalar>(gain: f64) {
        let problem = problem(Kind::Noisy, 48, 150, 6, 2);
        let (dictionary, y) = dense::<T>(&problem);
        let other: Vec<T> = y.iter().map(|&y| T::from_f64(y.into() * gain)).collect();
        let mut solver = Solver::new(&dictionary, &Limits::atoms(20)).unwrap();
        let (one, two) = (solver.solve(&y).unwrap(), solver.solve(&other).unwrap());
        assert_eq!(one.support, two.support);
        assert_eq!(one.residual_norms, two.residual_norms);
        assert_eq!(one.least_lead, two.least_lead);
        let coefficients: Vec<f64> = one.coefficients(20).iter().map(|c| c * gain).collect();
        assert_eq!(coefficients, two.coefficients(20));
        // The same in the atoms, and in the reference.
        let small = 2_f64.powi(if gain < 1.0 { -20 } else { 20 });
        let atoms = Problem { dictionary: &problem.dictionary * small, ..problem };
        let (dictionary, y) = dense::<T>(&atoms);
        let three = Solver::new(&dictionary, &Limits::atoms(20)).unwrap().solve(&y).unwrap();
        let coefficients: Vec<f64> = one.coefficients(20).iter().map(|c| c / small).collect();
        assert_eq!(coefficients, three.coefficients(20));
        assert_eq!((three.support, three.residual_norms), (one.support, one.residual_norms));
        let exact = solve_exactly(&atoms, &Limits::atoms(20));
        let light = Problem { y: atoms.y.iter().map(|y| y * gain).collect(), ..atoms };
        let scaled: Vec<f64> = exact.coefficients.iter().map(|c| c * gain).collect();
        let other = solve_exactly(&light, &Limits::atoms(20));
        assert_eq!((other.support, other.coefficients), (exact.support, scaled));
        assert_eq!((exact.unseen, exact.stop), (vec![], Stop::Sparsity));
    }
    for power in [-40, 40] {
        scaled::<f32>(2_f64.powi(power));
        scaled::<f64>(2_f64.powi(power));
    }
}

#[test]
fn the_least_lead_is_that_of_the_closest_choice_and_relative_to_the_measurement() {
    let dictionary = DenseDictionary::new(&DMatrix::<f64>::identity(4, 4));
    let mut solver = Solver::new(&dictionary, &Limits::atoms(2)).unwrap();
    let found = solver.solve(&[8.0, 3.0, 2.0, 2.0]).unwrap();
    assert_eq!(found.support, [0, 1]);
    assert!((found.least_lead - 1.0 / 9.0).abs() < 1e-12, "{}", found.least_lead);
}

#[test]
fn the_bound_of_the_error_is_the_stated_one() {
    let bound = error_bound::<f64>(10, 3.0) / f64::EPSILON;
    assert_eq!((bound, error_bound::<f32>(1, 2.0)), (120.0, 32.0 * f64::from(f32::EPSILON)));
}
