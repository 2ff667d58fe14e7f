//! Estimator, FSRCNN, one step of the bridge and the agreement with the readings, one after another,
//! for images that are already on the device.
//!
//! No data comes to the host between the images and the results; one read at the end fetches all
//! results (`tests::images_that_are_there_become_what_the_processor_makes_of_them`
//! checks the results).

use super::Options;
use crate::consistency;
use crate::device::Device;
use crate::estimate::{Estimate, KnownEstimate};
use crate::fusion;
use crate::gpu::{Estimator, Fsrcnn, UNet};
use crate::grid::FINE as SIDE;
use crate::note::{Note, Notes};
use crate::weights::{Weights, WeightsError};
use nirspi_gpu::agreement::Agreement;
use nirspi_gpu::limits::DeviceLimits;
use nirspi_gpu::network::Degraded;
use nirspi_gpu::network::plan::frames_at_once;
use nirspi_gpu::{Buffer, GpuError, Kernels};
use nirspi_recon::omp::gpu::DeviceImages;
use std::ops::Range;
use std::sync::Arc;

/// The results for some images, on the host.
#[derive(Default)]
pub(super) struct Guess {
    /// As the estimator found them.
    pub(super) estimated: Vec<Estimate>,
    /// (N, 64, 64) in [0, 1]: FSRCNN's output.
    pub(super) start: Vec<f32>,
    /// (N, 64, 64): the bridge's output after one step from `start`; not clamped if there are
    /// `readings`, else in agreement with them.
    pub(super) images: Vec<f32>,
    /// The inconsistency of each image; none if there are `readings`.
    pub(super) inconsistency: Vec<f32>,
    /// (N, 32, 32) in [0, 1], if the device could not compute the agreement with them.
    pub(super) readings: Vec<f32>,
}

impl Guess {
    /// No results yet, and room for images with this number of pixels in all.
    fn with_capacity(pixels: usize) -> Self {
        let [start, images] = [(); 2].map(|()| Vec::with_capacity(pixels));
        Self { start, images, ..Self::default() }
    }
}

/// The three networks on one device.
pub(super) struct Chain {
    engine: Arc<dyn Kernels>,
    fsrcnn: Fsrcnn,
    estimator: Estimator,
    unet: UNet,
    notes: Notes,
    /// What the device allows for the agreement.
    pub(super) limits: DeviceLimits,
}

impl Chain {
    /// Uploads the networks with these weights to a device.
    ///
    /// # Errors
    /// [`WeightsError`] if a tensor is missing, of another shape, not finite, unknown, or too wide.
    pub(super) fn new(
        device: &Device,
        engine: &Arc<dyn Kernels>,
        [fsrcnn, estimator, bridge]: [&Weights; 3],
    ) -> Result<Self, WeightsError> {
        let multiplier = device.multiplier(engine.as_ref());
        Ok(Self {
            engine: Arc::clone(engine),
            fsrcnn: Fsrcnn::new(engine, fsrcnn)?,
            estimator: Estimator::new(engine, estimator)?,
            unet: UNet::new(engine, bridge, multiplier)?.compared(),
            notes: device.shared_notes(),
            limits: engine.limits(),
        })
    }

    /// Appends the results for `frames` images, beginning with number `first`.
    fn part(
        &self,
        images: &Buffer,
        (first, frames): (usize, usize),
        white: f32,
        depth: &[f32],
        (known, agreement): (KnownEstimate, Option<&Agreement>),
        all: &mut Guess,
    ) -> Result<(), GpuError> {
        let on = self.engine.as_ref();
        let (coarse, area) = ((frames, fusion::SIDE), fusion::SIDE * fusion::SIDE);
        let readings = on.readings(images, first * area, white, frames * area);
        let outputs = self.estimator.forward(coarse, &readings);
        let depth = (!depth.is_empty()).then(|| on.upload(depth));
        let start = self.fsrcnn.forward(coarse, &readings, depth.as_ref(), true);
        // One step of the bridge, from t = 1 to its end.
        let bounds = known.condition_bounds([1.0, 1.0]);
        let grid = (SIDE / fusion::SIDE) as f32;
        let conditions = on.conditions(&outputs, &bounds, grid);
        let seen = Degraded::Coarse(&readings);
        let size = (frames, SIDE);
        let sharp = || self.unet.forward(size, &start, seen, &conditions, Some(&start));
        let read = match agreement {
            Some(agreement) => self.unet.read_after(|| {
                let agreed = on.agree(agreement, &readings, &sharp(), &outputs, frames);
                [outputs.clone(), start.clone(), agreed.images, agreed.ratios]
            }),
            None => {
                self.unet.read_after(|| [outputs.clone(), start.clone(), sharp(), readings.clone()])
            }
        };
        let [outputs, start, images, last] = read?;
        let each = outputs.floats().as_chunks().0.iter();
        all.estimated.extend(each.map(|&two| Estimate::of_outputs(two, fusion::SIDE)));
        all.start.extend_from_slice(start.floats());
        all.images.extend_from_slice(images.floats());
        let rest = if agreement.is_some() { &mut all.inconsistency } else { &mut all.readings };
        rest.extend_from_slice(last.floats());
        Ok(())
    }

    /// The results for some of the images, with `white` scaled to 1. `depth` is (N, 2, 32, 32), see
    /// [`push_planes`](crate::fusion::push_planes); empty without depth.
    ///
    /// # Errors
    /// [`GpuError`] if the GPU or its driver fails.
    pub(super) fn run(
        &self,
        images: &DeviceImages,
        part: Range<usize>,
        white: f32,
        depth: &[f32],
        options: &Options,
    ) -> Result<Guess, GpuError> {
        let images = images.buffer();
        let coarse = self.fsrcnn.at_once(fusion::SIDE).min(self.estimator.at_once(fusion::SIDE));
        let at_once = self.unet.at_once(SIDE).min(coarse);
        let on = self.engine.as_ref();
        let Options { measured, consistency, estimate, .. } = options;
        let agreement = consistency::agreement(on, &self.limits, measured, *consistency, *estimate);
        let agreement = agreement
            .map_err(|error| self.notes.add(Note::AgreementOnCpu { why: error.to_string() }))
            .ok();
        let scratch = agreement.as_ref().map_or(0, Agreement::scratch);
        let at_once = frames_at_once(scratch, on.limits().buffer_bytes, at_once);
        let planes = 2 * fusion::SIDE * fusion::SIDE;
        let area = SIDE * SIDE;
        let mut all = Guess::with_capacity(part.len() * area);
        for first in part.clone().step_by(at_once) {
            let frames = at_once.min(part.end - first);
            let depth = match depth {
                [] => &[],
                _ => &depth[(first - part.start) * planes..][..frames * planes],
            };
            let known = (options.estimate, agreement.as_ref());
            self.part(images, (first, frames), white, depth, known, &mut all)?;
        }
        Ok(all)
    }
}
