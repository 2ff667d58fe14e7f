//! Shots of the calibration: scenes measured by the virtual camera, reconstructed by a method, and
//! enhanced as every command does.
//!
//! # Invariant
//! All methods get the same readings of a scene (`tests::every_method_gets_the_same_readings`).

use crate::error::{EvalError, Result};
use crate::training::{Conditions, LinearCamera, Rainfall};
use nirspi_nets::interval::{Readings, Seen};
use nirspi_nets::{Enhanced, Enhancer, Images, Known, MeasuredRows, Options};
use nirspi_optics::CameraModel;
use nirspi_recon::Order;
use nirspi_recon::reconstruct::{Method, MethodSettings, Reconstruct};
use rand::seq::IndexedRandom;
use rand::{Rng, RngExt};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// The least share of the patterns and the most noise of the calibration.
pub(super) const LEAST_SHARE: f32 = 0.1;
pub(super) const MOST_NOISE: f32 = 0.2;
/// The least noise that is drawn: a long exposure.
const LEAST_NOISE: f32 = 0.001;
/// The contrast of a scene of low contrast.
pub(super) const LOW_CONTRAST: f32 = 0.35;
/// Distances in mm: the focus of the paper's lens, where half of the shots are taken, and the
/// farthest.
const FOCUS_MM: f64 = 300.0;
const FARTHEST_MM: f64 = 600.0;

/// The stack and the number of a shot's image.
pub(super) type At = (usize, usize);

/// How a shot is taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Condition {
    pub distance_mm: f64,
    /// Share of the patterns.
    pub share: f32,
    /// Noise of the readings.
    pub noise: f32,
    /// Contrast of the scene over its own.
    pub contrast: f32,
    /// Zig-zag or cake-cutting order.
    pub zig_zag: bool,
    /// Whether the lens's blur is told to the networks, as a depth sensor tells it.
    pub told: bool,
}

impl Condition {
    /// A condition by chance, with noise up to `most`.
    pub(super) fn drawn(rng: &mut impl Rng, most: f32) -> Self {
        let nearness = rng.random_range(FARTHEST_MM.recip()..=FOCUS_MM.recip());
        let noise = LEAST_NOISE * (most / LEAST_NOISE).powf(rng.random::<f32>().powf(0.6));
        let share = [1.0, 1.0, 0.5, 0.5, 0.25, 0.25, LEAST_SHARE, LEAST_SHARE, 0.0]
            .choose(rng)
            .copied()
            .unwrap_or(1.0);
        let share = if share > 0.0 { share } else { rng.random_range(LEAST_SHARE..1.0) };
        let contrast = match rng.random_range(0..5) {
            0 | 1 => 1.0,
            2 | 3 => LOW_CONTRAST,
            _ => rng.random_range(0.2..1.0),
        };
        Self {
            distance_mm: if rng.random() { FOCUS_MM } else { nearness.recip() },
            share,
            noise,
            contrast,
            zig_zag: rng.random(),
            told: rng.random(),
        }
    }
}

/// A scene with this share of its contrast.
pub(super) fn with_contrast(sharp: &[f32], contrast: f32) -> Vec<f32> {
    let mean = sharp.iter().sum::<f32>() / sharp.len() as f32;
    sharp.iter().map(|value| mean + contrast * (value - mean)).collect()
}

/// An enhanced image of a shot.
pub(super) struct Shot {
    /// The scene, with the condition's contrast.
    pub truth: Vec<f32>,
    /// The method, by its number in [`Studio::methods`].
    pub method: usize,
    pub condition: Condition,
    pub made: Enhanced,
}

impl Shot {
    /// What is known without the truth.
    pub(super) fn seen(&self) -> Option<Seen<'_>> {
        self.made.seen()?.next()
    }

    pub(super) fn readings(&self, studio: &Studio) -> Readings<'static> {
        let Condition { share, noise, .. } = self.condition;
        Readings { method: studio.methods[self.method].argument(), share, noise }
    }
}

/// The camera, the methods and the networks.
pub(super) struct Studio {
    camera: LinearCamera,
    pub methods: Vec<Method>,
    solvers: Vec<Box<dyn Reconstruct>>,
    enhancer: Enhancer,
}

impl Studio {
    pub(super) fn new(enhancer: Enhancer, seed: u64) -> Result<Self> {
        let settings = MethodSettings {
            network: Some(nirspi_nets::prior::shipped()),
            ..MethodSettings::default()
        };
        // A choice makes the image of one of the others, and takes that one's table.
        let all = Method::ALL.iter().copied();
        let methods: Vec<Method> = all.filter(|method| *method != Method::AUTO).collect();
        let solvers =
            methods.iter().map(|method| method.prepare(&settings)).collect::<Result<_, _>>()?;
        Ok(Self {
            camera: LinearCamera::new(CameraModel::paper(), seed)?,
            methods,
            solvers,
            enhancer,
        })
    }

    /// The number of the learned method, which has seen more natural scenes than the other networks.
    pub(super) fn prior(&self) -> usize {
        self.methods.iter().position(|&method| method == Method::PRIOR).unwrap_or(usize::MAX)
    }

    /// Takes scenes under one condition, each reconstructed by some methods.
    pub(super) fn shoot(
        &self,
        scenes: &[(&[f32], &[usize])],
        condition: Condition,
        rng: &mut Pcg64Mcg,
    ) -> Result<Vec<Shot>> {
        let Condition { distance_mm, share, noise, contrast, zig_zag, told } = condition;
        let sweeps = self.camera.sweeps_for(noise.into(), distance_mm)?;
        let of_camera = Conditions { distance_mm, rain: Rainfall::None, sweeps, sampling: share };
        let order = if zig_zag { Order::ZigZag } else { Order::CakeCutting };
        let mut jobs = Vec::new();
        for (sharp, methods) in scenes {
            let truth = with_contrast(sharp, contrast);
            let measured = self.camera.measure(&truth, of_camera, &order, rng)?;
            jobs.extend(methods.iter().map(|&method| (method, truth.clone(), measured.clone())));
        }
        // The networks are not shared among threads; the methods are.
        let solvers = &self.solvers;
        let images: Vec<Vec<f32>> = jobs
            .par_iter()
            .map(|(method, _, measured)| {
                let white = measured.white_counts;
                // The camera knows the noise of its readings.
                let sigma = f64::from(noise * white) * 32.0;
                let measurements = measured.measurements.clone().with_noise(sigma)?;
                let made = solvers[*method].reconstruct(&measurements)?;
                let of_white = |&value: &f32| (value / white).clamp(0.0, 1.0);
                let given = made.with_readings(&measurements);
                Ok::<_, EvalError>(given.pixels().iter().map(of_white).collect())
            })
            .collect::<Result<_>>()?;
        let Some((_, _, first)) = jobs.first() else { return Ok(Vec::new()) };
        let mut options = Options {
            measured: MeasuredRows::new(32, first.measurements.rows())?,
            ..Options::default()
        };
        if told {
            options.estimate.sigma_px = Known::AtLeast(first.sigma_px);
        }
        let values = images.concat();
        let made = self.enhancer.enhance(Images::new(&values)?, None, &options, &mut |_| {})?;
        let shots = jobs.into_iter().zip(made.each());
        Ok(shots
            .map(|((method, truth, _), made)| Shot { truth, method, condition, made })
            .collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_nets::{Device, Networks};
    use rand::SeedableRng;

    #[test]
    fn every_method_gets_the_same_readings() {
        let mut networks = Networks::built_in(Device::cpu());
        let enhancer = networks.enhancer(nirspi_nets::Method::default()).unwrap();
        let studio = Studio::new(enhancer, 1).unwrap();
        let scene: Vec<f32> = (0..4096).map(|at| if at % 64 < 20 { 0.2 } else { 0.7 }).collect();
        let mut rng = Pcg64Mcg::seed_from_u64(2);
        let condition = Condition {
            distance_mm: FOCUS_MM,
            share: 1.0,
            noise: 0.02,
            contrast: 1.0,
            zig_zag: true,
            told: false,
        };
        let shots = studio.shoot(&[(&scene, &[0, 0])], condition, &mut rng).unwrap();
        assert_eq!(shots.len(), 2);
        assert_eq!(shots[0].made.images, shots[1].made.images);
        let mean = |image: &[f32]| image[..20].iter().sum::<f32>() / 20.0;
        assert!((mean(&shots[0].made.images[32 * 64..]) - 0.2).abs() < 0.03);
        assert_eq!(shots[0].readings(&studio).method, "hadamard");
    }

    #[test]
    fn low_contrast_keeps_the_mean() {
        let flat = with_contrast(&[0.0, 1.0], LOW_CONTRAST);
        assert!((flat[0] - 0.325).abs() < 1e-6 && (flat[1] - 0.675).abs() < 1e-6, "{flat:?}");
    }
}
