//! Pursues many measurements of one dictionary, or one, on a [`Backend`] chosen at run time.

use super::backend::{Failure, Turns};
use super::batch::{Problem, check, solve_batch_paths};
use super::dictionary::Dictionary;
use super::path::Path;
use super::pursuit::Solver;
use super::scalar::Scalar;
use super::{Backend, BackendError, Limits, OmpError, Solution};
use std::marker::PhantomData;
use std::ops::Range;

/// Finds a sparse representation of each measurement in `y`. Each measurement has `measurements`
/// numbers; one follows the other.
///
/// [`Backend::Auto`] is the processor here, because a GPU would need the dictionary's Gram matrix
/// for this one call. For many batches keep a [`StackSolver`], or of one matrix a
/// `gpu::DeviceDictionary`.
///
/// # Errors
/// [`OmpError`] if the length of `y` is not a multiple of the dictionary's measurements, a number
/// is not finite, a limit is negative or NaN, or the requested device is missing.
pub fn solve_batch<T: Scalar, D: Dictionary<T> + ?Sized>(
    problem: &Problem<'_, D>,
    y: &[T],
    backend: Backend,
) -> Result<Vec<Solution>, OmpError> {
    match backend {
        Backend::Auto | Backend::Cpu => {
            Ok(solve_batch_paths(problem, y)?.into_iter().map(Path::solution).collect())
        }
        Backend::Wgpu | Backend::Cuda => {
            check(problem, y)?;
            #[cfg(feature = "gpu")]
            if let Some(device) = super::gpu::Device::open(backend)? {
                let Problem { dictionary, limits } = problem;
                return super::gpu::OverDevice::new(&device, *dictionary)?.solve(limits, y);
            }
            Err(BackendError::not_built().into())
        }
    }
}

/// Pursues one measurement, with a solution for every number of atoms. [`Backend::Auto`] is the
/// processor, because the processor finishes before a GPU has received the Gram matrix.
///
/// # Errors
/// [`OmpError`] if `y` does not fit the dictionary or is not finite, a limit is negative or NaN, or
/// the requested device is missing.
pub fn solve_path<D: Dictionary<f32> + ?Sized>(
    dictionary: &D,
    limits: &Limits,
    y: &[f32],
    backend: Backend,
) -> Result<Path<f32>, OmpError> {
    let (Backend::Wgpu | Backend::Cuda) = backend else {
        return Solver::new(dictionary, limits)?.solve(y);
    };
    #[cfg(feature = "gpu")]
    if let Some(device) = super::gpu::Device::open(backend)? {
        return super::gpu::path_over(&device, dictionary, limits, y);
    }
    Err(BackendError::not_built().into())
}

impl Failure for OmpError {
    fn is_of_device(&self) -> bool {
        matches!(self, Self::Backend(BackendError::Failed(_) | BackendError::TooLarge { .. }))
    }
}

/// Pursues batch after batch of one problem. A device that fails in the middle gets smaller batches, and then the processor
/// takes over ([`Turns`]). The dictionary's Gram matrix goes to a device once.
pub struct StackSolver<'p, T, D: ?Sized> {
    problem: &'p Problem<'p, D>,
    turns: Turns,
    #[cfg(feature = "gpu")]
    device: Option<(Backend, super::gpu::OverDevice<'p, D>)>,
    of: PhantomData<T>,
}

impl<'p, T: Scalar, D: Dictionary<T> + ?Sized> StackSolver<'p, T, D> {
    /// A solver for stacks of this many measurements. [`Backend::Auto`] takes a GPU, if there is one, if that is faster
    /// than the processor with the first measurements.
    ///
    /// # Errors
    /// [`OmpError`] if the requested device is missing.
    #[cfg(feature = "gpu")]
    pub fn new(
        problem: &'p Problem<'p, D>,
        backend: Backend,
        measurements: usize,
    ) -> Result<Self, OmpError> {
        use super::gpu::{Choice, OverDevice, choose};
        let Choice::Gpu(device) = choose(backend, measurements)? else {
            return Ok(Self {
                problem,
                turns: Turns::of_processor(),
                device: None,
                of: PhantomData,
            });
        };
        let (turns, device) = match OverDevice::new::<T>(&device, problem.dictionary) {
            Ok(over) => {
                let turns = match backend {
                    Backend::Auto => Turns::by_time(device.name()),
                    _ => Turns::on_device(device.name()),
                };
                (turns, Some((device.backend(), over)))
            }
            Err(error) if error.is_of_device() => {
                (Turns::without(device.name(), &error.to_string()), None)
            }
            Err(error) => return Err(error),
        };
        Ok(Self { problem, turns, device, of: PhantomData })
    }

    /// A solver for stacks of measurements, on the processor.
    ///
    /// # Errors
    /// [`OmpError`] for a GPU: this build has none.
    #[cfg(not(feature = "gpu"))]
    pub fn new(
        problem: &'p Problem<'p, D>,
        backend: Backend,
        _measurements: usize,
    ) -> Result<Self, OmpError> {
        match backend {
            Backend::Auto | Backend::Cpu => {
                Ok(Self { problem, turns: Turns::of_processor(), of: PhantomData })
            }
            Backend::Wgpu | Backend::Cuda => Err(BackendError::not_built().into()),
        }
    }

    /// Who computes.
    #[must_use]
    pub fn turns(&self) -> &Turns {
        &self.turns
    }

    /// The backend of the device, if there is one.
    #[must_use]
    pub fn backend(&self) -> Option<Backend> {
        #[cfg(feature = "gpu")]
        return self.device.as_ref().map(|(backend, _)| *backend);
        #[cfg(not(feature = "gpu"))]
        return None;
    }

    /// Finds a sparse representation of each measurement in `y`, as [`solve_batch`] does, and says how many of them, the first
    /// ones, a device has found.
    ///
    /// # Errors
    /// [`OmpError`] if `y` does not fit the dictionary or is not finite, or a limit is negative or NaN.
    pub fn solve(&mut self, y: &[T]) -> Result<(Vec<Solution>, usize), OmpError> {
        let problem = self.problem;
        check(problem, y)?;
        let values = problem.dictionary.measurements();
        let of = |items: Range<usize>| &y[items.start * values..items.end * values];
        let processor = |items: Range<usize>| {
            let paths = solve_batch_paths(problem, of(items))?;
            Ok::<Vec<Solution>, OmpError>(paths.into_iter().map(Path::solution).collect())
        };
        #[cfg(feature = "gpu")]
        if let Some((_, device)) = &self.device {
            let device = |items: Range<usize>| device.solve(&problem.limits, of(items));
            return self.turns.work(y.len() / values, device, processor);
        }
        Ok((processor(0..y.len() / values)?, 0))
    }
}
