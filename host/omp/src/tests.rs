//! Tests of every implementation against the reference, on several kinds of problems.

mod batch;
#[cfg(feature = "gpu")]
mod gpu;
mod laws;
mod mixed;
mod nonnegative;
mod sampled;
mod warm;

use super::*;
use crate::testing::normal;
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Sparse,
    Compressible,
    Noisy,
    /// With columns of zeros.
    Blind,
    /// With each column twice.
    Doubled,
    /// With a rank far below the number of measurements and atoms.
    Deficient,
    /// With a measurement of zeros.
    Dark,
}

const KINDS: [Kind; 7] = [
    Kind::Sparse,
    Kind::Compressible,
    Kind::Noisy,
    Kind::Blind,
    Kind::Doubled,
    Kind::Deficient,
    Kind::Dark,
];

struct Problem {
    recipe: String,
    dictionary: DMatrix<f64>,
    y: Vec<f64>,
    sparse: Vec<(usize, f64)>,
}

impl std::fmt::Debug for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.recipe)
    }
}

/// A problem whose numbers are exact in `f32`.
fn problem(kind: Kind, rows: usize, atoms: usize, sparsity: usize, seed: u64) -> Problem {
    let mut random = Pcg64::seed_from_u64(seed);
    let single = |v: f64| f64::from(v as f32);
    let mut dictionary = DMatrix::from_fn(rows, atoms, |_, _| single(normal(&mut random)));
    if kind == Kind::Deficient {
        let mut factor = |m, n| DMatrix::from_fn(m, n, |_, _| normal(&mut random));
        dictionary = (factor(rows, rows / 3) * factor(rows / 3, atoms)).map(single);
    }
    for k in 0..atoms {
        let gain = f64::from(random.random_range(0.25..4.0_f32));
        dictionary.column_mut(k).apply(|v| *v = single(*v * gain));
    }
    match kind {
        Kind::Blind => (0..atoms).step_by(7).for_each(|k| dictionary.column_mut(k).fill(0.0)),
        Kind::Doubled => {
            for k in (0..atoms - 5).step_by(6) {
                let copy = dictionary.column(k).into_owned();
                dictionary.set_column(k + 5, &copy);
            }
        }
        _ => {}
    }
    let decay = if kind == Kind::Compressible { 0.7_f64 } else { 0.95 };
    let mut sparse: Vec<(usize, f64)> = Vec::new();
    while sparse.len() < sparsity && kind != Kind::Dark {
        let atom = random.random_range(0..atoms);
        let sign = if random.random() { 1.0 } else { -1.0 };
        if dictionary.column(atom).norm() > 0.0 && sparse.iter().all(|(a, _)| *a != atom) {
            let size = decay.powi(sparse.len() as i32) / dictionary.column(atom).norm();
            sparse.push((atom, sign * size));
        }
    }
    let mut y = DVector::zeros(rows);
    for (atom, value) in &sparse {
        y += dictionary.column(*atom) * *value;
    }
    if matches!(kind, Kind::Noisy | Kind::Deficient) {
        let sigma = 0.05 * y.norm() / (rows as f64).sqrt();
        y.iter_mut().for_each(|y| *y += sigma * normal(&mut random));
    }
    let y = y.iter().map(|&y| single(y)).collect();
    let recipe = format!("problem({kind:?}, {rows}, {atoms}, {sparsity}, {seed})");
    Problem { recipe, dictionary, y, sparse }
}

fn residual(problem: &Problem, support: &[usize], coefficients: &[f64]) -> DVector<f64> {
    let mut residual = DVector::from_column_slice(&problem.y);
    for (&atom, value) in support.iter().zip(coefficients) {
        residual -= problem.dictionary.column(atom) * *value;
    }
    residual
}

fn solve_exactly(problem: &Problem, limits: &Limits) -> Solution {
    reference::solve(&problem.dictionary, &problem.y, limits).unwrap()
}

fn dense<T: Scalar>(problem: &Problem) -> (DenseDictionary<T>, Vec<T>) {
    let dictionary = DenseDictionary::new(&problem.dictionary.map(T::from_f64));
    (dictionary, problem.y.iter().map(|&y| T::from_f64(y)).collect())
}

fn solve<T: Scalar>(problem: &Problem, limits: &Limits) -> Solution {
    let (dictionary, y) = dense::<T>(problem);
    Solver::new(&dictionary, limits).unwrap().solve(&y).unwrap().solution()
}

/// Number of first choices that two solutions share. Where they differ, the two choices must have
/// been equally good to within rounding.
fn agreeing(problem: &Problem, exact: &Solution, fast: &Solution, rounding: f64) -> usize {
    let same = exact.support.iter().zip(&fast.support).take_while(|(a, b)| a == b).count();
    if let (Some(&a), Some(&b)) = (exact.support.get(same), fast.support.get(same)) {
        let before = solve_exactly(problem, &Limits::atoms(same));
        let residual = residual(problem, &before.support, &before.coefficients);
        let score = |k: usize| {
            let atom = problem.dictionary.column(k);
            (atom.dot(&residual) / atom.norm()).abs()
        };
        let tie = (score(a) - score(b)).abs() / DVector::from_column_slice(&problem.y).norm();
        assert!(tie < rounding, "atom {a} or {b} after {same}: {tie}");
    }
    same
}

/// Condition number of the support's Gram matrix, with atoms of unit norm.
fn condition(problem: &Problem, support: &[usize]) -> f64 {
    let mut atoms = problem.dictionary.select_columns(support);
    atoms.column_iter_mut().for_each(|mut atom| {
        atom.normalize_mut();
    });
    let values = atoms.singular_values();
    (values.max() / values.min()).powi(2)
}

/// Checks for the same support in the same order, and coefficients within the stated bound.
fn is_the_reference<T: Scalar>(problem: &Problem, limits: &Limits) -> Result<(), TestCaseError> {
    agrees::<T>(problem, limits, &solve::<T>(problem, limits))
}

/// [`is_the_reference`] for a solution in numbers of type `T`.
fn agrees<T: Scalar>(
    problem: &Problem,
    limits: &Limits,
    fast: &Solution,
) -> Result<(), TestCaseError> {
    let exact = solve_exactly(problem, limits);
    let same = agreeing(problem, &exact, fast, 1e2 * T::EPSILON);
    prop_assert_eq!(&exact.unseen, &fast.unseen);
    // Single precision reaches the limit of its rounding sooner.
    let sooner = matches!(fast.stop, Stop::Dependent | Stop::NoAtomLeft) && T::EPSILON > 1e-10;
    let (length, fast_length) = (exact.support.len(), fast.support.len());
    if same == 0 && length == 0 {
        prop_assert_eq!(fast.support.len(), 0);
        return Ok(());
    }
    if same < length || same < fast_length {
        prop_assert!(sooner || same < length.min(fast_length));
        return Ok(());
    }
    prop_assert!(exact.stop == fast.stop || sooner);
    let norm = |k: usize| problem.dictionary.column(k).norm();
    let scaled = |(k, c): (&usize, &f64)| c * norm(*k);
    let exactly: Vec<f64> = exact.support.iter().zip(&exact.coefficients).map(scaled).collect();
    let found: Vec<f64> = fast.support.iter().zip(&fast.coefficients).map(scaled).collect();
    let size = DVector::from_column_slice(&exactly).norm();
    let condition = condition(problem, &exact.support);
    // The bound is relative to the coefficients; an ill-conditioned support has the bound of the
    // module's documentation.
    let promised = if T::EPSILON > 1e-10 { 1e-4 } else { 1e-10 };
    let bound = error_bound::<T>(same, condition);
    for (a, b) in exactly.iter().zip(&found) {
        let error = (a - b).abs() / size;
        prop_assert!(error <= bound, "{} and {}, condition {}", a, b, condition);
        prop_assert!(error <= promised || condition > 100.0, "{} and {}: {}", a, b, condition);
    }
    for (a, b) in exact.residual_norms.iter().zip(&fast.residual_norms) {
        prop_assert!((a - b).abs() < 4.0 * (T::EPSILON * same as f64).sqrt());
    }
    Ok(())
}

fn problems() -> impl Strategy<Value = Problem> {
    (prop::sample::select(KINDS.to_vec()), 16_usize..64, 1_usize..4, 1_usize..8, any::<u64>())
        .prop_map(|(kind, rows, ratio, sparsity, seed)| {
            problem(kind, rows, rows * ratio, sparsity, seed)
        })
}

proptest! {
    #[test]
    fn both_number_types_find_what_the_reference_finds(
        problem in problems(), sparsity in 1_usize..12, residual in 0.0..0.3
    ) {
        let limits = Limits { residual: f64::max(residual, 2e-3), ..Limits::atoms(sparsity) };
        is_the_reference::<f32>(&problem, &limits)?;
        is_the_reference::<f64>(&problem, &limits)?;
    }
}

#[test]
fn a_large_random_problem_has_the_references_support_in_order() {
    let problem = problem(Kind::Noisy, 512, 1000, 40, 5);
    let limits = Limits::atoms(64);
    let exact = solve_exactly(&problem, &limits);
    assert_eq!(exact.support.len(), 64);
    for found in [solve::<f32>(&problem, &limits), solve::<f64>(&problem, &limits)] {
        assert_eq!(found.support, exact.support);
    }
    is_the_reference::<f32>(&problem, &limits).unwrap();
    is_the_reference::<f64>(&problem, &limits).unwrap();
}

#[test]
fn each_reason_to_stop_is_stated() {
    let identity = DMatrix::<f64>::identity(4, 4);
    let both = |dictionary: &DMatrix<f64>, y: &[f64], limits| {
        let problem = Problem {
            recipe: String::new(),
            dictionary: dictionary.clone(),
            y: y.to_vec(),
            sparse: vec![],
        };
        let exact = solve_exactly(&problem, &limits);
        for fast in [solve::<f32>(&problem, &limits), solve::<f64>(&problem, &limits)] {
            assert_eq!((exact.stop, &exact.support), (fast.stop, &fast.support));
        }
        (exact.stop, exact.support)
    };
    let to_residual = |residual| Limits { residual, ..Limits::atoms(4) };
    let to_noise = |noise| Limits { noise, ..Limits::atoms(4) };
    let some = [1.0, 3.0, 0.0, 2.0];
    assert_eq!(both(&identity, &some, Limits::atoms(2)), (Stop::Sparsity, vec![1, 3]));
    assert_eq!(
        both(&identity, &[1.0, 30.0, 0.0, 2.0], to_residual(0.1)),
        (Stop::Residual, vec![1])
    );
    // Four measurements with a noise of 0.6 have a residual of 1.2: the coefficients 3 and 2 are
    // larger, 1 is not.
    assert_eq!(both(&identity, &some, to_noise(0.6)), (Stop::Residual, vec![1, 3]));
    assert_eq!(both(&identity, &some, to_noise(0.4)), (Stop::Residual, vec![1, 3, 0]));
    assert_eq!(both(&identity, &[0.0; 4], Limits::atoms(4)), (Stop::Residual, vec![]));
    // Of equal atoms the lowest is chosen.
    let equal = [0.0, 2.0, 0.0, 2.0];
    assert_eq!(both(&identity, &equal, Limits::atoms(1)), (Stop::Sparsity, vec![1]));
    let blind = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 1.0, 0.0, 0.0]));
    let seen = both(&blind, &[2.0, 1.0, 1.0, 0.0], Limits::atoms(4));
    assert_eq!(seen, (Stop::NoAtomLeft, vec![0, 1]));
    let nothing = both(&DMatrix::zeros(4, 3), &[1.0; 4], Limits::atoms(4));
    assert_eq!(nothing, (Stop::NoAtomLeft, vec![]));
    // The second atom is so close to the plane of the others that it adds less than rounding.
    let plane = |height| Problem {
        recipe: String::new(),
        dictionary: DMatrix::from_row_slice(
            3,
            3,
            &[1.0, 0.0, 1.0, 0.0, 1.0, 2.0, 0.0, 0.0, height],
        ),
        y: vec![1.0; 3],
        sparse: vec![],
    };
    let end = |found: Solution| (found.stop, found.support);
    let dependent = (Stop::Dependent, vec![2, 0]);
    let three = Limits::atoms(3);
    assert_eq!(end(solve::<f32>(&plane(1e-3), &three)), dependent);
    assert_eq!(end(solve::<f64>(&plane(1e-6), &three)), dependent);
    assert_eq!(end(solve_exactly(&plane(1e-6), &three)), dependent);
}

#[test]
fn problems_without_a_meaning_are_refused() {
    let identity = DMatrix::<f64>::identity(2, 2);
    let one = Limits::atoms(1);
    let dictionary = DenseDictionary::new(&identity);
    let refuse = |y: &[f64], limits: Limits| {
        let exact = reference::solve(&identity, y, &limits).unwrap_err();
        let fast = Solver::new(&dictionary, &limits).and_then(|mut solver| solver.solve(y));
        assert_eq!(fast.unwrap_err(), exact);
        exact
    };
    assert_eq!(refuse(&[1.0], one), OmpError::Length { found: 1, expected: 2 });
    let infinite = OmpError::NotFinite { field: "measurement", index: 1, found: f64::INFINITY };
    assert_eq!(refuse(&[1.0, f64::INFINITY], one), infinite);
    for (limits, limit) in
        [(Limits { residual: -0.1, ..one }, "residual"), (Limits { noise: -0.1, ..one }, "noise")]
    {
        assert_eq!(refuse(&[1.0, 1.0], limits), OmpError::Limit { limit, found: -0.1 });
    }
    let broken = DMatrix::from_element(2, 2, f64::NAN);
    let exact = reference::solve(&broken, &[1.0, 1.0], &one).unwrap_err();
    assert!(matches!(exact, OmpError::NotFinite { field: "dictionary", index: 0, .. }));
    let fast = Solver::new(&DenseDictionary::new(&broken), &one).unwrap().solve(&[1.0, 1.0]);
    assert!(matches!(fast.unwrap_err(), OmpError::NotFinite { field: "projection", .. }));
    let start = Solver::new(&dictionary, &one).unwrap().solve_from(&[1.0, 1.0], &[2]);
    assert_eq!(start.unwrap_err(), OmpError::Start { found: 2, atoms: 2 });
}
