//! Algorithm 1 of the paper, line by line, in `f64`. Every other implementation is checked against
//! this one.
//!
//! The code prefers clarity to speed. Symbols are the paper's; line numbers are those of its
//! listing.

use super::dictionary::UNSEEN;
use super::{Limits, OmpError, Scalar, Solution, Stop, finite};
use nalgebra::{DMatrix, DVector};

/// Finds a sparse `x` such that `dictionary * x` is near `y`. The dictionary is
/// `measurements x atoms`, with any column norms.
///
/// # Errors
/// [`OmpError`] if shapes differ, a number is not finite or a limit is negative.
pub fn solve(dictionary: &DMatrix<f64>, y: &[f64], limits: &Limits) -> Result<Solution, OmpError> {
    if y.len() != dictionary.nrows() {
        return Err(OmpError::Length { found: y.len(), expected: dictionary.nrows() });
    }
    finite("dictionary", dictionary.as_slice())?;
    finite("measurement", y)?;
    limits.check()?;
    let norms: Vec<f64> = dictionary.column_iter().map(|atom| atom.norm()).collect();
    let strongest = norms.iter().copied().fold(0.0, f64::max);
    let unseen: Vec<usize> =
        (0..norms.len()).filter(|&k| norms[k].powi(2) <= UNSEEN * strongest.powi(2)).collect();

    let mut phi = dictionary.clone();
    for (k, mut atom) in phi.column_iter_mut().enumerate() {
        // A factor of zero, so that an unseen atom correlates with nothing.
        atom *= if unseen.contains(&k) { 0.0 } else { 1.0 / norms[k] };
    }
    let y = DVector::from_column_slice(y);

    let energy = y.norm_squared();
    let enough = limits.enough(energy, y.len());
    let p0 = phi.tr_mul(&y); // lines 2 and 3
    let gram = phi.transpose() * &phi;
    let mut p = p0.clone();
    let mut epsilon = energy;
    let mut delta_before = 0.0;
    let mut l = DMatrix::zeros(0, 0);
    let mut x = DVector::zeros(0);
    let mut support: Vec<usize> = Vec::new();
    let mut residual_norms = vec![if energy > 0.0 { 1.0 } else { 0.0 }];

    let stop = loop {
        if epsilon <= enough {
            break Stop::Residual; // line 4
        }
        if support.len() >= limits.sparsity {
            break Stop::Sparsity;
        }
        let Some(k) = largest(&p, &support) else { break Stop::NoAtomLeft }; // line 5
        if p[k].abs() <= f64::ROUNDING * p0.amax() {
            break Stop::NoAtomLeft;
        }
        let chosen = support.len();
        let g = DVector::from_iterator(chosen, support.iter().map(|&j| gram[(j, k)]));
        let w = forward(&l, &g); // line 7
        let pivot = 1.0 - w.norm_squared();
        if pivot <= f64::DEPENDENT {
            break Stop::Dependent;
        }
        l = l.insert_row(chosen, 0.0).insert_column(chosen, 0.0); // line 8
        l.view_mut((chosen, 0), (1, chosen)).copy_from(&w.transpose());
        l[(chosen, chosen)] = pivot.sqrt();
        support.push(k);

        let b = DVector::from_iterator(chosen + 1, support.iter().map(|&j| p0[j]));
        x = backward(&l, &forward(&l, &b)); // line 10
        let beta = gram.select_columns(&support) * &x; // line 11
        p = &p0 - &beta; // line 12
        let delta: f64 = support.iter().zip(x.iter()).map(|(&j, x)| x * beta[j]).sum(); // line 13
        epsilon = epsilon - delta + delta_before; // line 14
        delta_before = delta;
        residual_norms.push((epsilon.max(0.0) / energy).sqrt());
    };
    let coefficients = support.iter().zip(x.iter()).map(|(&k, x)| x / norms[k]).collect();
    Ok(Solution { support, coefficients, residual_norms, stop, unseen })
}

/// The atom with the largest |p| outside the support, the lowest of equals.
fn largest(p: &DVector<f64>, support: &[usize]) -> Option<usize> {
    (0..p.len())
        .filter(|k| !support.contains(k))
        .reduce(|best, k| if p[k].abs() > p[best].abs() { k } else { best })
}

/// Solves `l u = b`.
fn forward(l: &DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    let mut u = b.clone();
    for i in 0..u.len() {
        let known = (0..i).map(|j| l[(i, j)] * u[j]).sum::<f64>();
        u[i] = (u[i] - known) / l[(i, i)];
    }
    u
}

/// Solves `l^T x = u`.
fn backward(l: &DMatrix<f64>, u: &DVector<f64>) -> DVector<f64> {
    let mut x = u.clone();
    for i in (0..x.len()).rev() {
        let known = (i + 1..x.len()).map(|j| l[(j, i)] * x[j]).sum::<f64>();
        x[i] = (x[i] - known) / l[(i, i)];
    }
    x
}
