//! Sums over the eigenvalues of a symmetric matrix, of which only products with vectors are known.
//!
//! A few steps of Lanczos' method find what functions such as `v^T (K + l I)^-1 v` need of the eigenvalues of `K`, for every
//! `l` at once. Random signs for `v` give the trace of a function of `K`, and so its determinant (G. H. Golub and G. Meurant,
//! *Matrices, Moments and Quadrature*, 2010; stochastic Lanczos quadrature).

use nalgebra::{DMatrix, SymmetricEigen};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Steps of Lanczos' method: enough that both ends of the eigenvalues are found, where the noise and
/// the coarse rows of a scene are.
const STEPS: usize = 24;

/// Number of random vectors for the determinant.
const PROBES: usize = 2;

/// Seed of the random vectors. They change the result, so the seed never changes.
const SEED: u64 = 0x5eed;

/// Eigenvalues of a symmetric matrix that a vector contains, and the share of the vector's energy
/// in each.
#[derive(Debug, Clone, PartialEq)]
pub struct Quadrature {
    /// Squared norm of the vector.
    pub energy: f64,
    nodes: Vec<(f64, f64)>,
}

impl Quadrature {
    /// The mean of a function of the eigenvalues, weighted by the vector's energy in each.
    #[must_use]
    pub fn mean(&self, of: impl Fn(f64) -> f64) -> f64 {
        self.nodes.iter().map(|&(value, share)| share * of(value)).sum()
    }
}

/// Random signs for the determinant of a matrix of these rows, 0 for rows that are left out.
pub fn signs(mask: &[f32]) -> impl Iterator<Item = Vec<f32>> {
    let mut random = Pcg64::seed_from_u64(SEED);
    let mut sign = move |mask: &f32| if random.random::<bool>() { *mask } else { -mask };
    (0..PROBES).map(move |_| mask.iter().map(&mut sign).collect())
}

/// Lanczos' method from `start` with a symmetric matrix of this rank, by which `times` multiplies, each vector made orthogonal
/// to all before; `None` for zeros.
pub fn quadrature(
    start: Vec<f32>,
    rank: usize,
    times: impl Fn(&[f32]) -> Vec<f32>,
) -> Option<Quadrature> {
    let energy = dot(&start, &start);
    if energy <= 0.0 {
        return None;
    }
    let mut basis = vec![scaled(&start, 1.0 / energy.sqrt())];
    let (mut diagonal, mut beside) = (Vec::new(), Vec::new());
    while let Some(last) = basis.last() {
        let mut next = times(last);
        diagonal.push(dot(&next, last));
        if diagonal.len() == STEPS.min(rank) {
            break;
        }
        for before in &basis {
            let share = dot(&next, before) as f32;
            next.iter_mut().zip(before).for_each(|(v, b)| *v -= share * b);
        }
        let norm = dot(&next, &next).sqrt();
        // What is left is rounding: the vectors span all that `start` contains.
        if norm < 1e-6 * diagonal[0] {
            break;
        }
        beside.push(norm);
        basis.push(scaled(&next, 1.0 / norm));
    }
    let steps = diagonal.len();
    let matrix = DMatrix::from_fn(steps, steps, |i, j| match i.abs_diff(j) {
        0 => diagonal[i],
        1 => beside[i.min(j)],
        _ => 0.0,
    });
    let found = SymmetricEigen::new(matrix);
    let share = |k: usize| found.eigenvectors[(0, k)].powi(2);
    let nodes = (0..steps).map(|k| (found.eigenvalues[k].max(0.0), share(k))).collect();
    Some(Quadrature { energy, nodes })
}

fn scaled(v: &[f32], factor: f64) -> Vec<f32> {
    v.iter().map(|v| v * factor as f32).collect()
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
}
