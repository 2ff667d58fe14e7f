//! The readings as a constraint on a network's guesses: every sampler moves each guess into
//! agreement with the readings before the next step.

use rayon::prelude::*;

use super::AREA;
use crate::consistency::{Binding, Consistency, MeasuredRows, MeasuredRowsError};
use crate::estimate::Estimate;

/// The readings of a batch, and the camera's model for each image, made once for each batch.
pub(crate) struct DataConstraint<'a> {
    models: Vec<Consistency>,
    readings: &'a [f32],
    area: usize,
    binding: Binding,
}

impl<'a> DataConstraint<'a> {
    /// Readings (N, `side`, `side`) made from these Hadamard rows. A constraint that binds nothing
    /// still computes each image's inconsistency.
    ///
    /// # Errors
    /// [`MeasuredRowsError::OtherSide`] if the rows belong to readings of another side.
    pub(crate) fn new(
        readings: &'a [f32],
        side: usize,
        estimates: &[Estimate],
        measured: &MeasuredRows,
        binding: Binding,
    ) -> Result<Self, MeasuredRowsError> {
        let model = |e: &Estimate| Consistency::new(side, e.sigma_px, e.noise).of_rows(measured);
        let models = estimates.par_iter().map(model).collect::<Result<_, _>>()?;
        Ok(Self { models, readings, area: side * side, binding })
    }

    /// Clamps each guess of (N, 64, 64) to [0, 1] and moves it into agreement with its readings.
    pub(crate) fn correct(&self, guesses: &mut [f32]) {
        let images = guesses.par_chunks_exact_mut(AREA).enumerate();
        images.for_each(|(index, guess)| self.correct_one(index, guess));
    }

    /// Corrects the guess of image `index` alone.
    pub(crate) fn correct_one(&self, index: usize, guess: &mut [f32]) {
        self.models[index].agree(self.readings_of(index), guess, self.binding);
    }

    /// The inconsistency of each image of (N, 64, 64): its distance from the readings over their
    /// noise.
    pub(crate) fn residual_ratios(&self, images: &[f32]) -> Vec<f32> {
        let each = images.par_chunks_exact(AREA).zip(&self.models).enumerate();
        each.map(|(index, (image, model))| model.residual_ratio(self.readings_of(index), image))
            .collect()
    }

    /// The readings, (N, side, side).
    pub(crate) fn readings(&self) -> &'a [f32] {
        self.readings
    }

    fn readings_of(&self, index: usize) -> &[f32] {
        &self.readings[index * self.area..][..self.area]
    }
}
