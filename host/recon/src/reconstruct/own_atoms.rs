//! OMP over a user's own dictionary: any number of images.
//!
//! All atoms have the same expected coefficient, because only their images are known; the noise is
//! the only other part of the prior. Everything else is as in [`omp()`](super::omp).

use super::pursuit::{self, Found};
use super::{OmpReconstruction, OmpSettings, Problem, ReconstructError, Sparsity};
use super::{check_prior, reconstruction, selection};
use crate::basis::Basis;
use crate::omp::{DenseDictionary, Limits, OmpError};
use crate::{Measurements, fwht};
use nalgebra::DMatrix;

/// [`omp()`](super::omp) with a user's own `atoms` instead of a basis: row-major images of the
/// measurements' side, one after another, with any norms. The settings' basis and falloff have no
/// effect.
///
/// # Errors
/// [`ReconstructError`] if a setting is out of range, or `atoms` is not a number of whole images
/// with finite pixels.
pub fn omp_over(
    measurements: &Measurements,
    atoms: &[f32],
    settings: &OmpSettings,
) -> Result<OmpReconstruction, ReconstructError> {
    check_prior(settings.falloff, settings.noise)?;
    let area = measurements.side().area();
    if atoms.is_empty() || !atoms.len().is_multiple_of(area) {
        return Err(ReconstructError::Atoms { found: atoms.len(), area });
    }
    if let Some(index) = atoms.iter().position(|v| !v.is_finite()) {
        let found = atoms[index].into();
        return Err(OmpError::NotFinite { field: "dictionary", index, found }.into());
    }
    let mut problem = Problem::of(measurements, Basis::Pixel, Some(0.0), settings.noise);
    problem.residual = settings.residual;
    problem.stop_at_noise(settings.sparsity, measurements);
    problem.how = settings.how();
    let shown = Shown::new(&problem, atoms);
    let choice = match settings.sparsity {
        Sparsity::Fixed(atoms) => selection::Choice { atoms, trust: 1.0, held_back: None },
        Sparsity::Noise => {
            selection::Choice { atoms: problem.rows.len(), trust: 1.0, held_back: None }
        }
        Sparsity::CrossValidated { most, folds } => {
            selection::choose_sparsity(&problem, most, folds, |kept, sparsities| {
                let found = shown.pursue(&problem, kept, sparsities)?;
                Ok(found.iter().map(|found| shown.predict(found)).collect())
            })?
        }
    };
    let every: Vec<usize> = (0..problem.rows.len()).collect();
    let found = shown.pursue(&problem, &every, &[choice.atoms])?.remove(0);
    let predicted = shown.predict(&found);
    Ok(reconstruction(&problem, found, predicted, settings, &choice))
}

/// Measurements of the atoms, of unit norm, by every row: `rows x atoms`.
struct Shown {
    rows: DMatrix<f32>,
    /// Expected size of a coefficient.
    scale: f32,
}

impl Shown {
    fn new(problem: &Problem<'_>, atoms: &[f32]) -> Self {
        let area = problem.side.area();
        let mut rows = DMatrix::from_column_slice(area, atoms.len() / area, atoms);
        for mut atom in rows.column_iter_mut() {
            // An atom of zeros stays zero, and counts as unseen.
            let norm = atom.norm();
            if norm > 0.0 {
                atom /= norm * problem.side.pixels() as f32;
            }
            let mut values = atom.as_slice().to_vec();
            fwht::transform(&mut values);
            atom.copy_from_slice(&values);
        }
        // As in `prior_scale`, the expected energy of the measured rows is their measured energy.
        let mean = |row: u32| row != 0;
        let energy = problem.rows.iter().zip(&problem.values).filter(|(row, _)| mean(**row));
        let energy: f32 = energy.map(|(_, v)| v * v).sum();
        let seen = problem.rows.iter().filter(|row| mean(**row));
        let seen: f32 = seen.map(|&row| rows.row(row as usize).norm_squared()).sum();
        let scale = if energy > 0.0 && seen > 0.0 { (energy / seen).sqrt() } else { 1.0 };
        Self { rows, scale }
    }

    /// Chooses atoms for the measurements at some positions. A row of noise for each atom is the
    /// prior, as in [`crate::omp::sampled`].
    fn pursue(
        &self,
        problem: &Problem<'_>,
        positions: &[usize],
        sparsities: &[usize],
    ) -> Result<Vec<Found>, OmpError> {
        let (measured, atoms) = (positions.len(), self.rows.ncols());
        let ridge = problem.prior.noise / self.scale;
        let matrix =
            DMatrix::from_fn(measured + atoms, atoms, |m, k| match m.checked_sub(measured) {
                None => self.rows[(problem.rows[positions[m]] as usize, k)],
                Some(other) if other == k => ridge,
                Some(_) => 0.0,
            });
        let mut y: Vec<f32> = positions.iter().map(|&k| problem.values[k]).collect();
        y.resize(measured + atoms, 0.0);
        // The prior's rows have no measurement and no noise.
        let share = (measured as f64 / (measured + atoms) as f64).sqrt();
        let Limits { noise, residual, .. } = problem.limits();
        let limits = Limits { sparsity: 0, residual, noise: noise * share };
        let dictionary = DenseDictionary::new(&matrix);
        pursuit::pursue(&dictionary, &y, &limits, problem.how, sparsities)
    }

    /// Prediction of these atoms for every row.
    fn predict(&self, found: &Found) -> Vec<f32> {
        let mut predicted = vec![0.0; self.rows.nrows()];
        for (&atom, x) in found.support.iter().zip(&found.coefficients) {
            for (predicted, row) in predicted.iter_mut().zip(self.rows.column(atom).iter()) {
                *predicted += *x as f32 * row;
            }
        }
        predicted
    }
}
