//! Pursues many measurements of one dictionary, or one, on a [`Backend`] chosen at run time.

use super::batch::{Problem, check, solve_batch_paths};
use super::dictionary::Dictionary;
use super::path::Path;
use super::pursuit::Solver;
use super::scalar::Scalar;
use super::{Backend, Limits, OmpError, Solution};

/// Finds a sparse representation of each measurement in `y`. Each measurement has `measurements`
/// numbers; one follows the other.
///
/// [`Backend::Auto`] is the processor here, because a GPU would need the dictionary's Gram matrix
/// for this one call. For many batches of one matrix, keep a `gpu::DeviceDictionary`.
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
                return super::gpu::solve_batch_over(&device, *dictionary, limits, y);
            }
            Err(super::BackendError::not_built().into())
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
    Err(super::BackendError::not_built().into())
}
