//! The report of learned stages or classical deblurring on a stack of images.

use crate::picture::Pictures;
use crate::stage_times::StageTimes;
use nirspi_nets::{Enhanced, UsedWeights};
use serde::Serialize;
use std::path::PathBuf;

/// The report of a stack of images.
#[derive(Debug, Serialize)]
pub struct StackReport {
    /// The file or folder of the images.
    pub input: PathBuf,
    /// The file or folder of the results.
    pub output: PathBuf,
    /// Number of images.
    pub images: usize,
    /// Name of the device that computed.
    pub device: String,
    /// The weights of each network.
    pub weights: Vec<UsedWeights>,
    /// The estimates, if the images were deblurred.
    #[serde(flatten)]
    pub deblurring: Option<Deblurring>,
    /// The picture for people, and what is black and white in it.
    pub pictures: Pictures,
    /// The time of each stage.
    pub stage_ms: StageTimes,
}

/// The estimates for deblurred images.
#[derive(Debug, Serialize)]
pub struct Deblurring {
    /// The network or method.
    pub model: String,
    /// Steps of the network.
    pub steps: u32,
    /// Whether results were kept in agreement with the readings.
    pub consistency: bool,
    /// Seed of everything random.
    pub seed: u64,
    /// Blur of each image, in pixels of the 64 x 64 grid.
    pub sigma_px: Vec<f32>,
    /// Noise of a reading of each image.
    pub noise: Vec<f32>,
    /// Distance of the readings from the readings of each result, divided by their noise.
    pub inconsistency: Vec<f32>,
}

impl Deblurring {
    /// The estimates of a result.
    #[must_use]
    pub fn of(method: &str, steps: u32, consistency: bool, seed: u64, result: &Enhanced) -> Self {
        Self {
            model: method.to_owned(),
            steps,
            consistency,
            seed,
            sigma_px: result.estimates.iter().map(|e| e.sigma_px).collect(),
            noise: result.estimates.iter().map(|e| e.noise).collect(),
            inconsistency: result.inconsistency.clone(),
        }
    }

    /// One line for the user.
    #[must_use]
    pub fn line(&self) -> String {
        let median = |values: &[f32]| {
            let mut sorted = values.to_vec();
            sorted.sort_by(f32::total_cmp);
            sorted.get(sorted.len() / 2).copied().unwrap_or(f32::NAN)
        };
        let steps = match self.steps {
            1 => String::new(),
            steps => format!(" in {steps} steps"),
        };
        format!(
            "{}{steps}: blur {:.2} px, noise {:.4}, inconsistency {:.2} (medians; near 1 or below, the readings bear the \
             result out)",
            self.model,
            median(&self.sigma_px),
            median(&self.noise),
            median(&self.inconsistency)
        )
    }
}
