//! Single precision where it is enough, double where it is not.
//!
//! The one law: the support is that of double precision. A choice whose lead over the next best atom is within the rounding
//! of `f32` is made in `f64` (the module `referee`); measurements whose pursuit only `f32` sees at an end are solved again.

use super::batch::{Problem, solve_batch_paths, solve_batch_with};
use super::dense::DenseDictionary;
use super::path::Path;
use super::pursuit::{Solver, energy};
use super::referee::{BELIEVED, BELIEVED_ENERGY, DoubleReferee};
use super::{Backend, Dictionary, Limits, OmpError, Scalar, Solution, Stop, solve_batch};
use nalgebra::DMatrix;
use std::sync::OnceLock;

/// A dictionary in both precisions; the double one is prepared when it is first needed.
#[derive(Debug)]
pub struct MixedDictionary {
    single: DenseDictionary<f32>,
    exact: Exact,
}

/// A matrix for the measurements that single precision cannot decide.
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

    /// The dictionary, prepared when it is first needed.
    fn double(&self) -> &DenseDictionary<f64> {
        self.double.get_or_init(|| {
            let double = DenseDictionary::new(&self.matrix);
            if self.normalised { double } else { double.unnormalised() }
        })
    }

    /// Solves the `doubtful` ones of the measurements `y` again, on the processor.
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

    /// [`solve_batch`] on the processor, and for how many of the measurements double precision was asked.
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

    /// The pursuits in `f32`, refereed.
    fn solve_in_single<'y>(
        &self,
        limits: &Limits,
        y: &[f32],
        frame: &(impl Fn(usize) -> &'y [f64] + Sync),
    ) -> Result<Vec<Path<f32>>, OmpError> {
        let problem = Problem { dictionary: &self.single, limits: *limits };
        if self.exact.double.get().is_none() {
            // Double precision is prepared when somebody asks for it, and not by one thread while others wait.
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

/// Whether single precision may have decided what only double precision can: between two atoms, or whether it was the end.
fn is_doubtful(path: &Path<f32>, limits: &Limits, y: &[f32]) -> bool {
    let ended_by_rounding = matches!(path.stop, Stop::Dependent | Stop::NoAtomLeft);
    // Nobody looks at the residual once there are enough atoms.
    let looked = path.residual_norms.len() - usize::from(path.stop == Stop::Sparsity);
    let energy = energy(y);
    let enough = limits.enough(energy, y.len()) / energy;
    let close = |norm: &f64| (norm.powi(2) - enough).abs() < BELIEVED_ENERGY;
    path.least_lead < BELIEVED
        || ended_by_rounding
        || path.residual_norms[..looked].iter().any(close)
}
