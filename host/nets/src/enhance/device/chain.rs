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
use nirspi_gpu::{Buffer, GpuError, Kernels, Numbers};
use nirspi_recon::omp::gpu::DeviceImages;
use std::sync::Arc;

/// Images to enhance.
#[derive(Clone, Copy)]
pub(super) enum Source<'a> {
    /// On the device, as OMP left them.
    There(&'a DeviceImages),
    /// In the host's memory, (N, 32, 32) in [0, 1].
    Here(&'a [f32]),
}

impl Source<'_> {
    /// Number of images.
    pub(super) fn frames(&self) -> usize {
        match self {
            Self::There(images) => images.frames(),
            Self::Here(values) => values.len() / (fusion::SIDE * fusion::SIDE),
        }
    }

    /// The images from number `first` on, divided by `white` and clamped to [0, 1].
    fn readings(&self, on: &dyn Kernels, (first, frames): (usize, usize), white: f32) -> Buffer {
        let area = fusion::SIDE * fusion::SIDE;
        let (first, count) = (first * area, frames * area);
        match self {
            Self::There(images) => on.readings(images.buffer(), first, white, count),
            Self::Here(values) => {
                on.readings(&on.upload(&values[first..][..count]), 0, white, count)
            }
        }
    }
}

/// Where the results for some images go: a slice of the results for all of them.
#[derive(Default)]
pub(super) struct Room<'a> {
    /// As the estimator found them.
    pub(super) estimated: &'a mut [Estimate],
    /// (N, 64, 64) in [0, 1]: FSRCNN's output.
    pub(super) start: &'a mut [f32],
    /// (N, 64, 64): the bridge's output after one step from `start`; not clamped if the device
    /// could not compute the agreement with the readings, else in agreement with them.
    pub(super) images: &'a mut [f32],
    /// The inconsistency of each image, if the device computed the agreement.
    pub(super) inconsistency: &'a mut [f32],
}

impl<'a> Room<'a> {
    /// Number of images.
    pub(super) fn frames(&self) -> usize {
        self.estimated.len()
    }

    /// The same room, lent.
    pub(super) fn reborrow(&mut self) -> Room<'_> {
        let Self { estimated, start, images, inconsistency } = self;
        Room { estimated, start, images, inconsistency }
    }

    /// Takes the room of the first `frames` images.
    pub(super) fn take(&mut self, frames: usize) -> Room<'a> {
        fn first<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
            rest.split_off_mut(..count).unwrap_or_default()
        }
        let pixels = frames * SIDE * SIDE;
        Room {
            estimated: first(&mut self.estimated, frames),
            start: first(&mut self.start, pixels),
            images: first(&mut self.images, pixels),
            inconsistency: first(&mut self.inconsistency, frames),
        }
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

    /// Computes `part`, whose first image has the number `first`. What is returned are the readings,
    /// (N, 32, 32) in [0, 1], if the device did not compute the agreement with them.
    fn part(
        &self,
        images: Source<'_>,
        (first, white): (usize, f32),
        depth: &[f32],
        (known, agreement): (KnownEstimate, Option<&Agreement>),
        part: Room<'_>,
    ) -> Result<Option<Numbers>, GpuError> {
        let on = self.engine.as_ref();
        let frames = part.frames();
        let coarse = (frames, fusion::SIDE);
        let readings = images.readings(on, (first, frames), white);
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
        for (to, &two) in part.estimated.iter_mut().zip(each) {
            *to = Estimate::of_outputs(two, fusion::SIDE);
        }
        part.start.copy_from_slice(start.floats());
        part.images.copy_from_slice(images.floats());
        if agreement.is_none() {
            return Ok(Some(last));
        }
        part.inconsistency.copy_from_slice(last.floats());
        Ok(None)
    }

    /// Computes the results for the images from number `first` on, with `white` scaled to 1, into
    /// `room`. `depth` is (N, 2, 32, 32), see [`push_planes`](crate::fusion::push_planes); empty
    /// without depth. What is returned are the readings, (N, 32, 32) in [0, 1], if the device could
    /// not compute the agreement with them, else nothing.
    ///
    /// # Errors
    /// [`GpuError`] if the GPU or its driver fails.
    pub(super) fn run(
        &self,
        images: Source<'_>,
        (first, white): (usize, f32),
        depth: &[f32],
        options: &Options,
        mut room: Room<'_>,
    ) -> Result<Vec<f32>, GpuError> {
        let coarse = self.fsrcnn.at_once(fusion::SIDE).min(self.estimator.at_once(fusion::SIDE));
        let at_once = self.unet.at_once(SIDE).min(coarse);
        let on = self.engine.as_ref();
        let Options { measured, estimate, .. } = options;
        let agreement =
            consistency::agreement(on, &self.limits, measured, options.binding(), *estimate);
        let agreement = agreement
            .map_err(|error| self.notes.add(Note::AgreementOnCpu { why: error.to_string() }))
            .ok();
        let scratch = agreement.as_ref().map_or(0, Agreement::scratch);
        let at_once = frames_at_once(scratch, on.limits().buffer_bytes, at_once);
        let planes = 2 * fusion::SIDE * fusion::SIDE;
        let mut readings = Vec::new();
        for done in (0..room.frames()).step_by(at_once) {
            let part = room.take(at_once.min(room.frames()));
            let depth = match depth {
                [] => &[],
                _ => &depth[done * planes..][..part.frames() * planes],
            };
            let known = (*estimate, agreement.as_ref());
            let left = self.part(images, (first + done, white), depth, known, part)?;
            readings.extend(left.iter().flat_map(Numbers::floats));
        }
        Ok(readings)
    }
}
