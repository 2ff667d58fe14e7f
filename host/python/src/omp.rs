//! Orthogonal matching pursuit over a dictionary that is prepared once.

use crate::arrays::{array, slice, whole};
use crate::errors::{refusal, refused};
use crate::work::{backend, heavy, long};
use nalgebra::DMatrix;
use nirspi_recon::omp::{
    Limits, MixedDictionary, OmpError, Problem, Solution, Solver, Stop, solve_batch,
};
use nirspi_recon::{Backend, omp};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

/// A dictionary of atoms, prepared for any number of measurements.
#[pyclass(frozen, module = "nirspi._nirspi")]
pub struct Dictionary {
    prepared: MixedDictionary,
    measurements: usize,
    atoms: usize,
    backend: Backend,
    /// Whether everything is computed in double precision.
    double: bool,
}

fn stop_word(stop: Stop) -> &'static str {
    match stop {
        Stop::Sparsity => "sparsity",
        Stop::Residual => "residual",
        Stop::NoAtomLeft => "no atom left",
        Stop::Dependent => "dependent",
    }
}

/// `(support, coefficients, relative residuals, reasons, used double precision)`.
type Solved<'py> = (
    Bound<'py, PyArray1<i32>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Vec<&'static str>,
    usize,
);

impl Dictionary {
    /// The limits of each measurement. `tol`, if given, is the largest squared norm of the residual.
    fn limits(sparsity: usize, residual: &[f64], count: usize) -> PyResult<Vec<Limits>> {
        let of = |residual: f64| Limits { residual, ..Limits::atoms(sparsity) };
        match residual {
            [one] => Ok(vec![of(*one)]),
            each if each.len() == count => Ok(each.iter().copied().map(of).collect()),
            _ => Err(refused(format!("{} residuals for {count} measurements", residual.len()))),
        }
    }

    fn solutions(&self, y: &[f64], limits: &[Limits]) -> Result<(Vec<Solution>, usize), OmpError> {
        if let [limits] = limits {
            return self.batch(y, limits);
        }
        let (mut found, mut doubles) = (Vec::new(), 0);
        for (y, limits) in y.chunks_exact(self.measurements).zip(limits) {
            let (mut solution, double) = self.batch(y, limits)?;
            found.append(&mut solution);
            doubles += double;
        }
        Ok((found, doubles))
    }

    fn batch(&self, y: &[f64], limits: &Limits) -> Result<(Vec<Solution>, usize), OmpError> {
        match self.backend {
            Backend::Wgpu | Backend::Cuda => {
                let single: Vec<f32> = y.iter().map(|&v| v as f32).collect();
                let problem = Problem { dictionary: self.prepared.single(), limits: *limits };
                Ok((solve_batch(&problem, &single, self.backend)?, 0))
            }
            _ if self.double => {
                let problem = Problem { dictionary: self.prepared.double(), limits: *limits };
                let found = solve_batch(&problem, y, Backend::Cpu)?;
                let count = found.len();
                Ok((found, count))
            }
            _ => self.prepared.solve_batch(limits, y),
        }
    }
}

#[pymethods]
impl Dictionary {
    /// Prepares atoms, `measurements` values each, one after another.
    #[new]
    fn new(
        py: Python<'_>,
        columns: PyReadonlyArray1<'_, f64>,
        measurements: usize,
        normalised: bool,
        double: bool,
        device: &str,
    ) -> PyResult<Self> {
        let columns = slice(&columns)?;
        let atoms = whole("X", columns.len(), measurements)?;
        if atoms == 0 {
            return Err(refused("X has no atom, expected at least one"));
        }
        if let Some(at) = columns.iter().position(|v| !v.is_finite()) {
            let (row, column) = (at % measurements, at / measurements);
            return Err(refused(format!(
                "X is {} at [{row}, {column}], expected finite numbers",
                columns[at]
            )));
        }
        let backend = backend(device)?.0;
        let prepared = long(py, |_| {
            let matrix = DMatrix::from_column_slice(measurements, atoms, columns);
            let prepared = MixedDictionary::new(matrix, normalised);
            if double {
                prepared.double();
            }
            Ok(prepared)
        })?;
        Ok(Self { prepared, measurements, atoms, backend, double })
    }

    /// `(measurements, atoms)`.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.measurements, self.atoms)
    }

    /// Atoms that no measurement sees.
    #[getter]
    fn unseen(&self) -> Vec<usize> {
        use omp::Dictionary as _;
        self.prepared.single().atoms().unseen().to_vec()
    }

    /// Pursues measurements, one after another, up to `sparsity` atoms. Rows of the result are filled up with -1 and 0.
    fn solve<'py>(
        &self,
        py: Python<'py>,
        y: PyReadonlyArray1<'py, f64>,
        sparsity: usize,
        residual: Vec<f64>,
    ) -> PyResult<Solved<'py>> {
        let y = slice(&y)?;
        let count = whole("y", y.len(), self.measurements)?;
        let limits = Self::limits(sparsity, &residual, count)?;
        let found = heavy(py, || {
            let (found, doubles) = self.solutions(y, &limits).map_err(refusal)?;
            let mut support = vec![-1_i32; count * sparsity];
            let mut coefficients = vec![0.0; count * sparsity];
            for (k, one) in found.iter().enumerate() {
                let at = k * sparsity;
                for (i, (&atom, &x)) in one.support.iter().zip(&one.coefficients).enumerate() {
                    support[at + i] = i32::try_from(atom).unwrap_or(i32::MAX);
                    coefficients[at + i] = x;
                }
            }
            let residuals: Vec<f64> =
                found.iter().map(|one| one.residual_norms.last().copied().unwrap_or(0.0)).collect();
            let stops: Vec<&str> = found.iter().map(|one| stop_word(one.stop)).collect();
            Ok((support, coefficients, residuals, stops, doubles))
        })?;
        let (support, coefficients, residuals, stops, doubles) = found;
        Ok((array(py, support), array(py, coefficients), array(py, residuals), stops, doubles))
    }

    /// As [`Dictionary::solve`] in double precision, with the coefficients after every atom: `sparsity` rows of
    /// `sparsity` numbers a measurement.
    fn path<'py>(
        &self,
        py: Python<'py>,
        y: PyReadonlyArray1<'py, f64>,
        sparsity: usize,
        residual: Vec<f64>,
    ) -> PyResult<Solved<'py>> {
        let y = slice(&y)?;
        let count = whole("y", y.len(), self.measurements)?;
        let limits = Self::limits(sparsity, &residual, count)?;
        let found = heavy(py, || {
            let mut support = vec![-1_i32; count * sparsity];
            let mut coefficients = vec![0.0; count * sparsity * sparsity];
            let (mut residuals, mut stops) = (Vec::new(), Vec::new());
            for (k, y) in y.chunks_exact(self.measurements).enumerate() {
                let limits = &limits[k % limits.len()];
                let mut solver = Solver::new(self.prepared.double(), limits).map_err(refusal)?;
                let path = solver.solve(y).map_err(refusal)?;
                for (i, &atom) in path.support.iter().enumerate() {
                    support[k * sparsity + i] = i32::try_from(atom).unwrap_or(i32::MAX);
                    let at = (k * sparsity + i) * sparsity;
                    let after = path.coefficients(i + 1);
                    coefficients[at..at + after.len()].copy_from_slice(&after);
                }
                residuals.push(path.residual_norms.last().copied().unwrap_or(0.0));
                stops.push(stop_word(path.stop));
            }
            Ok((support, coefficients, residuals, stops, count))
        })?;
        let (support, coefficients, residuals, stops, doubles) = found;
        Ok((array(py, support), array(py, coefficients), array(py, residuals), stops, doubles))
    }
}
