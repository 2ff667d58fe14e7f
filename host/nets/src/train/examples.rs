//! Batches for training and for judging.
//!
//! # Invariant
//! Example k of a run is the same in every batch and on every machine
//! (`tests::examples_are_the_same_in_whatever_batches_they_come`).

use super::TrainError;
use super::tensors::images;
use crate::data::{AREA_PX, Part, Purpose, SIDE_PX, Scenes, stream};
use crate::degrade::{DEPTH_SIDE, Degrade, Depth, READING_PX};
use crate::fusion::push_zones;
use crate::model::{Fsrcnn, FsrcnnConfig, fill};
use crate::upscale::upscale_2x;
use crate::weights::Weights;
use burn::backend::Flex;
use burn::backend::flex::FlexDevice;
use rand::RngExt;
use rand_distr::StandardNormal;
use rayon::prelude::*;

/// Number of pixels of a reading.
pub(super) const READING_AREA: usize = READING_PX * READING_PX;

/// Enlarges readings of 32 x 32 to images of 64 x 64, the deblurrer's input.
pub trait Enlarge: Sync {
    /// `readings` has n images of 32 x 32, one after another; `depth` has one map, or `None`, for
    /// each. Returns n images of 64 x 64 in `[0, 1]`.
    ///
    /// # Errors
    /// [`TrainError`] if the readings are not such images.
    fn enlarge(&self, readings: &[f32], depth: &[Option<Depth>]) -> Result<Vec<f32>, TrainError>;
}

/// Enlarges by Lanczos interpolation, without learning.
#[derive(Debug, Clone, Copy, Default)]
pub struct Lanczos;

impl Enlarge for Lanczos {
    fn enlarge(&self, readings: &[f32], depth: &[Option<Depth>]) -> Result<Vec<f32>, TrainError> {
        upscale_2x(readings, depth.len(), READING_PX, READING_PX).map_err(|error| {
            TrainError::Setting {
                name: "reading",
                found: error.to_string(),
                expected: "32 x 32 in [0, 1]",
            }
        })
    }
}

/// Enlarges by a trained FSRCNN, as in use.
pub struct Fused {
    network: Fsrcnn<Flex>,
}

impl Fused {
    /// The network with these weights, on the CPU.
    ///
    /// # Errors
    /// [`TrainError::Weights`] if the weights belong to another network.
    pub fn new(weights: &Weights) -> Result<Self, TrainError> {
        weights.expect_model("fsrcnn")?;
        let network = FsrcnnConfig::of(weights)?.init(&FlexDevice);
        Ok(Self { network: fill(network, weights)? })
    }
}

impl Enlarge for Fused {
    fn enlarge(&self, readings: &[f32], depth: &[Option<Depth>]) -> Result<Vec<f32>, TrainError> {
        let input = images(&fusion_input(readings, depth), 3, READING_PX, &FlexDevice);
        let image = self.network.forward(input).clamp(0.0, 1.0);
        Ok(image.into_data().convert::<f32>().iter::<f32>().collect())
    }
}

/// A batch of examples, image after image.
#[derive(Debug, Clone, PartialEq)]
pub struct Batch {
    /// Number of examples.
    pub count: usize,
    /// Sharp scenes, 64 x 64 each.
    pub truth: Vec<f32>,
    /// Scenes after the optics, 64 x 64.
    pub optical: Vec<f32>,
    /// Readings of the camera, 32 x 32.
    pub readings: Vec<f32>,
    /// Depth of each example.
    pub depth: Vec<Option<Depth>>,
    /// The deblurrer's input, 64 x 64: enlarged readings or, for `fine` examples, images that have
    /// this size from the start.
    pub degraded: Vec<f32>,
    /// Whether the example is `fine`.
    pub fine: Vec<bool>,
    /// Blur in pixels of the 64 x 64 grid.
    pub sigma_px: Vec<f32>,
    /// Noise of the readings.
    pub noise_std: Vec<f32>,
    /// Class, if it is known.
    pub label: Vec<Option<u8>>,
}

impl Batch {
    /// FSRCNN's input, (count, 3, 32, 32): intensity, depth over 3 m, validity of the depth.
    #[must_use]
    pub fn fusion_input(&self) -> Vec<f32> {
        fusion_input(&self.readings, &self.depth)
    }

    /// The readings on the 64 x 64 grid: each pixel of a reading is repeated four times; `fine`
    /// images stay as they are. The deblurrer gets these beside the image that it works on.
    #[must_use]
    pub fn raw(&self) -> Vec<f32> {
        let mut raw = self.degraded.clone();
        let readings = self.readings.chunks_exact(READING_AREA);
        let coarse =
            raw.chunks_exact_mut(AREA_PX).zip(readings).zip(&self.fine).filter(|(_, fine)| !**fine);
        for ((image, reading), _) in coarse {
            for (at, value) in image.iter_mut().enumerate() {
                *value = reading[at / SIDE_PX / 2 * READING_PX + at % SIDE_PX / 2];
            }
        }
        raw
    }
}

/// FSRCNN's input for these readings, (count, 3, 32, 32), built by the functions of
/// [`Fusion`](crate::Fusion): intensity, depth over 3 m, validity of the depth.
#[must_use]
pub fn fusion_input(readings: &[f32], depth: &[Option<Depth>]) -> Vec<f32> {
    let mut input = Vec::with_capacity(3 * readings.len());
    for (reading, depth) in readings.chunks_exact(READING_AREA).zip(depth) {
        input.extend_from_slice(reading);
        let zone_m = |zone: usize| {
            let depth = depth.as_ref()?;
            depth.valid[zone].then_some(depth.metres[zone])
        };
        push_zones(DEPTH_SIDE, zone_m, &mut input);
    }
    input
}

/// The source of examples.
pub struct Examples<'a> {
    /// Sharp scenes.
    pub scenes: &'a Scenes,
    /// The camera.
    pub degrade: &'a dyn Degrade,
    /// Enlarges readings from 32 x 32 to 64 x 64.
    pub enlarge: &'a dyn Enlarge,
    /// Share of the examples whose degraded image has 64 x 64 pixels from the start, like the input
    /// of `deblur`.
    pub fine: f32,
    /// Seed of the run.
    pub seed: u64,
}

impl Examples<'_> {
    /// Examples `first` to `first + count` of one part of the split.
    ///
    /// # Errors
    /// [`TrainError`] if a scene cannot be degraded.
    pub fn batch(&self, part: Part, first: u64, count: usize) -> Result<Batch, TrainError> {
        let purpose = match part {
            Part::Training => Purpose::Training,
            Part::HeldOut => Purpose::HeldOut,
        };
        let made = (first..first + count as u64)
            .into_par_iter()
            .map(|index| {
                let mut rng = stream(self.seed, purpose, index);
                let scene = self.scenes.draw(part, &mut rng);
                let reading = self.degrade.degrade(&scene.image, &mut rng)?;
                let fine = (rng.random::<f32>() < self.fine).then(|| {
                    let mut noisy = |v: &f32| {
                        let normal: f32 = rng.sample(StandardNormal);
                        (v + reading.noise_std * normal).clamp(0.0, 1.0)
                    };
                    reading.optical.iter().map(&mut noisy).collect::<Vec<f32>>()
                });
                Ok((scene, reading, fine))
            })
            .collect::<Result<Vec<_>, TrainError>>()?;

        let mut batch = Batch {
            count,
            truth: Vec::with_capacity(count * AREA_PX),
            optical: Vec::with_capacity(count * AREA_PX),
            readings: Vec::with_capacity(count * READING_AREA),
            depth: Vec::with_capacity(count),
            degraded: Vec::new(),
            fine: Vec::with_capacity(count),
            sigma_px: Vec::with_capacity(count),
            noise_std: Vec::with_capacity(count),
            label: Vec::with_capacity(count),
        };
        let mut of_64 = Vec::with_capacity(count);
        for (scene, reading, fine) in made {
            batch.truth.extend(scene.image);
            batch.optical.extend(reading.optical);
            batch.readings.extend(reading.image);
            batch.depth.push(reading.depth);
            batch.sigma_px.push(reading.sigma_px);
            batch.noise_std.push(reading.noise_std);
            batch.label.push(scene.label);
            batch.fine.push(fine.is_some());
            of_64.push(fine);
        }
        batch.degraded = self.enlarge.enlarge(&batch.readings, &batch.depth)?;
        for (image, fine) in batch.degraded.chunks_exact_mut(SIDE_PX * SIDE_PX).zip(of_64) {
            if let Some(fine) = fine {
                image.copy_from_slice(&fine);
            }
        }
        Ok(batch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::degrade::{AnalyticCamera, Limits};
    use crate::fusion::{DepthMaps, push_planes};

    #[test]
    fn examples_are_the_same_in_whatever_batches_they_come() {
        let camera = AnalyticCamera::new(Limits::default()).unwrap();
        let scenes = Scenes::procedural();
        let examples =
            Examples { scenes: &scenes, degrade: &camera, enlarge: &Lanczos, fine: 0.3, seed: 3 };
        let all = examples.batch(Part::Training, 0, 6).unwrap();
        let tail = examples.batch(Part::Training, 4, 2).unwrap();
        assert_eq!(all.truth[4 * AREA_PX..], tail.truth);
        assert_eq!(all.degraded[4 * AREA_PX..], tail.degraded);
        assert_eq!(all.depth[4..], tail.depth);
        assert_ne!(examples.batch(Part::HeldOut, 4, 2).unwrap().truth, tail.truth);
    }

    #[test]
    fn raw_is_the_reading_four_times_or_the_image_itself() {
        let camera = AnalyticCamera::new(Limits::default()).unwrap();
        let scenes = Scenes::procedural();
        let of = |fine| {
            let examples =
                Examples { scenes: &scenes, degrade: &camera, enlarge: &Lanczos, fine, seed: 3 };
            examples.batch(Part::Training, 0, 2).unwrap()
        };
        let coarse = of(0.0);
        assert_eq!(coarse.raw()[AREA_PX + 65], coarse.readings[READING_AREA]);
        assert_eq!(coarse.raw()[AREA_PX - 1], coarse.readings[READING_AREA - 1]);
        assert_eq!(of(1.0).raw(), of(1.0).degraded);
    }

    #[test]
    fn training_and_inference_build_the_same_input() {
        // Near, far, farther than 3 m, and zones without depth.
        let metres: [f32; 64] = std::array::from_fn(|zone| 0.07 * (zone + 1) as f32);
        let valid: [bool; 64] = std::array::from_fn(|zone| zone % 5 != 2);
        let readings: Vec<f32> = (0..2 * READING_AREA).map(|i| (i % 97) as f32 / 96.0).collect();
        let trained = fusion_input(&readings, &[Some(Depth { metres, valid }), None]);

        let zones: Vec<f32> =
            metres.iter().zip(valid).map(|(&m, valid)| if valid { m } else { f32::NAN }).collect();
        let maps = DepthMaps::new([zones, vec![0.0; 64]].concat(), [2, 8, 8], 2).unwrap();
        let mut used = Vec::new();
        for (index, reading) in readings.chunks_exact(READING_AREA).enumerate() {
            used.extend_from_slice(reading);
            push_planes(Some(&maps), index, &mut used);
        }
        assert_eq!(trained, used);
    }

    #[test]
    fn a_zone_without_depth_is_zero_and_marked() {
        let mut depth = Depth { metres: [1.5; 64], valid: [true; 64] };
        depth.valid[9] = false;
        let input = fusion_input(&[0.25; 2 * READING_AREA], &[Some(depth), None]);
        let (first, second) = input.split_at(3 * READING_AREA);
        let at = |row: usize, column: usize| row * READING_PX + column;
        assert_eq!((first[READING_AREA], first[2 * READING_AREA]), (0.5, 1.0));
        assert_eq!(first[READING_AREA + at(4, 7)], 0.0);
        assert_eq!(first[2 * READING_AREA + at(7, 4)], 0.0);
        assert_eq!(first[2 * READING_AREA + at(8, 8)], 1.0);
        assert!(second[READING_AREA..].iter().all(|&v| v == 0.0));
    }
}
