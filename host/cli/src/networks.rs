//! The common parts of commands that run networks: weights, device, progress, report.

use super::Usage;
use super::report::StageTimes;
use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use nirspi::files::stack::ImageStack;
use nirspi::picture::Pictures;
use nirspi_nets::{Backend, Device, Enhanced, Images, Networks, UsedWeights, WeightsError};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Duration;

#[derive(Debug, clap::Args)]
pub struct NetworkArgs {
    /// Weights of your own (.safetensors) in place of the built-in ones; the file says which network they are of.
    /// May be given several times
    #[arg(long, value_name = "FILE")]
    weights: Vec<PathBuf>,
    /// Where networks run: auto (a real GPU if there is one), cpu, wgpu or cuda
    #[arg(long, value_name = "BACKEND", default_value_t)]
    backend: Backend,
}

/// What every command takes that makes images of images.
#[derive(Debug, clap::Args)]
pub struct ImageArgs {
    /// The images: .npy, .png, .jpg or a folder of pictures
    #[arg(value_name = "IN")]
    pub input: PathBuf,
    /// Crop pictures to their central square and bring them to the size that is expected
    #[arg(long)]
    pub resize: bool,
    /// Results: .npy, .png for a single image, else a folder of .png files
    #[arg(long, value_name = "OUT")]
    pub out: PathBuf,
    #[command(flatten)]
    pub networks: NetworkArgs,
    /// Print the report as JSON
    #[arg(long)]
    pub json: bool,
}

impl ImageArgs {
    /// Reads the images, which must have this side.
    pub fn read(&self, side: usize) -> Result<ImageStack> {
        Ok(ImageStack::read(&self.input, self.resize.then_some(side as u32))?)
    }
}

impl NetworkArgs {
    /// Opens the device and reads the user's weights, which must belong to one of these networks.
    pub fn open(&self, models: &[&str]) -> Result<Networks> {
        let mut networks = Networks::built_in(Device::open(self.backend)?);
        for file in &self.weights {
            networks = networks.with_file(file, models).map_err(of_argument)?;
        }
        Ok(networks)
    }
}

/// Weights of a network that the command does not run count as a wrong argument.
fn of_argument(error: WeightsError) -> anyhow::Error {
    match error {
        WeightsError::Model { .. } | WeightsError::Unnamed { .. } => {
            Usage(format!("--weights {error}")).into()
        }
        other => other.into(),
    }
}

impl ImageArgs {
    /// The report of the work on the images.
    pub fn report(
        &self,
        input: &ImageStack,
        networks: &Networks,
        deblurring: Option<Deblurring>,
        pictures: Pictures,
        stage_ms: StageTimes,
    ) -> Report {
        Report {
            input: self.input.clone(),
            output: self.out.clone(),
            images: input.count(),
            device: networks.device().name().to_owned(),
            weights: networks.used().to_vec(),
            deblurring,
            pictures,
            stage_ms,
        }
    }
}

/// Images of this size and in [0, 1], in the form of a network's input.
pub fn checked<const SIDE: usize>(stack: &ImageStack) -> Result<Images<'_, SIDE>> {
    Images::new(stack.values(SIDE)?).with_context(|| stack.path().display().to_string())
}

/// The report of a stack of images.
#[derive(Debug, Serialize)]
pub struct Report {
    pub input: PathBuf,
    pub output: PathBuf,
    pub images: usize,
    pub device: String,
    pub weights: Vec<UsedWeights>,
    #[serde(flatten)]
    pub deblurring: Option<Deblurring>,
    /// The picture for people.
    pub pictures: Pictures,
    pub stage_ms: StageTimes,
}

/// The estimates for deblurred images.
#[derive(Debug, Serialize)]
pub struct Deblurring {
    pub model: String,
    pub steps: u32,
    pub consistency: bool,
    pub seed: u64,
    /// For each image: blur in pixels of the 64 x 64 grid, and noise of a reading.
    pub sigma_px: Vec<f32>,
    pub noise: Vec<f32>,
    /// Distance of the readings from the readings of each result, divided by their noise.
    pub inconsistency: Vec<f32>,
}

impl Deblurring {
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

/// A progress bar of images and time. Hundreds of steps for a batch of images take minutes.
pub fn bar(what: &str, images: usize) -> ProgressBar {
    let template = format!("{what} {{bar:30}} {{pos}}/{{len}} images, {{elapsed}}");
    let style =
        ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(images as u64).with_style(style);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
