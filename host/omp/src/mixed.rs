//! Single precision where it is enough, double precision where it is not.
//!
//! # Invariant
//! The support is that of double precision
//! (`tests::mixed::few_of_many_frames_need_double_precision_and_all_have_its_support`). A
//! choice whose lead over the next best atom is within the rounding of `f32` is made in `f64`
//! (module `referee`). A measurement whose pursuit ends only because of the rounding of `f32` is
//! solved again.

use super::batch::{Problem, solve_batch_paths, solve_batch_with};
use super::dense::DenseDictionary;
use super::path::Path;
use super::pursuit::{Solver, energy};
use super::referee::{BELIEVED, BELIEVED_ENERGY, DoubleReferee};
use super::{Dictionary, Limits, OmpError, Scalar, Solution, Stop};
use nalgebra::DMatrix;
use std::sync::OnceLock;

/// A dictionary in both precisions. The double-precision one is prepared at its first use.
#[derive(Debug)]
pub struct MixedDictionary {
    single: DenseDictionary<f32>,
    exact: Exact,
}

/// A matrix in `f64`, for measurements that single precision cannot decide.
#[derive(Debug)]
struct Exact {
    matrix: DMatrix<f64>,
    double: OnceLock<DenseDictionary<f64>>,
    normalised: bool,
}

impl Exact {
    fn new(matrix: DMatrix<f64>, normalised: bool) -> Self {
        Self { matrix, double: OnceLock::new(), normalised }
    }

    /// The dictionary in `f64`, prepared at its first use.
    fn double(&self) -> &DenseDictionary<f64> {
        self.double.get_or_init(|| {
            let double = DenseDictionary::new(&self.matrix);
            if self.normalised { double } else { double.unnormalised() }
        })
    }

    /// Solves the `doubtful` measurements of `y` again, on the processor.
    fn solve_again(
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
        for (&i, path) in doubtful.iter().zip(solve_batch_paths(&problem, &again)?) {
            solutions[i] = path.solution();
        }
        Ok(())
    }
}

impl MixedDictionary {
    /// Prepares a `measurements x atoms` matrix. Atoms are chosen by their correlations with the
    /// residual or, with `normalised` false, by their plain inner products.
    #[must_use]
    pub fn new(matrix: DMatrix<f64>, normalised: bool) -> Self {
        let single = DenseDictionary::new(&matrix.map(|v| v as f32));
        // Atoms that are parallel only in single precision stay distinct, and double precision
        // decides between them.
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

    /// A solver for one measurement after another.
    ///
    /// # Errors
    /// [`OmpError`] if a limit is negative or NaN.
    pub fn solver(&self, limits: &Limits) -> Result<MixedSolver<'_>, OmpError> {
        let single = Solver::new(&self.single, limits)?;
        Ok(MixedSolver { dictionary: self, limits: *limits, single, double: None, y: Vec::new() })
    }

    /// [`solve_batch`](super::solve_batch) on the processor; also returns for how many measurements double precision
    /// was used.
    ///
    /// # Errors
    /// The errors of [`solve_batch`](super::solve_batch).
    pub fn solve_batch(
        &self,
        limits: &Limits,
        y: &[f64],
    ) -> Result<(Vec<Solution>, usize), OmpError> {
        super::finite("measurement", y)?;
        let single: Vec<f32> = y.iter().map(|&y| y as f32).collect();
        let measurements = self.exact.matrix.nrows();
        let frame = |i: usize| &y[i * measurements..(i + 1) * measurements];
        let paths = self.solve_in_single(limits, &single, &frame)?;
        let frames = paths.iter().zip(single.chunks_exact(measurements));
        let doubts: Vec<bool> = frames.map(|(path, y)| is_doubtful(path, limits, y)).collect();
        let doubtful: Vec<usize> = (0..paths.len()).filter(|&i| doubts[i]).collect();
        let refereed = paths.iter().zip(&doubts).filter(|(p, doubt)| p.refereed > 0 && !**doubt);
        let refereed = refereed.count();
        let mut solutions: Vec<Solution> = paths.into_iter().map(Path::solution).collect();
        self.exact.solve_again(limits, y, &doubtful, &mut solutions)?;
        Ok((solutions, refereed + doubtful.len()))
    }

    /// The pursuits in `f32`, with the referee.
    fn solve_in_single<'y>(
        &self,
        limits: &Limits,
        y: &[f32],
        frame: &(impl Fn(usize) -> &'y [f64] + Sync),
    ) -> Result<Vec<Path<f32>>, OmpError> {
        let problem = Problem { dictionary: &self.single, limits: *limits };
        if self.exact.double.get().is_none() {
            // All threads together prepare the double-precision dictionary, and only if a frame
            // needs it.
            let paths = solve_batch_paths(&problem, y)?;
            let mut frames = paths.iter().zip(y.chunks_exact(self.exact.matrix.nrows()));
            if !frames.any(|(path, y)| is_doubtful(path, limits, y)) {
                return Ok(paths);
            }
        }
        let double = self.double();
        let referee_of = |i| Some(DoubleReferee::new(&self.exact.matrix, double, frame(i)));
        solve_batch_with(&problem, y, referee_of)
    }
}

/// A [`Solver`] in both precisions, with its own memory.
#[derive(Debug)]
pub struct MixedSolver<'d> {
    dictionary: &'d MixedDictionary,
    limits: Limits,
    single: Solver<'d, f32, DenseDictionary<f32>>,
    double: Option<Solver<'d, f64, DenseDictionary<f64>>>,
    y: Vec<f32>,
}

impl MixedSolver<'_> {
    /// The sparse representation of `y`, and whether double precision was used.
    ///
    /// # Errors
    /// [`OmpError`] if `y` does not fit the dictionary or is not finite.
    pub fn solve(&mut self, y: &[f64]) -> Result<(Solution, bool), OmpError> {
        self.y.clear();
        self.y.extend(y.iter().map(|&y| y as f32));
        let dictionary = self.dictionary;
        let referee = |double| DoubleReferee::new(&dictionary.exact.matrix, double, y);
        let mut path =
            self.single.solve_with(&self.y, &mut dictionary.exact.double.get().map(referee))?;
        let limits = &self.limits;
        if is_doubtful(&path, limits, &self.y) && dictionary.exact.double.get().is_none() {
            let mut referee = referee(dictionary.double());
            path = self.single.solve_with(&self.y, &mut referee)?;
        }
        if !is_doubtful(&path, limits, &self.y) {
            let refereed = path.refereed > 0;
            return Ok((path.solution(), refereed));
        }
        let double = match self.double.take() {
            Some(double) => double,
            None => Solver::new(self.dictionary.double(), &self.limits)?,
        };
        Ok((self.double.insert(double).solve(y)?.solution(), true))
    }
}

/// Whether single precision may be wrong: about a choice between two atoms, or about the end of the
/// pursuit.
fn is_doubtful(path: &Path<f32>, limits: &Limits, y: &[f32]) -> bool {
    let ended_by_rounding = matches!(path.stop, Stop::Dependent | Stop::NoAtomLeft);
    // The residual is not compared with the limit once there are enough atoms.
    let looked = path.residual_norms.len() - usize::from(path.stop == Stop::Sparsity);
    let energy = energy(y);
    let enough = limits.enough(energy, y.len()) / energy;
    let close = |norm: &f64| (norm.powi(2) - enough).abs() < BELIEVED_ENERGY;
    path.least_lead < BELIEVED
        || ended_by_rounding
        || path.residual_norms[..looked].iter().any(close)
}
