//! Methods for measurements of one kind: noise, prior, number of atoms or strength, trust, and the
//! weights of readings are found out once, on a [sample](SAMPLE) of them. Each measurement
//! then takes one prediction.

mod omp;
mod regularised;

pub(super) use omp::omp_kind;
pub(super) use regularised::regularised_kind;

use super::selection::Together;
use super::weight::KindWeights;
use super::{HeldBack, Made, Problem, ReconstructError};
use crate::{Measurements, Rows};
use rayon::prelude::*;

/// Whether long work goes on; [`ReconstructError::Stopped`] if the user has stopped it.
pub type GoingOn<'g> = &'g (dyn Fn() -> Result<(), ReconstructError> + Sync);

/// Measurements of a kind on which is found out what all have in common.
pub(super) const SAMPLE: usize = 9;

/// Some of a number of things, evenly chosen.
pub(super) fn sample(count: usize) -> impl Iterator<Item = usize> {
    let taken = count.min(SAMPLE);
    (0..taken).map(move |k| (2 * k + 1) * count / (2 * taken))
}

/// What the measurements of a kind have in common.
struct Common {
    trust: f32,
    weights: KindWeights,
    held_back: Option<HeldBack>,
}

impl Common {
    /// A prediction that is believed as it is.
    fn believed(rows: &Rows) -> Self {
        Self { trust: 1.0, weights: KindWeights::new(rows), held_back: None }
    }

    /// What the sample has in common; `with` predicts all rows from all measurements of a problem.
    fn new<E: Send>(
        some: &[Problem<'_>],
        chosen: &Together,
        with: impl Fn(&Problem<'_>) -> Result<Vec<f32>, E> + Send + Sync,
    ) -> Result<Self, E> {
        let trust = chosen.trust;
        let mut weights = KindWeights::new(some[0].rows);
        let predicted: Vec<Vec<f32>> = some.par_iter().map(with).collect::<Result<_, _>>()?;
        for ((problem, without), with) in some.iter().zip(&chosen.held_back).zip(&predicted) {
            let noise = problem.reading_noise();
            weights.add(
                |k| (problem.values[k], noise),
                |k| trust * without[k],
                |k| trust * with[problem.rows[k] as usize],
            );
        }
        let judged = some.iter().zip(&chosen.held_back);
        let judged: Vec<_> = judged.filter_map(|(p, held)| p.judge(Some(held), trust)).collect();
        Ok(Self { trust, weights, held_back: HeldBack::mean(&judged) })
    }

    /// The image of one measurement and of a prediction that was made with its readings.
    fn made(&self, problem: &Problem<'_>, mut predicted: Vec<f32>) -> Made {
        predicted.iter_mut().for_each(|value| *value *= self.trust);
        let noise = problem.reading_noise();
        let reading_weight =
            self.weights.weigh(problem.rows, |k| (problem.values[k], noise), &mut predicted);
        Made { reading_weight, ..Made::of_prediction(problem, predicted) }
    }
}

/// The problems of a sample of a kind.
fn problems<'m>(
    measurements: &'m [Measurements],
    problem: impl Fn(&'m Measurements) -> Problem<'m> + Sync,
) -> Vec<Problem<'m>> {
    let some: Vec<usize> = sample(measurements.len()).collect();
    some.into_par_iter().map(|k| problem(&measurements[k])).collect()
}
