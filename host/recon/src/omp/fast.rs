//! Algorithm 1 in `f32`, from columns of the Gram matrix (Batch-OMP).
//!
//! The one law: same support and coefficients as [`reference`](super::reference), to `f32`.
//!
//! Instead of solving two triangular systems an atom, the chosen columns of the Gram matrix are
//! orthogonalised as they come (a partial Cholesky factorisation of the whole Gram matrix, pivoted by the
//! correlations). Row `i` of the factor `q` then updates the projection `p` of *all* atoms, the residual's energy
//! falls by one square, and the Cholesky factor of the support, from which the coefficients of any
//! number of atoms can be read, is contained in it. R. Rubinstein et al., *Efficient implementation of
//! the K-SVD algorithm using batch orthogonal matching pursuit* (2008), has the Gram and the norm-based stop.
//!
//! The residual's energy is a difference of `f32` results: limits on its norm under about 1e-3 of the
//! measurement's are met by rounding.

use super::{DEPENDENT, Limits, OmpError, ROUNDING, Solution, Stop, UNSEEN, check};
use nalgebra::DMatrix;

/// The Gram matrix of a dictionary, a column at a time.
pub trait Gram {
    /// The squares of the atoms' norms: the matrix's diagonal, one entry an atom.
    fn diagonal(&self) -> &[f32];

    /// Writes column `atom`: the atom's inner products with every atom.
    fn column(&self, atom: usize, out: &mut [f32]);
}

/// The Gram matrix of a dictionary that is a matrix, computed once for any number of measurements.
#[derive(Debug, Clone)]
pub struct DenseGram {
    gram: DMatrix<f32>,
    diagonal: Vec<f32>,
}

impl DenseGram {
    /// `dictionary^T * dictionary` of a `measurements x atoms` dictionary.
    #[must_use]
    pub fn new(dictionary: &DMatrix<f32>) -> Self {
        let gram = dictionary.transpose() * dictionary; // a blocked product; tr_mul is one dot at a time
        let diagonal = gram.diagonal().as_slice().to_vec();
        Self { gram, diagonal }
    }
}

impl Gram for DenseGram {
    fn diagonal(&self) -> &[f32] {
        &self.diagonal
    }

    fn column(&self, atom: usize, out: &mut [f32]) {
        out.copy_from_slice(self.gram.column(atom).as_slice());
    }
}

/// Finds a sparse `x` with `dictionary * x` near `y`. The dictionary is `measurements x atoms`, of any
/// column norms. For many measurements with one dictionary, keep its [`DenseGram`] and call [`pursue`].
///
/// # Errors
/// [`OmpError`] if shapes differ, a number is not finite or the residual limit is negative.
pub fn solve(dictionary: &DMatrix<f32>, y: &[f32], limits: &Limits) -> Result<Solution, OmpError> {
    check(dictionary.nrows(), dictionary.as_slice(), y, limits)?;
    let p0 = dictionary.tr_mul(&nalgebra::DVectorView::from_slice(y, y.len()));
    let energy = y.iter().map(|&y| f64::from(y).powi(2)).sum();
    Ok(pursue(&DenseGram::new(dictionary), p0.as_slice(), energy, limits)?.solution())
}

/// A pursuit that has ended: a solution for every number of atoms up to the last.
#[derive(Debug, Clone)]
pub struct Path {
    /// Atoms in the order in which they were chosen.
    pub support: Vec<usize>,
    /// Norm of the residual before the first and after each atom, relative to the measurement's.
    pub residual_norms: Vec<f64>,
    /// Why there are no more.
    pub stop: Stop,
    /// Atoms that the measurement does not see.
    pub unseen: Vec<usize>,
    /// Lower-triangular factor of the support's Gram matrix, row after row.
    factor: Vec<f32>,
    /// The initial projection, orthogonalised along with the atoms.
    steps: Vec<f32>,
}

/// Chooses atoms for the measurement whose initial projection is `p0` (its inner product with each atom)
/// and whose squared norm is `energy`.
///
/// # Errors
/// [`OmpError`] if `p0` does not have one entry an atom, one is not finite, or the residual limit is negative.
pub fn pursue<G: Gram + ?Sized>(
    gram: &G,
    p0: &[f32],
    energy: f64,
    limits: &Limits,
) -> Result<Path, OmpError> {
    check(gram.diagonal().len(), &[], p0, limits)?;
    let diagonal = gram.diagonal();
    let atoms = diagonal.len();
    let strongest = diagonal.iter().copied().fold(0.0, f32::max);
    let visible = |d: f32| f64::from(d) > UNSEEN * f64::from(strongest);
    let unseen = (0..atoms).filter(|&k| !visible(diagonal[k])).collect();
    // Zero for what must not be chosen: unseen atoms and, later, those of the support.
    let mut inverse_norm: Vec<f32> =
        diagonal.iter().map(|&d| if visible(d) { d.sqrt().recip() } else { 0.0 }).collect();

    let mut p = p0.to_vec();
    let mut q: Vec<f32> = Vec::new();
    let mut path = Path {
        support: Vec::new(),
        residual_norms: vec![if energy > 0.0 { 1.0 } else { 0.0 }],
        stop: Stop::Sparsity,
        unseen,
        factor: Vec::new(),
        steps: Vec::new(),
    };
    let mut remaining = energy;
    let mut first_score = None;
    path.stop = loop {
        if remaining <= limits.residual.powi(2) * energy {
            break Stop::Residual;
        }
        if path.support.len() >= limits.sparsity {
            break Stop::Sparsity;
        }
        let (k, score) = best(&p, &inverse_norm);
        if score <= ROUNDING as f32 * *first_score.get_or_insert(score) {
            break Stop::NoAtomLeft;
        }
        let chosen = path.support.len();
        q.resize((chosen + 1) * atoms, 0.0);
        let (before, row) = q.split_at_mut(chosen * atoms);
        gram.column(k, row);
        let weights: Vec<f32> = before.chunks_exact(atoms).map(|q| q[k]).collect();
        subtract_combination(row, before, &weights);
        let pivot = row[k];
        if f64::from(pivot) <= DEPENDENT * f64::from(diagonal[k]) {
            break Stop::Dependent;
        }
        let scale = pivot.sqrt().recip();
        let step = p[k] * scale;
        for (p, q) in p.iter_mut().zip(row) {
            *q *= scale;
            *p -= step * *q;
        }
        inverse_norm[k] = 0.0;
        path.factor.extend_from_slice(&weights);
        path.factor.push(pivot.sqrt());
        path.steps.push(step);
        path.support.push(k);
        remaining -= f64::from(step).powi(2);
        path.residual_norms.push((remaining.max(0.0) / energy).sqrt());
    };
    Ok(path)
}

impl Path {
    /// Least-squares coefficients over the first `atoms` of the support (all of it if it has fewer).
    #[must_use]
    pub fn coefficients(&self, atoms: usize) -> Vec<f64> {
        let atoms = atoms.min(self.support.len());
        let entry = |i: usize, j: usize| f64::from(self.factor[i * (i + 1) / 2 + j]);
        let mut x: Vec<f64> = self.steps[..atoms].iter().map(|&s| f64::from(s)).collect();
        for i in (0..atoms).rev() {
            let known: f64 = (i + 1..atoms).map(|j| entry(j, i) * x[j]).sum();
            x[i] = (x[i] - known) / entry(i, i);
        }
        x
    }

    /// The solution over the whole support.
    #[must_use]
    pub fn solution(self) -> Solution {
        let coefficients = self.coefficients(self.support.len());
        let Self { support, residual_norms, stop, unseen, .. } = self;
        Solution { support, coefficients, residual_norms, stop, unseen }
    }
}

/// Atoms scored together, in lanes that vectorise.
const LANES: usize = 16;

/// The atom of largest `|p| * inverse_norm`, the lowest of equals, and that score.
fn best(p: &[f32], inverse_norm: &[f32]) -> (usize, f32) {
    let score = |k: usize| p[k].abs() * inverse_norm[k];
    let (p_blocks, rest) = p.as_chunks::<LANES>();
    let mut best_block = (0, -1.0);
    for (block, (p, n)) in p_blocks.iter().zip(inverse_norm.as_chunks::<LANES>().0).enumerate() {
        let mut lanes = [0.0_f32; LANES];
        for ((lane, p), n) in lanes.iter_mut().zip(p).zip(n) {
            *lane = p.abs() * n;
        }
        let mut width = LANES / 2;
        while width > 0 {
            for lane in 0..width {
                let other = lanes[lane + width];
                lanes[lane] = if other > lanes[lane] { other } else { lanes[lane] };
            }
            width /= 2;
        }
        if lanes[0] > best_block.1 {
            best_block = (block, lanes[0]);
        }
    }
    let start = best_block.0 * LANES;
    let in_block = start..(start + LANES).min(p.len() - rest.len());
    let candidates = in_block.chain(p.len() - rest.len()..p.len());
    candidates.fold((0, -1.0), |best, k| if score(k) > best.1 { (k, score(k)) } else { best })
}

/// `row -= sum_i weights[i] * before[i]`, four rows a pass to spare the traffic through `row`.
fn subtract_combination(row: &mut [f32], before: &[f32], weights: &[f32]) {
    let atoms = row.len();
    let (fours, rest) = weights.as_chunks::<4>();
    let mut blocks = before.chunks_exact(4 * atoms);
    for ([a, b, c, d], q) in fours.iter().zip(&mut blocks) {
        let (q01, q23) = q.split_at(2 * atoms);
        let ((q0, q1), (q2, q3)) = (q01.split_at(atoms), q23.split_at(atoms));
        for ((((row, q0), q1), q2), q3) in row.iter_mut().zip(q0).zip(q1).zip(q2).zip(q3) {
            *row -= (a * q0 + b * q1) + (c * q2 + d * q3);
        }
    }
    for (weight, q) in rest.iter().zip(blocks.remainder().chunks_exact(atoms)) {
        for (row, q) in row.iter_mut().zip(q) {
            *row -= weight * q;
        }
    }
}
