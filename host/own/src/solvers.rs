//! The methods of inversion for a dense matrix of norm 1.
//!
//! Each method solves a list of strengths, the strongest first. Each strength starts from the
//! result of the one before.

use nalgebra::{DMatrix, DVector, Dyn, SymmetricEigen};
use nirspi_recon::Size;
use nirspi_recon::gradient::{climb, descend};
use nirspi_recon::omp::{DenseDictionary, Limits, OmpError, Solver, Stop, nonnegative};

/// The most iterations of iterative methods.
pub(super) const ITERATIONS: usize = 300;

/// Smallest singular value, relative to the largest, that is told from rounding.
const SEEN: f64 = 1e-7;

/// Relative change at which an iteration has settled.
pub(super) const SETTLED: f64 = 1e-5;

/// Largest singular value, by power iteration, with an error towards too large.
pub(super) fn norm(a: &DMatrix<f64>) -> f64 {
    let size = a.ncols();
    // The start has no symmetry, so that it is not orthogonal to the singular vector.
    let mut x = DVector::from_fn(size, |i, _| 1.0 + (i as f64 * 0.618_033_988_749_895).fract());
    let mut norm = 0.0;
    for _ in 0..50 {
        let length = x.norm();
        if length == 0.0 {
            break;
        }
        x /= length;
        let seen = a * &x;
        norm = seen.norm();
        x = a.tr_mul(&seen);
    }
    1.02 * norm
}

/// A problem with at most one row more than it has columns, and `abs(y - A x)` as in a taller one
/// for every `x`. With `A^T A = V L V^T` its rows are `L^(1/2) V^T`, with the measurements
/// `L^(-1/2) V^T A^T y`; what no `x` explains of `y` is the measurement of a last row of zeros.
///
/// Singular values below [`SEEN`] times the largest are lost.
pub(super) struct Condensed {
    /// The taller problem's matrix, in units of its largest weight.
    relative: DMatrix<f64>,
    largest: f64,
    gram: SymmetricEigen<f64, Dyn>,
}

impl Condensed {
    /// `None` for a problem that is not taller, which stays as it is.
    pub(super) fn of(a: &DMatrix<f64>) -> Option<Self> {
        let largest = a.amax();
        if a.nrows() <= a.ncols() + 1 || largest == 0.0 {
            return None;
        }
        let relative = a / largest;
        let gram = (relative.transpose() * &relative).symmetric_eigen();
        Some(Self { relative, largest, gram })
    }

    /// Number and singular value of each direction that is told from rounding.
    fn seen(&self) -> impl Iterator<Item = (usize, f64)> {
        let least = SEEN * SEEN * self.gram.eigenvalues.max();
        let energies = self.gram.eigenvalues.iter().enumerate();
        energies.filter(move |(_, energy)| **energy > least).map(|(k, energy)| (k, energy.sqrt()))
    }

    pub(super) fn rows(&self) -> DMatrix<f64> {
        let columns = self.relative.ncols();
        let mut rows = DMatrix::zeros(columns + 1, columns);
        for (k, singular) in self.seen() {
            let direction = self.gram.eigenvectors.column(k) * (singular * self.largest);
            rows.row_mut(k).tr_copy_from(&direction);
        }
        rows
    }

    pub(super) fn values(&self, y: &DVector<f64>) -> DVector<f64> {
        let columns = self.relative.ncols();
        let seen = self.gram.eigenvectors.tr_mul(&self.relative.tr_mul(y));
        let mut values = DVector::zeros(columns + 1);
        for (k, singular) in self.seen() {
            values[k] = seen[k] / singular;
        }
        values[columns] = (y.norm_squared() - values.norm_squared()).max(0.0).sqrt();
        values
    }
}

/// Least squares with least norm: conjugate gradients from 0 stay in the row space.
pub(super) fn least_squares(a: &DMatrix<f64>, y: &DVector<f64>) -> DVector<f64> {
    let mut x = DVector::zeros(a.ncols());
    let mut residual = y.clone();
    let mut gradient = a.tr_mul(&residual);
    let mut direction = gradient.clone();
    let mut energy = gradient.norm_squared();
    let enough = 1e-24 * energy;
    // Without rounding errors, as many steps as singular values are enough.
    for _ in 0..4 * a.nrows().min(a.ncols()) {
        if energy <= enough {
            break;
        }
        let seen = a * &direction;
        let step = energy / seen.norm_squared();
        x.axpy(step, &direction, 1.0);
        residual.axpy(-step, &seen, 1.0);
        gradient = a.tr_mul(&residual);
        let before = std::mem::replace(&mut energy, gradient.norm_squared());
        direction = &gradient + direction * (energy / before);
    }
    x
}

/// The factor by which `ghost` is subtracted from an image for the differences of neighbouring pixels to
/// be least; `None` if the ghost is even.
pub(super) fn smoothest(size: Size, image: &DVector<f64>, ghost: &DVector<f64>) -> Option<f64> {
    let (width, area) = (size.width(), size.area());
    let (mut shared, mut own) = (0.0, 0.0);
    for p in 0..area {
        let right = (p % width + 1 < width).then_some(p + 1);
        let below = (p + width < area).then_some(p + width);
        for neighbour in [right, below] {
            let Some(q) = neighbour else { continue };
            let step = ghost[q] - ghost[p];
            shared += step * (image[q] - image[p]);
            own += step * step;
        }
    }
    (own > 1e-12 * ghost.norm_squared()).then_some(shared / own)
}

/// `A S^2 A^T`.
pub(super) fn scaled_gram(a: &DMatrix<f64>, scale: &DVector<f64>) -> DMatrix<f64> {
    let mut scaled = a.clone();
    scaled.column_iter_mut().zip(scale.iter()).for_each(|(mut atom, s)| atom *= *s);
    &scaled * scaled.transpose()
}

/// Coefficients by the dual problem, `(A S^2 A^T + t) z = y` and `c = S^2 A^T z`, which has as many
/// unknowns as measurements. `gram` is [`scaled_gram`].
pub(super) fn tikhonov(
    a: &DMatrix<f64>,
    gram: &DMatrix<f64>,
    y: &DVector<f64>,
    scale: &DVector<f64>,
    strengths: &[f64],
) -> Vec<DVector<f64>> {
    let mut z = DVector::zeros(y.len());
    strengths
        .iter()
        .map(|&strength| {
            let operate = |z: &DVector<f64>| gram * z + z * strength;
            let mut residual = y - operate(&z);
            let mut direction = residual.clone();
            let mut energy = residual.norm_squared();
            for _ in 0..ITERATIONS {
                if energy <= SETTLED.powi(2) * y.norm_squared() {
                    break;
                }
                let image = operate(&direction);
                let step = energy / direction.dot(&image);
                z.axpy(step, &direction, 1.0);
                residual.axpy(-step, &image, 1.0);
                let before = std::mem::replace(&mut energy, residual.norm_squared());
                direction = &residual + &direction * (energy / before);
            }
            a.tr_mul(&z).component_mul(scale).component_mul(scale)
        })
        .collect()
}

/// FISTA. The first `free` coefficients have no penalty. The matrix may have any norm: a user's own
/// atoms may overlap, and then a sum of atoms has larger measurements than orthonormal atoms have.
pub(super) fn sparse(
    a: &DMatrix<f64>,
    y: &DVector<f64>,
    scale: &DVector<f64>,
    free: usize,
    strengths: &[f64],
) -> Vec<DVector<f64>> {
    // A longer step than one over the squared norm diverges.
    let step = norm(a).max(1.0).powi(-2);
    let mut c = DVector::<f64>::zeros(a.ncols());
    strengths
        .iter()
        .map(|strength| {
            let mut ahead = c.clone();
            let mut pace = 1.0_f64;
            for _ in 0..ITERATIONS {
                let mut next = a.tr_mul(&(y - a * &ahead)) * step + &ahead;
                for (j, v) in next.iter_mut().enumerate().skip(free) {
                    let threshold = step * strength * std::f64::consts::SQRT_2 / scale[j];
                    *v = v.signum() * (v.abs() - threshold).max(0.0);
                }
                let faster = 0.5 * (1.0 + (1.0 + 4.0 * pace * pace).sqrt());
                let change = &next - &c;
                ahead = &next + &change * ((pace - 1.0) / faster);
                pace = faster;
                c = next;
                if change.norm() <= SETTLED * c.norm() {
                    break;
                }
            }
            c.clone()
        })
        .collect()
}

/// The primal-dual algorithm with a dual for the measurements and one for the gradient.
pub(super) fn total_variation(
    size: Size,
    a: &DMatrix<f64>,
    y: &DVector<f64>,
    strengths: &[f64],
) -> Vec<DVector<f64>> {
    let (width, area) = (size.width(), size.area());
    let mut x = DVector::<f64>::zeros(area);
    // Steps are proportional to the contrast, and there is none: the image is dark or even.
    if y.norm() == 0.0 {
        return vec![x; strengths.len()];
    }
    // The gradient has norm sqrt 8. Divided by it, both parts have norm 1, and steps of 1 / sqrt 2
    // converge.
    let gradient = 8.0_f64.sqrt();
    let contrast = y.norm() / (area as f64).sqrt();
    let (primal, dual) = (contrast / 2.0_f64.sqrt(), 1.0 / (contrast * 2.0_f64.sqrt()));
    let mut pull = DVector::<f64>::zeros(y.len());
    let (mut down, mut across) = (vec![0.0_f32; area], vec![0.0_f32; area]);
    strengths
        .iter()
        .map(|strength| {
            let radius = strength.sqrt() * gradient;
            let mut ahead = x.clone();
            for _ in 0..ITERATIONS {
                pull = (&pull + (a * &ahead - y) * dual) / (1.0 + dual);
                let seen: Vec<f32> = ahead.iter().map(|&v| v as f32).collect();
                // Duals are stored in units of `radius`.
                climb(width, &seen, (dual / gradient / radius) as f32, &mut down, &mut across);
                let mut slope = vec![0.0_f32; area];
                descend(width, &down, &across, 1.0, &mut slope);
                let mut next = &x - a.tr_mul(&pull) * primal;
                for (v, slope) in next.iter_mut().zip(&slope) {
                    *v += primal * radius / gradient * f64::from(*slope);
                }
                ahead = &next * 2.0 - &x;
                let change = (&next - &x).norm();
                x = next;
                if change <= SETTLED * x.norm() {
                    break;
                }
            }
            x.clone()
        })
        .collect()
}

/// A sparse list of coefficients.
pub(super) struct Chosen {
    pub coefficients: DVector<f64>,
    pub size: usize,
    pub stop: Stop,
}

/// Atoms scaled by their expected sizes, with a row of noise for each atom.
pub(super) fn ridged(a: &DMatrix<f64>, scale: &DVector<f64>, noise: f64) -> DenseDictionary<f64> {
    let (rows, atoms) = a.shape();
    let ridge = noise.sqrt();
    DenseDictionary::new(&DMatrix::from_fn(rows + atoms, atoms, |m, k| match m.checked_sub(rows) {
        None => a[(m, k)] * scale[k],
        Some(other) if other == k => ridge,
        Some(_) => 0.0,
    }))
}

/// Algorithm 1 over [`ridged`] atoms.
pub(super) fn omp(
    dictionary: &DenseDictionary<f64>,
    y: &DVector<f64>,
    scale: &DVector<f64>,
    sparsities: &[usize],
    non_negative: bool,
) -> Result<Vec<Chosen>, OmpError> {
    let (rows, atoms) = (y.len(), scale.len());
    let mut measured = y.as_slice().to_vec();
    measured.resize(rows + atoms, 0.0);
    let chosen = |support: &[usize], coefficients: &[f64], stop| {
        let mut all = DVector::zeros(atoms);
        for (&k, c) in support.iter().zip(coefficients) {
            all[k] = c * scale[k];
        }
        Chosen { coefficients: all, size: support.len(), stop }
    };
    if non_negative {
        let solve = |&sparsity: &usize| {
            let found = nonnegative::solve(dictionary, &measured, &Limits::atoms(sparsity))?;
            Ok(chosen(&found.support, &found.coefficients, found.stop))
        };
        return sparsities.iter().map(solve).collect();
    }
    let longest = Limits::atoms(*sparsities.last().unwrap_or(&0));
    let path = Solver::new(dictionary, &longest)?.solve(&measured)?;
    let first = |&atoms: &usize| {
        let size = atoms.min(path.support.len());
        chosen(&path.support[..size], &path.coefficients(size), path.stop)
    };
    Ok(sparsities.iter().map(first).collect())
}
