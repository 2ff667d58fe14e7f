//! Stacks of images on the processor.

use super::{Estimator, Fsrcnn, UNet};
use crate::network::{RunEstimator, RunFsrcnn, RunUNet};
use crate::schema::Conditions;
use rayon::prelude::*;

/// A network on the processor: one image for each core, or all cores on one image.
pub(crate) struct OnCpu<M>(pub(crate) M);

impl RunUNet for OnCpu<UNet> {
    fn run(
        &self,
        side: usize,
        current: &[f32],
        degraded: &[f32],
        conditions: &[Conditions],
    ) -> Vec<f32> {
        let area = side * side;
        let images = current.par_chunks_exact(area).zip(degraded.par_chunks_exact(area));
        let sharp = images.zip(conditions).map(|((current, degraded), conditions)| {
            self.0.forward(current, degraded, (side, side), conditions)
        });
        sharp.collect::<Vec<_>>().concat()
    }
}

impl RunEstimator for OnCpu<Estimator> {
    fn run(&self, side: usize, images: &[f32]) -> Vec<[f32; 2]> {
        let images = images.par_chunks_exact(side * side);
        images.map(|image| self.0.forward(image, (side, side))).collect()
    }
}

impl RunFsrcnn for OnCpu<Fsrcnn> {
    fn run(&self, side: usize, input: &[f32]) -> Vec<f32> {
        let inputs = input.par_chunks_exact(3 * side * side);
        inputs.map(|input| self.0.forward(input, (side, side))).collect::<Vec<_>>().concat()
    }
}
