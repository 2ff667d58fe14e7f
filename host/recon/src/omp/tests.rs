use super::*;
use crate::basis::{Basis, Transform};
use crate::omp::fast::{Gram, pursue};
use crate::omp::sampled::{Prior, SampledHadamard};
use crate::testing::{normal, side};
use crate::{Order, fwht};
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

#[derive(Debug, Clone, Copy)]
enum Kind {
    Sparse,
    Compressible,
    Noisy,
    /// With columns of zeros.
    Blind,
    /// With columns twice.
    Doubled,
}

const KINDS: [Kind; 5] =
    [Kind::Sparse, Kind::Compressible, Kind::Noisy, Kind::Blind, Kind::Doubled];

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
    let mut dictionary =
        DMatrix::from_fn(rows, atoms, |_, _| f64::from(normal(&mut random) as f32));
    for k in 0..atoms {
        let gain = f64::from(random.random_range(0.25..4.0_f32));
        dictionary.column_mut(k).apply(|v| *v = f64::from((*v * gain) as f32));
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
    let decay = if matches!(kind, Kind::Compressible) { 0.7_f64 } else { 0.95 };
    let mut sparse: Vec<(usize, f64)> = Vec::new();
    while sparse.len() < sparsity {
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
    if matches!(kind, Kind::Noisy) {
        let sigma = 0.05 * y.norm() / (rows as f64).sqrt();
        y.iter_mut().for_each(|y| *y += sigma * normal(&mut random));
    }
    let y = y.iter().map(|&y| f64::from(y as f32)).collect();
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

fn fast_solve(problem: &Problem, limits: &Limits) -> Solution {
    let y: Vec<f32> = problem.y.iter().map(|&y| y as f32).collect();
    fast::solve(&problem.dictionary.map(|v| v as f32), &y, limits).unwrap()
}

/// How many first choices of the two agree; where they part, they must have been equally good to rounding.
fn agreeing(problem: &Problem, exact: &Solution, fast: &Solution) -> usize {
    let same = exact.support.iter().zip(&fast.support).take_while(|(a, b)| a == b).count();
    if let (Some(&a), Some(&b)) = (exact.support.get(same), fast.support.get(same)) {
        let limits = Limits { sparsity: same, residual: 0.0 };
        let before = reference::solve(&problem.dictionary, &problem.y, &limits).unwrap();
        let residual = residual(problem, &before.support, &before.coefficients);
        let score = |k: usize| {
            let atom = problem.dictionary.column(k);
            (atom.dot(&residual) / atom.norm()).abs()
        };
        let tie = (score(a) - score(b)).abs() / DVector::from_column_slice(&problem.y).norm();
        assert!(tie < 1e-5, "atom {a} or {b} after {same}: {tie}");
    }
    same
}

fn problems() -> impl Strategy<Value = Problem> {
    (prop::sample::select(KINDS.to_vec()), 16_usize..64, 1_usize..4, 1_usize..8, any::<u64>())
        .prop_map(|(kind, rows, ratio, sparsity, seed)| {
            problem(kind, rows, rows * ratio, sparsity, seed)
        })
}

proptest! {
    #[test]
    fn fast_is_the_reference(problem in problems(), sparsity in 1_usize..12, residual in 0.0..0.3) {
        let limits = Limits { sparsity, residual: f64::max(residual, 2e-3) };
        let exact = reference::solve(&problem.dictionary, &problem.y, &limits).unwrap();
        let fast = fast_solve(&problem, &limits);
        let same = agreeing(&problem, &exact, &fast);
        prop_assert_eq!(&exact.unseen, &fast.unseen);
        if same == exact.support.len() && same == fast.support.len() {
            prop_assert_eq!(exact.stop, fast.stop);
            let largest = exact.coefficients.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
            for (a, b) in exact.coefficients.iter().zip(&fast.coefficients) {
                prop_assert!((a - b).abs() <= 1e-4 * largest, "{} and {}", a, b);
            }
            for (a, b) in exact.residual_norms.iter().zip(&fast.residual_norms) {
                prop_assert!((a - b).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn what_remains_is_orthogonal_to_the_support_and_never_grows(problem in problems()) {
        let limits = Limits { sparsity: 10, residual: 0.0 };
        let energy = DVector::from_column_slice(&problem.y).norm();
        let exact = reference::solve(&problem.dictionary, &problem.y, &limits).unwrap();
        for (solution, tolerance) in [(exact, 1e-8), (fast_solve(&problem, &limits), 1e-4)] {
            prop_assert!(solution.residual_norms.is_sorted_by(|a, b| a >= b));
            let left = residual(&problem, &solution.support, &solution.coefficients);
            for &k in &solution.support {
                let atom = problem.dictionary.column(k);
                prop_assert!(atom.dot(&left).abs() <= tolerance * atom.norm() * energy);
            }
            let stated = *solution.residual_norms.last().unwrap();
            prop_assert!((left.norm() / energy - stated).abs() < 1e-3, "{} stated {}", left.norm() / energy, stated);
            prop_assert!(solution.coefficients.iter().all(|c| c.is_finite()));
        }
    }

    #[test]
    fn a_clearly_sparse_signal_is_recovered(seed: u64, sparsity in 1_usize..5) {
        let problem = problem(Kind::Sparse, 64, 96, sparsity, seed);
        let limits = Limits { sparsity: 2 * sparsity, residual: 2e-3 };
        let exact = reference::solve(&problem.dictionary, &problem.y, &limits).unwrap();
        let mut truth: Vec<usize> = problem.sparse.iter().map(|(a, _)| *a).collect();
        let mut found = exact.support.clone();
        truth.sort_unstable();
        found.sort_unstable();
        // A random dictionary may fool the first choice; then there are more atoms, and still all of these.
        prop_assert!(truth.iter().all(|a| found.contains(a)), "{:?} in {:?}", truth, found);
        for (atom, value) in &problem.sparse {
            let at = exact.support.iter().position(|a| a == atom).unwrap();
            prop_assert!((exact.coefficients[at] - value).abs() < 1e-3 * value.abs().max(0.1));
        }
    }
}

#[test]
fn each_reason_to_stop_is_stated() {
    let identity = DMatrix::<f64>::identity(4, 4);
    let solve = |dictionary: &DMatrix<f64>, y: &[f64], sparsity, residual| {
        let limits = Limits { sparsity, residual };
        let exact = reference::solve(dictionary, y, &limits).unwrap();
        let y: Vec<f32> = y.iter().map(|&y| y as f32).collect();
        let fast = fast::solve(&dictionary.map(|v| v as f32), &y, &limits).unwrap();
        assert_eq!((exact.stop, &exact.support), (fast.stop, &fast.support));
        (exact.stop, exact.support)
    };
    assert_eq!(solve(&identity, &[1.0, 3.0, 0.0, 2.0], 2, 0.0), (Stop::Sparsity, vec![1, 3]));
    assert_eq!(solve(&identity, &[1.0, 30.0, 0.0, 2.0], 4, 0.1), (Stop::Residual, vec![1]));
    assert_eq!(solve(&identity, &[0.0; 4], 4, 0.0), (Stop::Residual, vec![]));
    let blind = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 1.0, 0.0, 0.0]));
    assert_eq!(solve(&blind, &[2.0, 1.0, 1.0, 0.0], 4, 0.0), (Stop::NoAtomLeft, vec![0, 1]));
    assert_eq!(solve(&DMatrix::zeros(4, 3), &[1.0; 4], 4, 0.0), (Stop::NoAtomLeft, vec![]));
    // Two atoms 1e-3 apart in angle: the second adds less than rounding.
    let twins = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 0.0, 1e-3]);
    assert_eq!(solve(&twins, &[1.0, 1.0], 2, 0.0), (Stop::Dependent, vec![1]));
}

#[test]
fn problems_without_a_meaning_are_refused() {
    let identity = DMatrix::<f64>::identity(2, 2);
    let limits = Limits { sparsity: 1, residual: 0.0 };
    let refuse = |dictionary: &DMatrix<f64>, y: &[f64], limits| {
        reference::solve(dictionary, y, &limits).unwrap_err()
    };
    assert_eq!(refuse(&identity, &[1.0], limits), OmpError::Length { found: 1, expected: 2 });
    let infinite = OmpError::NotFinite { field: "measurement", index: 1, found: f64::INFINITY };
    assert_eq!(refuse(&identity, &[1.0, f64::INFINITY], limits), infinite);
    let broken = DMatrix::from_element(2, 2, f64::NAN);
    assert!(matches!(
        refuse(&broken, &[1.0, 1.0], limits),
        OmpError::NotFinite { field: "dictionary", index: 0, .. }
    ));
    let negative = Limits { residual: -0.1, ..limits };
    assert_eq!(refuse(&identity, &[1.0, 1.0], negative), OmpError::Residual { found: -0.1 });
}

/// The dictionary that [`SampledHadamard`] stands for, prior and all, written out in `f64`.
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
        basis in prop::sample::select(vec![Basis::Pixel, Basis::Dct, Basis::Haar]),
        random_rows: bool,
        with_prior: bool,
        share in 0.1..1.0,
        seed: u64,
    ) {
        let side = side(8);
        let order = if random_rows { Order::Random(seed) } else { Order::ZigZag };
        let mut rows = order.rows(side).unwrap();
        rows.truncate((share * 64.0) as usize);
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
        let mut column = vec![0.0; 64];
        for atom in 0..64 {
            gram.column(atom, &mut column);
            for (k, value) in column.iter().enumerate() {
                prop_assert!((f64::from(*value) - dense[(k, atom)]).abs() < 1e-5);
            }
            prop_assert!((f64::from(gram.diagonal()[atom]) - dense[(atom, atom)]).abs() < 1e-5);
        }

        let mut grid = vec![0.0_f32; 64];
        let mut y = vec![0.0; rows.len() + 64];
        for (m, &row) in rows.iter().enumerate() {
            grid[row as usize] = normal(&mut random) as f32;
            y[m] = f64::from(grid[row as usize]);
        }
        let energy = y.iter().map(|y| y * y).sum();
        let limits = Limits { sparsity: rows.len() / 4, residual: 0.05 };
        let path = pursue(&gram, &gram.project(grid), energy, &limits).unwrap().solution();
        let exact = reference::solve(&dictionary, &y, &limits).unwrap();
        prop_assert_eq!(&path.unseen, &exact.unseen);
        let problem = Problem { recipe: String::new(), dictionary, y, sparse: vec![] };
        let same = agreeing(&problem, &exact, &path);
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
    let mut rows = Order::Random(1).rows(side).unwrap();
    rows.truncate(512);
    let transform = Transform::new(Basis::Dct, side);
    let prior = Prior::none(1024);
    let gram = SampledHadamard::new(&transform, &rows, &prior);
    let mut grid = vec![0.0; 1024];
    rows.iter().enumerate().for_each(|(m, &row)| grid[row as usize] = (m as f32).sin());
    let energy = grid.iter().map(|&v| f64::from(v * v)).sum();
    let limits = Limits { sparsity: 500, residual: 1e-2 };
    let found = pursue(&gram, &gram.project(grid), energy, &limits).unwrap().solution();
    let missed: Vec<usize> = (0..1024).filter(|&k| gram.diagonal()[k] < 1e-9).collect();
    // Atoms of a few Walsh functions only; the mean is one of them.
    assert_eq!(missed, [0, 520, 528, 536]);
    assert_eq!(found.unseen, missed);
    assert!(found.coefficients.iter().all(|c| c.is_finite()));
    assert!(found.support.iter().all(|k| !missed.contains(k)));
}
