//! Single precision where it is enough, double where it is not.
//!
//! The one law: the support is that of double precision. A choice whose lead over the next best atom is within the rounding
//! of `f32` is not believed, nor is an end that only `f32` sees; such measurements, a few in a hundred, are solved again.

use super::batch::{Problem, solve_batch_paths};
use super::dense::DenseDictionary;
use super::pursuit::{Path, Solver};
use super::{Backend, Dictionary, Limits, OmpError, Scalar, Solution, Stop, solve_batch};
use nalgebra::DMatrix;
use std::sync::OnceLock;

/// Leads over the next best atom, relative to the measurement's norm, that are believed. Initial projections were seen to
/// err by up to 1.02 epsilons (1024 atoms of unit norm, 256 to 1024 normal measurements).
const BELIEVED: f64 = 8.0 * f32::EPSILON as f64;

/// A dictionary in both precisions; the double one is prepared when it is first needed.
#[derive(Debug)]
pub struct MixedDictionary {
    single: DenseDictionary<f32>,
    exact: Exact,
}

/// A matrix for the measurements that single precision cannot decide.
#[derive(Debug)]
pub(super) struct Exact {
    matrix: DMatrix<f64>,
    double: OnceLock<DenseDictionary<f64>>,
    normalised: bool,
}

impl Exact {
    pub(super) fn new(matrix: DMatrix<f64>, normalised: bool) -> Self {
        Self { matrix, double: OnceLock::new(), normalised }
    }

    /// The dictionary, prepared when it is first needed.
    fn double(&self) -> &DenseDictionary<f64> {
        self.double.get_or_init(|| {
            let double = DenseDictionary::new(&self.matrix);
            if self.normalised { double } else { double.unnormalised() }
        })
    }

    /// Solves the `doubtful` ones of the measurements `y` again, on the processor.
    pub(super) fn solve_again(
        &self,
        limits: &Limits,
        y: &[f64],
        doubtful: &[usize],
        solutions: &mut [Solution],
    ) -> Result<(), OmpError> {
        if doubtful.is_empty() {
            return Ok(());
        }
        let measurements = self.matrix.nrows();
        let frame = |i: &usize| &y[i * measurements..(i + 1) * measurements];
        let again: Vec<f64> = doubtful.iter().flat_map(frame).copied().collect();
        let problem = Problem { dictionary: self.double(), limits: *limits };
        for (&i, solution) in doubtful.iter().zip(solve_batch(&problem, &again, Backend::Cpu)?) {
            solutions[i] = solution;
        }
        Ok(())
    }
}

impl MixedDictionary {
    /// Prepares a `measurements x atoms` matrix. Atoms are chosen by their correlations with the residual, or with
    /// `normalised` false by their inner products as they are.
    #[must_use]
    pub fn new(matrix: DMatrix<f64>, normalised: bool) -> Self {
        let single = DenseDictionary::new(&matrix.map(|v| v as f32));
        // Atoms that only single precision takes for the same stay apart, and their ties go to double precision.
        let same = |&(i, j): &(usize, usize)| {
            let (a, b) = (matrix.column(i), matrix.column(j));
            a.dot(&b).powi(2) >= (1.0 - f64::DEPENDENT) * a.norm_squared() * b.norm_squared()
        };
        let doubles = single.atoms().doubles().iter().copied().filter(same).collect();
        let single = single.with_doubles(doubles);
        let single = if normalised { single } else { single.unnormalised() };
        Self { single, exact: Exact::new(matrix, normalised) }
    }

    /// The dictionary in double precision.
    pub fn double(&self) -> &DenseDictionary<f64> {
        self.exact.double()
    }

    /// The dictionary in single precision.
    #[must_use]
    pub fn single(&self) -> &DenseDictionary<f32> {
        &self.single
    }

    /// For one measurement after another, without delay.
    ///
    /// # Errors
    /// [`OmpError`] if a limit is negative or NaN.
    pub fn solver(&self, limits: &Limits) -> Result<MixedSolver<'_>, OmpError> {
        let single = Solver::new(&self.single, limits)?;
        Ok(MixedSolver { dictionary: self, limits: *limits, single, double: None, y: Vec::new() })
    }

    /// [`solve_batch`] on the processor, and how many of the measurements were solved in double precision.
    ///
    /// # Errors
    /// Those of [`solve_batch`].
    pub fn solve_batch(
        &self,
        limits: &Limits,
        y: &[f64],
    ) -> Result<(Vec<Solution>, usize), OmpError> {
        super::finite("measurement", y)?;
        let single: Vec<f32> = y.iter().map(|&y| y as f32).collect();
        let problem = Problem { dictionary: &self.single, limits: *limits };
        let paths = solve_batch_paths(&problem, &single)?;
        let doubtful: Vec<usize> = (0..paths.len()).filter(|&i| is_doubtful(&paths[i])).collect();
        let mut solutions: Vec<Solution> = paths.into_iter().map(Path::solution).collect();
        self.exact.solve_again(limits, y, &doubtful, &mut solutions)?;
        Ok((solutions, doubtful.len()))
    }
}

/// A [`Solver`] in both precisions, with memory of its own.
#[derive(Debug)]
pub struct MixedSolver<'d> {
    dictionary: &'d MixedDictionary,
    limits: Limits,
    single: Solver<'d, f32, DenseDictionary<f32>>,
    double: Option<Solver<'d, f64, DenseDictionary<f64>>>,
    y: Vec<f32>,
}

impl MixedSolver<'_> {
    /// The sparse representation of `y`, and whether it took double precision.
    ///
    /// # Errors
    /// [`OmpError`] if `y` does not fit the dictionary or is not finite.
    pub fn solve(&mut self, y: &[f64]) -> Result<(Solution, bool), OmpError> {
        self.y.clear();
        self.y.extend(y.iter().map(|&y| y as f32));
        let path = self.single.solve(&self.y)?;
        if !is_doubtful(&path) {
            return Ok((path.solution(), false));
        }
        let double = match self.double.take() {
            Some(double) => double,
            None => Solver::new(self.dictionary.double(), &self.limits)?,
        };
        Ok((self.double.insert(double).solve(y)?.solution(), true))
    }
}

fn is_doubtful(path: &Path<f32>) -> bool {
    let ended_by_rounding = matches!(path.stop, Stop::Dependent | Stop::NoAtomLeft);
    path.least_lead < BELIEVED || ended_by_rounding
}
