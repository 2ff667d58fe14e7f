//! The rows of the comparison: everything that makes 64 x 64 of 32 x 32.
//!
//! The law: classical rows are told blur and noise exactly, networks nothing, so that what networks gain is not that
//! they were told more.

use super::measure::{Condition, sampling_variance};
use anyhow::Result;
use indicatif::ProgressBar;
use nirspi_nets::classical::{self, Method as Classical};
use nirspi_nets::weights::VERSION;
use nirspi_nets::{Enhancer, Fusion, Images, Method, Networks, Options, upscale_2x};
use rayon::prelude::*;
use serde::Serialize;
use std::num::NonZeroU32;

/// Values of a reading.
const READING: usize = 32 * 32;

/// A row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Interpolation.
    Lanczos,
    /// Interpolation, then a classical method.
    Classical(Classical),
    /// FSRCNN alone, without deblurring.
    Fusion,
    /// FSRCNN, then the GAN's generator.
    Gan,
    /// FSRCNN, then the bridge in so many steps.
    Diffusion(u32),
    /// FSRCNN, then the ancestral sampler in so many steps.
    Ancestral(u32),
}

impl Kind {
    /// Those that are measured at every condition.
    pub const ALL: [Self; 9] = [
        Self::Lanczos,
        Self::Classical(Classical::Wiener),
        Self::Classical(Classical::RichardsonLucy),
        Self::Classical(Classical::TotalVariation),
        Self::Fusion,
        Self::Gan,
        Self::Diffusion(1),
        Self::Diffusion(2),
        Self::Diffusion(4),
    ];

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
            Self::Diffusion(n) => steps("diffusion", n),
            Self::Ancestral(n) => steps("ancestral", n),
        }
    }

    /// Steps, of those that have a choice.
    pub fn steps(self) -> Option<u32> {
        match self {
            Self::Diffusion(n) | Self::Ancestral(n) => Some(n),
            _ => None,
        }
    }
}

/// Which weights a report rests on.
#[derive(Debug, Serialize)]
pub struct Version {
    pub model: &'static str,
    pub version: String,
}

/// The versions of all networks.
pub fn versions(networks: &mut Networks) -> Result<Vec<Version>> {
    ["estimator", "fsrcnn", "diffusion", "ancestral", "gan", "classifier"]
        .into_iter()
        .map(|model| {
            let weights = networks.weights(model)?;
            let version = weights.metadata(VERSION).unwrap_or("unknown").to_owned();
            Ok(Version { model, version })
        })
        .collect()
}

/// A row that is ready to run.
pub struct Row {
    kind: Kind,
    runner: Runner,
}

enum Runner {
    None,
    Fusion(Fusion),
    Chain(Box<Enhancer>),
}

impl Row {
    /// With the networks that it needs.
    pub fn new(kind: Kind, networks: &mut Networks) -> Result<Self> {
        let count = |steps| NonZeroU32::new(steps).unwrap_or(NonZeroU32::MIN);
        let mut chain =
            |method| Ok::<_, anyhow::Error>(Runner::Chain(Box::new(networks.enhancer(method)?)));
        let runner = match kind {
            Kind::Lanczos | Kind::Classical(_) => Runner::None,
            Kind::Gan => chain(Method::Gan)?,
            Kind::Diffusion(steps) => chain(Method::Diffusion { steps: count(steps) })?,
            Kind::Ancestral(steps) => chain(Method::Ancestral { steps: count(steps) })?,
            Kind::Fusion => Runner::Fusion(networks.fusion()?),
        };
        Ok(Self { kind, runner })
    }

    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// Images (N, 64, 64) in [0, 1] of readings (N, 32, 32) in [0, 1] that were made under a condition; the bar is
    /// told how many are done.
    pub fn enhance(
        &self,
        readings: &[f32],
        condition: Condition,
        bar: &ProgressBar,
    ) -> Result<Vec<f32>> {
        match self.kind {
            Kind::Classical(method) => {
                let images = classical_chain(method, readings, condition)?;
                bar.inc((readings.len() / READING) as u64);
                Ok(images)
            }
            _ => self.enhance_blind(readings, bar),
        }
    }

    /// The same for a row that is told nothing; a classical one is left at its interpolation.
    pub fn enhance_blind(&self, readings: &[f32], bar: &ProgressBar) -> Result<Vec<f32>> {
        let before = bar.position();
        let checked = Images::new(readings)?;
        let images = match &self.runner {
            Runner::Fusion(fusion) => fusion.upscale(checked, None),
            Runner::Chain(chain) => {
                let mut progress = |done: usize| bar.set_position(before + done as u64);
                chain.enhance(checked, None, &Options::default(), &mut progress)?.images
            }
            Runner::None => upscale_2x(readings, checked.count(), 32, 32)?,
        };
        bar.set_position(before + checked.count() as u64);
        Ok(images)
    }
}

/// Interpolation, then deblurring on the fine grid with what interpolation has made of blur and noise.
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

/// What interpolation makes of the standard deviation of white noise: the root of the mean, over the four places of an
/// output pixel, of the sum of its squared weights.
fn interpolation_gain() -> Result<f32> {
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

    #[test]
    fn interpolation_lessens_noise_as_much_as_is_reckoned() {
        // Alternating pixels are noise of one frequency; many frequencies are needed: a fixed scramble.
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
