//! The common parts of commands that run networks: weights, device, progress, report.

use super::report::{FigureArgs, Overwrite, ReportArgs, StageTimes};
use super::{Usage, print};
use anyhow::{Context, Result};
use nirspi::imaging::stack::{ImageStack, StackTarget};
use nirspi::imaging::{Deblurring, StackReport};
use nirspi::picture::Pictures;
use nirspi_nets::{Arithmetic, Backend, Device, Images, Networks, WeightsError};
use nirspi_recon::words::count_of;
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Networks")]
pub struct NetworkArgs {
    /// Weights of your own (.safetensors) in place of the built-in ones. The file names its network. This option may be
    /// given several times
    #[arg(long, value_name = "FILE")]
    weights: Vec<PathBuf>,
    /// Where networks run: auto (a real GPU if there is one), cpu, wgpu or cuda
    #[arg(long, value_name = "BACKEND", default_value_t)]
    backend: Backend,
    /// Arithmetic of the deblurring network on a GPU with tensor cores: f32 gives what the processor gives to within 0.0001;
    /// f16 needs half of the multiplications there and differs by 0.005 at most. Other devices always compute in f32
    #[arg(long, value_name = "NUMBERS", default_value_t)]
    precision: Arithmetic,
}

/// What every command takes that makes images of images.
#[derive(Debug, clap::Args)]
pub struct ImageArgs {
    /// The images: .npy, .png, .jpg or a folder of pictures
    #[arg(value_name = "IN")]
    pub input: PathBuf,
    /// Crop pictures to their central square and resize them to the size that the command needs
    #[arg(long)]
    pub resize: bool,
    /// Where the results go: a .npy file, a .png file for a single image, or a folder for .png files
    #[arg(long, value_name = "OUT")]
    pub out: PathBuf,
    #[command(flatten)]
    pub overwrite: Overwrite,
    #[command(flatten)]
    pub networks: NetworkArgs,
    #[command(flatten)]
    pub figure: FigureArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

impl ImageArgs {
    /// Reads the images, which must have this side. Noise below black and above white is cut.
    pub fn read(&self, side: usize) -> Result<ImageStack> {
        let mut images = ImageStack::read(&self.input, side as u32, self.resize)?;
        let cut = images.cut_noise();
        if cut > 0 {
            let (path, values) = (self.input.display(), count_of(cut, "value"));
            let note =
                format!("{path}: {values} below 0 or above 1, by noise, are read as 0 and 1");
            if self.report.json { print::remark(note) } else { print::note(note)? }
        }
        Ok(images)
    }

    /// Where the results of these images go, or further results of theirs.
    pub fn target(&self, images: &ImageStack, out: &Path) -> Result<StackTarget> {
        Ok(images.target(out, self.overwrite.overwrite)?.with_figure(self.figure.figure))
    }
}

impl NetworkArgs {
    /// Opens the device and reads the user's weights, which must belong to one of these networks.
    pub fn open(&self, models: &[&str]) -> Result<Networks> {
        let device = Device::open(self.backend)?.with_arithmetic(self.precision);
        crate::backend::say_slow_start();
        let mut networks = Networks::built_in(device);
        for file in &self.weights {
            networks = networks.with_file(file, models).map_err(of_argument)?;
        }
        Ok(networks)
    }
}

/// Says on stderr what the networks have done in another way than asked, a line each.
pub fn say_notes(networks: &Networks) {
    for note in networks.device().notes() {
        print::complain(note);
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
    /// The report of the work on the images, after the notes about it.
    pub fn report(
        &self,
        input: &ImageStack,
        networks: &Networks,
        deblurring: Option<Deblurring>,
        pictures: Pictures,
        stage_ms: StageTimes,
    ) -> StackReport {
        say_notes(networks);
        StackReport {
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

/// Prints the report of [`ImageArgs::report`] in two lines.
pub fn say(report: &StackReport) -> Result<()> {
    if let Some(deblurring) = &report.deblurring {
        print::line(deblurring.line())?;
    }
    print::line(format_args!(
        "{} on {}, in {}; to look at: {}",
        count_of(report.images, "image"),
        report.device,
        report.output.display(),
        report.pictures
    ))
}
