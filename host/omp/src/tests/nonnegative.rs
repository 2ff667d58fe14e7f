//! Tests of non-negative coefficients.

use super::*;
use crate::nonnegative;

proptest! {
    #[test]
    fn the_solution_is_the_best_of_those_that_are_nowhere_negative(problem in problems()) {
        // The Karush-Kuhn-Tucker conditions: the gradient is 0 at atoms of the support, and no atom
        // outside would reduce the residual with a positive coefficient.
        let (dictionary, y) = dense::<f64>(&problem);
        let atoms = problem.dictionary.ncols();
        let found = nonnegative::solve(&dictionary, &y, &Limits::atoms(atoms)).unwrap();
        prop_assert!(found.coefficients.iter().all(|&c| c > 0.0));
        let left = residual(&problem, &found.support, &found.coefficients);
        let length = DVector::from_column_slice(&problem.y).norm();
        for k in 0..atoms {
            let atom = problem.dictionary.column(k);
            let pull = atom.dot(&left);
            let rounding = 1e-6 * atom.norm() * length;
            if found.support.contains(&k) {
                prop_assert!(pull.abs() <= rounding, "{} pulls {}", k, pull);
            } else if found.stop == Stop::NoAtomLeft {
                prop_assert!(pull <= rounding, "{} would help: {}", k, pull);
            }
        }
        let stated = found.residual_norms.last().unwrap() * length;
        prop_assert!((left.norm() - stated).abs() <= 1e-3 * length);
    }

    #[test]
    fn where_nothing_negative_is_wanted_it_is_the_reference(seed: u64, count in 1_usize..6) {
        let mut random = Pcg64::seed_from_u64(seed);
        let dictionary = DMatrix::from_fn(60, 60, |m, k| if m == k { 1.0 } else { 0.0 });
        let mut y = vec![0.0; 60];
        for _ in 0..count {
            y[random.random_range(0..60_usize)] = f64::from(random.random_range(1.0..2.0_f32));
        }
        let problem = Problem { recipe: String::new(), dictionary, y, sparse: vec![] };
        let (dictionary, y) = dense::<f32>(&problem);
        let limits = Limits::atoms(count);
        let found = nonnegative::solve(&dictionary, &y, &limits).unwrap();
        let exact = solve_exactly(&problem, &limits);
        prop_assert_eq!(found.support, exact.support);
    }
}

proptest! {
    #[test]
    fn with_every_step_less_is_left(seed: u64) {
        // Atoms with similar directions push each other below 0 again and again.
        let mut random = Pcg64::seed_from_u64(seed);
        let dictionary = DMatrix::from_fn(24, 40, |_, _| normal(&mut random) + 0.8);
        let y = (0..24).map(|_| normal(&mut random) + 0.3).collect();
        let problem = Problem { recipe: String::new(), dictionary, y, sparse: vec![] };
        let (dictionary, y) = dense::<f64>(&problem);
        let left: Vec<f64> = (1..24)
            .map(|count| {
                let found = nonnegative::solve(&dictionary, &y, &Limits::atoms(count)).unwrap();
                assert!(found.support.len() <= count);
                // However many atoms were given back, the search went on.
                assert_eq!(found.stop == Stop::Sparsity, found.support.len() == count);
                *found.residual_norms.last().unwrap()
            })
            .collect();
        prop_assert!(left.is_sorted_by(|a, b| a + 1e-9 >= *b), "{:?}", left);
    }
}

#[test]
fn units_do_not_matter_and_of_equal_atoms_the_lowest_is_taken() {
    let matrix = DMatrix::from_row_slice(3, 3, &[1.0, 0.2, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    let y = [1.0, 2.0, 2.0];
    let solve = |gain: f64, light: f64, atoms| {
        let y = y.map(|y| y * light);
        let dictionary = DenseDictionary::new(&(&matrix * gain));
        nonnegative::solve(&dictionary, &y, &Limits::atoms(atoms)).unwrap()
    };
    let found = solve(1.0, 1.0, 3);
    assert_eq!(found.support, [1, 2, 0]);
    for (gain, light) in [(1e-7, 1.0), (1e7, 1.0), (1.0, 1e-15), (1.0, 1e15)] {
        let other = solve(gain, light, 3);
        assert_eq!(other.support, found.support, "patterns {gain}, light {light}");
        for (a, b) in found.coefficients.iter().zip(&other.coefficients) {
            assert!((b * gain / light - a).abs() < 1e-9, "patterns {gain}, light {light}: {b}");
        }
    }
    let equal = nonnegative::solve(
        &DenseDictionary::new(&DMatrix::<f64>::identity(3, 3)),
        &[1.0, 2.0, 2.0],
        &Limits::atoms(1),
    );
    assert_eq!(equal.unwrap().support, [1]);
    let none = solve(1.0, 1.0, 0);
    assert_eq!((none.stop, none.support.len()), (Stop::Sparsity, 0));
}

#[test]
fn an_atom_that_would_be_negative_is_not_taken() {
    let matrix = DMatrix::<f64>::identity(4, 4);
    let found = nonnegative::solve(
        &DenseDictionary::new(&matrix),
        &[1.0, -5.0, 2.0, 0.0],
        &Limits::atoms(4),
    )
    .unwrap();
    assert_eq!((found.support, found.coefficients), (vec![2, 0], vec![2.0, 1.0]));
    assert_eq!(found.stop, Stop::NoAtomLeft);
}

#[test]
fn an_atom_that_stays_above_nothing_on_the_way_is_not_given_back() {
    // When the last atom comes, two coefficients fall towards 0. Only the first to reach 0 is
    // removed; the other, atom 0, is positive in the end. A step to the second one's zero would
    // remove both.
    let matrix = DMatrix::from_row_slice(
        4,
        4,
        &[0.0, 0.0, 5.0, 3.0, 0.0, 4.0, 3.0, 1.0, 3.0, 4.0, 2.0, 0.0, 3.0, -1.0, 4.0, 4.0_f64],
    );
    let y = [1.0, 4.0, 2.0, 5.0];
    let found = nonnegative::solve(&DenseDictionary::new(&matrix), &y, &Limits::atoms(4)).unwrap();
    assert_eq!(found.support, [0, 1, 3]);
}

#[test]
fn atoms_that_are_one_too_many_together_are_told_though_each_pivot_is_large() {
    // Five nearly dependent atoms, and a sixth that is a combination of the five to within the
    // rounding of its numbers: coefficients of a hundred thousand would cancel each other.
    let problem = problem(Kind::Deficient, 16, 16, 4, 11_072_703_967_221_519_038);
    let (dictionary, y) = dense::<f64>(&problem);
    let found = nonnegative::solve(&dictionary, &y, &Limits::atoms(16)).unwrap();
    assert_eq!((found.stop, found.support.len()), (Stop::Dependent, 5));
    let length = DVector::from_column_slice(&problem.y).norm();
    let left = residual(&problem, &found.support, &found.coefficients).norm() / length;
    assert!(
        (left - found.residual_norms.last().unwrap()).abs() <= 1e-6,
        "{left} is left: {found:?}"
    );
}
