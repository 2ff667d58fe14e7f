//! The compared methods, ready to run. Each makes 64 x 64 pixels of 32 x 32.
//!
//! # Invariant
//! Classical methods know blur and noise exactly, and networks know neither, so the networks' gain
//! does not come from more knowledge (`tests::only_classical_methods_get_the_condition`).

use super::condition::{Condition, sampling_variance};
use crate::error::{EvalError, Result};
use nirspi_nets::classical::{self, Method as Classical};
use nirspi_nets::deblur::{self, Model};
use nirspi_nets::weights::VERSION;
use nirspi_nets::{Enhancer, Fusion, Images, Networks, Options, upscale_2x};
use rayon::prelude::*;
use serde::Serialize;
use std::num::NonZeroU32;

/// Number of values of a reading.
const READING: usize = nirspi_recon::Side::INSTRUMENT.area();

/// A method of the comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Interpolation.
    Lanczos,
    /// Interpolation, then a classical method.
    Classical(Classical),
    /// FSRCNN alone, without deblurring.
    Fusion,
    /// FSRCNN, then the GAN's generator.
    Gan,
    /// FSRCNN, then a network that minimises the error, trained as long as the GAN and the ancestral
    /// sampler.
    Regression,
    /// FSRCNN, then the bridge with this number of steps.
    Diffusion(u32),
    /// FSRCNN, then the ancestral sampler with this number of steps.
    Ancestral(u32),
}

impl Method {
    /// The methods that are measured at every condition.
    pub const ALL: [Self; 10] = [
        Self::Lanczos,
        Self::Classical(Classical::Wiener),
        Self::Classical(Classical::RichardsonLucy),
        Self::Classical(Classical::TotalVariation),
        Self::Fusion,
        Self::Gan,
        Self::Regression,
        Self::Diffusion(1),
        Self::Diffusion(2),
        Self::Diffusion(4),
    ];

    /// The method's name in charts and reports.
    #[must_use]
    pub fn name(self) -> String {
        let steps =
            |what: &str, n: u32| format!("{what}, {n} step{}", if n == 1 { "" } else { "s" });
        match self {
            Self::Lanczos => "Lanczos".to_owned(),
            Self::Classical(Classical::Wiener) => "Wiener".to_owned(),
            Self::Classical(Classical::RichardsonLucy) => "Richardson-Lucy".to_owned(),
            Self::Classical(Classical::TotalVariation) => "total variation".to_owned(),
            Self::Fusion => "fusion alone".to_owned(),
            Self::Gan => "GAN".to_owned(),
            Self::Regression => "regression".to_owned(),
            Self::Diffusion(n) => steps("diffusion", n),
            Self::Ancestral(n) => steps("ancestral", n),
        }
    }

    /// The number of steps; `None` for a method without a choice of steps.
    #[must_use]
    pub fn steps(self) -> Option<u32> {
        match self {
            Self::Diffusion(n) | Self::Ancestral(n) => Some(n),
            _ => None,
        }
    }
}

/// The weights on which a report is based.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Version {
    /// The network.
    pub model: &'static str,
    /// The version of its weights.
    pub version: String,
}

impl Version {
    /// The versions of all networks.
    ///
    /// # Errors
    /// `EvalError` for weights that cannot be read.
    pub fn all(networks: &mut Networks) -> Result<Vec<Self>> {
        ["estimator", "fsrcnn", "diffusion", "ancestral", "gan", "regression", "classifier"]
            .into_iter()
            .map(|model| {
                let weights = networks.weights(model)?;
                let version = weights.metadata(VERSION).unwrap_or("unknown").to_owned();
                Ok(Self { model, version })
            })
            .collect()
    }
}

/// A method that is ready to run.
pub struct Contender {
    method: Method,
    runner: Runner,
}

enum Runner {
    None,
    Fusion(Fusion),
    Chain(Box<Enhancer>),
}

impl Contender {
    /// The method with its networks.
    ///
    /// # Errors
    /// `EvalError` for weights that cannot be read.
    pub fn new(method: Method, networks: &mut Networks) -> Result<Self> {
        let (model, steps) = match method {
            Method::Lanczos | Method::Classical(_) => {
                return Ok(Self { method, runner: Runner::None });
            }
            Method::Fusion => {
                return Ok(Self { method, runner: Runner::Fusion(networks.fusion()?) });
            }
            Method::Gan => (Model::GAN, 1),
            Method::Regression => (Model::REGRESSION, 1),
            Method::Diffusion(steps) => (Model::DIFFUSION, steps),
            Method::Ancestral(steps) => (Model::ANCESTRAL, steps),
        };
        let network = deblur::Method::new(model, NonZeroU32::new(steps))
            .map_err(|error| EvalError::Refused { name: "steps", why: error.to_string() })?;
        Ok(Self { method, runner: Runner::Chain(Box::new(networks.enhancer(network)?)) })
    }

    /// The method.
    #[must_use]
    pub fn method(&self) -> Method {
        self.method
    }

    /// Images (N, 64, 64) in [0, 1] of readings (N, 32, 32) in [0, 1] made under a condition.
    /// `done` is called with the number of images just made.
    ///
    /// # Errors
    /// `EvalError` for readings out of range.
    pub fn enhance(
        &self,
        readings: &[f32],
        condition: Condition,
        done: &dyn Fn(usize),
    ) -> Result<Vec<f32>> {
        match self.method {
            Method::Classical(method) => {
                let images = classical_chain(method, readings, condition)?;
                done(readings.len() / READING);
                Ok(images)
            }
            _ => self.enhance_blind(readings, done),
        }
    }

    /// As [`enhance`](Self::enhance), for readings of unknown blur and noise. A classical method
    /// stops after its interpolation.
    ///
    /// # Errors
    /// `EvalError` for readings out of range.
    pub fn enhance_blind(&self, readings: &[f32], done: &dyn Fn(usize)) -> Result<Vec<f32>> {
        let checked = Images::new(readings)?;
        let mut told = 0;
        let mut progress = |all: usize| {
            done(all.saturating_sub(told));
            told = all.max(told);
        };
        let images = match &self.runner {
            Runner::Fusion(fusion) => fusion.upscale(checked, None),
            Runner::Chain(chain) => {
                chain.enhance(checked, None, &Options::default(), &mut progress)?.images
            }
            Runner::None => upscale_2x(readings, checked.count(), 32, 32)?,
        };
        progress(checked.count());
        Ok(images)
    }
}

/// Interpolation, then deblurring on the fine grid with the blur and noise after interpolation.
fn classical_chain(method: Classical, readings: &[f32], condition: Condition) -> Result<Vec<f32>> {
    let sigma_px = (condition.sigma_px.powi(2) + sampling_variance()).sqrt();
    let noise = condition.noise * interpolation_gain()?;
    let each: Vec<Vec<f32>> = readings
        .par_chunks_exact(READING)
        .map(|reading| {
            let enlarged = upscale_2x(reading, 1, 32, 32)?;
            Ok(classical::deblur(method, &enlarged, (64, 64), sigma_px, noise)?)
        })
        .collect::<Result<_>>()?;
    Ok(each.concat())
}

/// Factor by which interpolation changes the standard deviation of white noise: the root of the
/// mean, over the four positions of an output pixel, of the sum of its squared weights.
pub(super) fn interpolation_gain() -> Result<f32> {
    const STEP: f32 = 0.25;
    let mut grey = vec![0.5; 16 * 16];
    grey[8 * 16 + 8] += STEP;
    let answer = upscale_2x(&grey, 1, 16, 16)?;
    let power: f32 = answer.iter().map(|value| ((value - 0.5) / STEP).powi(2)).sum();
    Ok((power / 4.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_nets::Device;

    /// Readings of an edge under a condition.
    fn edge(condition: Condition) -> Vec<f32> {
        let sharp: Vec<f32> = (0..64 * 64).map(|at| if at % 64 < 30 { 0.2 } else { 0.8 }).collect();
        condition.read(&sharp, 1, 0)
    }

    #[test]
    fn only_classical_methods_get_the_condition() {
        let mut networks = Networks::built_in(Device::cpu());
        let (little, much) =
            (Condition { sigma_px: 1.0, noise: 0.01 }, Condition { sigma_px: 3.0, noise: 0.05 });
        let readings = edge(little);
        for method in Method::ALL {
            let contender = Contender::new(method, &mut networks).unwrap();
            let under = |condition| contender.enhance(&readings, condition, &|_| {}).unwrap();
            let is_classical = matches!(method, Method::Classical(_));
            assert_eq!(under(little) != under(much), is_classical, "{}", method.name());
        }
    }

    #[test]
    fn every_image_is_counted_once() {
        let mut networks = Networks::built_in(Device::cpu());
        let condition = Condition { sigma_px: 1.0, noise: 0.01 };
        let readings = edge(condition).repeat(3);
        for method in [Method::Lanczos, Method::Classical(Classical::Wiener), Method::Gan] {
            let count = std::cell::Cell::new(0);
            let done = |images| count.set(count.get() + images);
            Contender::new(method, &mut networks)
                .unwrap()
                .enhance(&readings, condition, &done)
                .unwrap();
            assert_eq!(count.get(), 3, "{}", method.name());
        }
    }

    #[test]
    fn interpolation_lessens_noise_as_much_as_is_reckoned() {
        // Alternating pixels would be noise of one frequency. A fixed permutation gives many
        // frequencies.
        let scramble =
            |at: u64| (at.wrapping_mul(6_364_136_223_846_793_005) >> 40) as f32 / (1 << 24) as f32;
        let noise: Vec<f32> =
            (1..=32 * 32).map(|at| 0.3 + 0.4 * scramble(at * at + 977 * at)).collect();
        let spread = |values: &[f32]| {
            let mean = values.iter().sum::<f32>() / values.len() as f32;
            (values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / values.len() as f32).sqrt()
        };
        let found = spread(&upscale_2x(&noise, 1, 32, 32).unwrap()) / spread(&noise);
        let reckoned = interpolation_gain().unwrap();
        assert!((found / reckoned - 1.0).abs() < 0.05, "{found} against {reckoned}");
    }
}
