//! OMP of a kind: one pursuit for each measurement, over a dictionary that all share.

use super::{Common, GoingOn, problems};
use crate::Measurements;
use crate::omp::sampled::{Prior, SampledHadamard};
use crate::omp::{self, Backend, Limits, Remembered, StackSolver};
use crate::reconstruct::{
    ComputedBy, Made, OmpReconstruction, OmpSettings, Problem, ReconstructError, Sparsity,
    in_units, selection,
};
use rayon::prelude::*;
use std::sync::Arc;

/// Measurements that are pursued at a time: enough for all processors, few enough for the memory, and for a device more.
const AT_A_TIME: usize = 256;
const AT_A_TIME_ON_DEVICE: usize = 4096;

/// The images of measurements of one kind; `None` if these settings have to look at each by itself.
pub(in super::super) fn omp_kind(
    measurements: &[Measurements],
    settings: &OmpSettings,
    going_on: GoingOn<'_>,
) -> Result<Option<Vec<OmpReconstruction>>, ReconstructError> {
    settings.check()?;
    if settings.non_negative || settings.sparsity == Sparsity::Noise {
        return Ok(None);
    }
    let some = problems(measurements, |measured| Problem::new(measured, settings));
    let Some(first) = some.first() else { return Ok(Some(Vec::new())) };
    let (atoms, common) = match settings.sparsity {
        Sparsity::Fixed(atoms) => (atoms, Common::believed(first.rows)),
        Sparsity::CrossValidated { most, folds } => {
            let tried = selection::sparsities(first.rows.len(), most);
            let trusted = selection::OMP_TRUSTED;
            let predict =
                |problem: &Problem<'_>, kept: &[usize]| selection::predict(problem, kept, &tried);
            let chosen = selection::choose_together(&some, tried.len(), folds, trusted, predict)?;
            let Some(chosen) = chosen else { return Ok(None) };
            let atoms = tried[chosen.at];
            let every: Vec<usize> = (0..first.rows.len()).collect();
            let with = |problem: &Problem<'_>| {
                Ok::<_, ReconstructError>(selection::predict(problem, &every, &[atoms])?.remove(0))
            };
            (atoms, Common::new(&some, &chosen, with)?)
        }
        Sparsity::Noise => return Ok(None),
    };
    let prior = mean_prior(&some);
    let plain = SampledHadamard::new(&first.transform, first.rows, &prior);
    let dictionary = Remembered::new(plain);
    let limits = Limits { sparsity: atoms, ..first.limits() };
    let pursuit = omp::Problem { dictionary: &dictionary, limits };
    let mut solver = StackSolver::new(&pursuit, settings.backend, measurements.len())?;
    let mut made: Vec<OmpReconstruction> = Vec::with_capacity(measurements.len());
    while made.len() < measurements.len() {
        let most = if solver.turns().has_device() { AT_A_TIME_ON_DEVICE } else { AT_A_TIME };
        let together = &measurements[made.len()..];
        let together = &together[..most.min(together.len())];
        together.iter().try_for_each(|_| going_on())?;
        let values: Vec<f32> =
            together.par_iter().flat_map_iter(|measured| in_units(measured).0).collect();
        let (solutions, on_device) = solver.solve(&values)?;
        let said = solver.turns().said().cloned();
        let device = solver.backend().map(|backend| (backend, Arc::clone(solver.turns().device())));
        let by = [
            ComputedBy { backend: Backend::Cpu, device: None, said: said.clone() },
            device.map_or(ComputedBy::default(), |(backend, name)| ComputedBy {
                backend,
                device: Some(name),
                said,
            }),
        ];
        let images = together.par_iter().zip(solutions).enumerate().map_init(
            || first.clone(),
            |problem, (at, (measured, solution))| {
                problem.read(measured, settings.noise);
                let predicted =
                    dictionary.dictionary().predict(&solution.support, &solution.coefficients);
                let found = match settings.exactly_sparse {
                    true => Made::of_prediction(problem, predicted),
                    false => common.made(problem, predicted),
                };
                let by = Some(by[usize::from(at < on_device)].clone());
                OmpReconstruction { by, ..reconstruction(problem, &solution, found, &common) }
            },
        );
        made.par_extend(images);
    }
    Ok(Some(made))
}

fn reconstruction(
    problem: &Problem<'_>,
    solution: &omp::Solution,
    made: Made,
    common: &Common,
) -> OmpReconstruction {
    OmpReconstruction {
        image: made.image,
        sparsity: solution.support.len(),
        stop: solution.stop,
        residual: made.residual,
        reading_weight: made.reading_weight,
        held_back: common.held_back,
        unseen_atoms: solution.unseen.len(),
        trust: f64::from(common.trust),
        noise: problem.noise_in_units(),
        by: None,
    }
}

/// The mean of the sample's priors, each in units of its own largest measurement.
fn mean_prior(some: &[Problem<'_>]) -> Prior {
    let share = 1.0 / some.len() as f32;
    let mut mean =
        Prior { scale: vec![0.0; some[0].prior.scale.len()], noise: 0.0, ..some[0].prior };
    for Problem { prior, .. } in some {
        mean.noise += share * prior.noise;
        mean.scale.iter_mut().zip(&prior.scale).for_each(|(mean, scale)| *mean += share * scale);
    }
    mean
}
