//! What all samplers do to a network's guess of the sharp image before they go on from it.

use rayon::prelude::*;

use super::{AREA, Job};
use crate::consistency::Consistency;

/// What the guesses of a batch are held against.
pub(crate) struct Truth<'a> {
    models: Option<Vec<Consistency>>,
    readings: &'a [f32],
    area: usize,
}

impl<'a> Truth<'a> {
    pub(crate) fn new(job: &Job<'a>) -> Self {
        let models = job.consistency.then(|| {
            let model = |estimate: &crate::Estimate| {
                let measured = job.measured.cloned();
                Consistency::new(job.readings_side, estimate.sigma_px, estimate.noise, measured)
            };
            job.estimates.iter().map(model).collect()
        });
        Self { models, readings: job.readings, area: job.readings_side.pow(2) }
    }

    /// Puts each guess of (N, 64, 64) into [0, 1] and into agreement with its readings.
    pub(crate) fn correct(&self, guesses: &mut [f32]) {
        guesses.iter_mut().for_each(|value| *value = value.clamp(0.0, 1.0));
        let Some(models) = &self.models else { return };
        guesses
            .par_chunks_exact_mut(AREA)
            .zip(self.readings.par_chunks_exact(self.area))
            .zip(models)
            .for_each(|((guess, readings), model)| model.project(readings, guess));
        guesses.iter_mut().for_each(|value| *value = value.clamp(0.0, 1.0));
    }
}
