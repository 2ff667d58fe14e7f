//! `nirspi eval`: the quality of results: the paper's tables with nirspi's numbers, and the cost of
//! less sampling.

mod quality;
mod sampling;
mod table1;
mod table3;
mod table4;

use super::camera::{LIGHT_HELP, ModelArgs, Rain, WeatherArgs, exposure};
use super::provenance;
use super::range;
use super::report::{FigureArgs, ReportArgs};
use anyhow::Result;
use clap::{Args, Subcommand};
use nirspi::exposure::{Length, Light};
use nirspi::files::output::OutputDir;
use nirspi::picture::Figure;
use nirspi::setup::MeasurementSetup;
use nirspi_eval::pictures::ANCESTRAL_STEPS;
use nirspi_eval::shot;
use nirspi_optics::rain::Air;
use nirspi_recon::Order;
use nirspi_virtual::CameraModel;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Make the paper's tables with ours beside them; compare methods
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi eval table2\n\
    \x20 nirspi eval table3 --scenes 186 --out table3/\n\
    \x20 nirspi eval sampling wing.npz --out sampling/\n\
    \x20 nirspi eval quality --data chars74k/ --out quality/")]
pub struct EvalArgs {
    #[command(subcommand)]
    table: Table,
}

#[derive(Debug, Subcommand)]
enum Table {
    Table1(table1::Args),
    /// Range in light and heavy rain: the same as `nirspi physics range`
    Table2(range::Args),
    Table3(table3::Args),
    Table4(table4::Args),
    Sampling(sampling::Args),
    Quality(quality::Args),
}

pub fn run(args: &EvalArgs) -> Result<ExitCode> {
    match &args.table {
        Table::Table1(args) => table1::run(args),
        Table::Table2(args) => range::run(args),
        Table::Table3(args) => table3::run(args),
        Table::Table4(args) => table4::run(args),
        Table::Sampling(args) => sampling::run(args),
        Table::Quality(args) => quality::run(args),
    }
}

/// How the pictures of a table are taken.
#[derive(Debug, Args)]
#[command(next_help_heading = "Scene and weather, simulated")]
struct ExposureArgs {
    /// Rain, as in the paper's Table 2
    #[arg(long, value_enum, default_value_t = Rain::Heavy, conflicts_with = "weather")]
    rain: Rain,
    #[command(flatten)]
    weather: WeatherArgs,
    /// Frames to measure; each picture is made from their sum [default: what the camera description says; 244 for the
    /// paper's camera, which take 20 ms]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    frames: Option<u32>,
    #[arg(long, value_name = "TIME", conflicts_with = "frames", allow_hyphen_values = true, help = LIGHT_HELP)]
    light: Option<Light>,
    #[command(flatten)]
    model: ModelArgs,
    /// Seed of the first picture
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

impl ExposureArgs {
    /// The exposure of this camera.
    fn exposure(&self, camera: &CameraModel) -> Result<shot::Exposure> {
        let readout = camera.readout;
        let frames = match (self.light, self.frames) {
            (None, frames) => frames.unwrap_or(readout.sweeps_per_picture),
            (Some(light), _) => {
                let setup = MeasurementSetup::new(&Order::Natural, 1.0)?;
                let setup = setup.timed(readout.clocks_per_pattern, readout.blanked);
                exposure(Length::Light(light, Some(1)), &setup)?.frames
            }
        };
        let air = match self.weather.read()? {
            Some(air) => air,
            None => Air::of_rainfall(self.rain.rainfall())?,
        };
        Ok(shot::Exposure { air, frames, seed: self.seed })
    }
}

/// The pictures of Table 3 or 4, and where the report goes.
#[derive(Debug, Args)]
struct TakenArgs {
    #[command(flatten)]
    exposure: ExposureArgs,
    /// Steps of the paper's own sampler. The paper has 500 steps, which take fifty times as long as 10; 0 leaves the sampler
    /// out
    #[arg(long, value_name = "STEPS", default_value_t = ANCESTRAL_STEPS,
          value_parser = clap::value_parser!(u32).range(0..=500))]
    ancestral: u32,
    #[command(flatten)]
    output: OutputArgs,
}

impl TakenArgs {
    fn settings(&self, scenes: u32) -> Result<shot::Settings> {
        let camera = self.exposure.model.read()?;
        let exposure = self.exposure.exposure(&camera)?;
        Ok(shot::Settings { scenes, camera, exposure, ancestral_steps: self.ancestral })
    }
}

/// Where a table's report goes.
#[derive(Debug, Args)]
struct OutputArgs {
    /// Folder for the report as JSON and its figure
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    figure: FigureArgs,
    #[command(flatten)]
    report: ReportArgs,
}

impl OutputArgs {
    /// Writes `NAME.json` and the figure `NAME` into the folder, if one is named, and prints the report as JSON or in words.
    fn hand_over<R: Serialize>(
        &self,
        name: &str,
        report: &R,
        picture: impl FnOnce() -> Result<Figure>,
        say: impl FnOnce(&R) -> Result<()>,
    ) -> Result<ExitCode> {
        let provenance = provenance::simulated();
        if let Some(path) = &self.out {
            let mut out = OutputDir::create(path)?;
            out.write(&format!("{name}.json"), provenance.sign(report)?.as_bytes())?;
            picture()?.write(&mut out, name, self.figure.figure, &provenance)?;
            out.commit()?;
        }
        self.report.print(report, &provenance, say)
    }
}
