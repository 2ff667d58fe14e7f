//! `nirspi dataset`: a set of measurements by the virtual camera, as one table with its data card.

use super::camera::{LIGHT_HELP, ModelArgs, parse_order};
use super::method::MethodArgs;
use super::reconstruct::FolderArgs;
use super::report::ReportArgs;
use super::{Usage, print, provenance};
use anyhow::Result;
use nirspi::archive::{Grid, GridAxes};
use nirspi::exposure::{Length, Light};
use nirspi::files::output::write_atomic;
use nirspi::source::FirstPatterns;
use nirspi_recon::Sampling;
use std::path::PathBuf;
use std::process::ExitCode;

/// Write a set of virtual-camera measurements: every combination of scenes, weathers, distances, orders, shares and seeds
///
/// The command writes one Parquet table with a measurement, its image and the true image in each row, and a data card
/// beside the table (.md). Everything is simulated, and each row says so.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi dataset --scenes letter:R word:STOP --weathers none heavy --distances-m 0.3 0.6 --orders zig-zag cake-cutting \
    --samplings 10% 30% --seeds 1 2 --out set.parquet")]
pub struct Args {
    /// Scenes: letter:R, word:STOP, white, black, or PNG or JPEG files
    #[arg(long, value_name = "SCENE", num_args = 1.., value_delimiter = ',', default_value = "letter:R")]
    scenes: Vec<String>,
    /// Weathers, as for --weather of `demo`: none, light, heavy, rain:20, fog:5m, ...
    #[arg(long, value_name = "WEATHER", num_args = 1.., default_value = "none")]
    weathers: Vec<String>,
    /// Distances to the target in metres
    #[arg(long, value_name = "M", num_args = 1.., value_delimiter = ',', default_value = "0.3")]
    distances_m: Vec<f64>,
    /// Orders of the patterns
    #[arg(long, value_name = "ORDER", num_args = 1.., value_delimiter = ',', default_value = "zig-zag")]
    orders: Vec<String>,
    /// Shares of the patterns that the camera shows
    #[arg(long, value_name = "SHARE", num_args = 1.., value_delimiter = ',', default_value = "50%")]
    samplings: Vec<Sampling>,
    /// Seeds of the simulated noise
    #[arg(long, value_name = "N", num_args = 1.., value_delimiter = ',', default_value = "1")]
    seeds: Vec<u64>,
    /// Frames summed into a measurement; 244 frames take 20 ms with any share of the patterns
    #[arg(long, value_name = "N", default_value_t = 244)]
    frames: u32,
    #[arg(long, value_name = "TIME", conflicts_with = "frames", allow_hyphen_values = true, help = LIGHT_HELP)]
    light: Option<Light>,
    #[command(flatten)]
    model: ModelArgs,
    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    folder: FolderArgs,
    /// The table (.parquet); the data card has its name with .md
    #[arg(long, value_name = "FILE.parquet", default_value = "set.parquet")]
    out: PathBuf,
    #[command(flatten)]
    report: ReportArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    args.method.check()?;
    let orders = args.orders.iter().map(|order| parse_order("--orders", order));
    let axes = GridAxes {
        scenes: args.scenes.clone(),
        weathers: args.weathers.clone(),
        distances_m: args.distances_m.clone(),
        orders: orders.collect::<Result<_>>()?,
        samplings: args.samplings.clone(),
        seeds: args.seeds.clone(),
        length: args
            .light
            .map_or(Length::Frames(args.frames, None), |light| Length::Light(light, None)),
    };
    let options = args.folder.options(&args.out, "this set")?;
    let solver = args.method.solver(FirstPatterns::Recorded, Sampling::ALL)?;
    let grid = Grid::new(axes, args.model.read()?, solver).map_err(|error| {
        if error.is_setting() {
            Usage(error.to_string()).into()
        } else {
            anyhow::Error::from(error)
        }
    })?;
    let (report, code) =
        args.folder.run(&grid, &options, "measurements", args.report, &provenance::simulated())?;
    write_atomic(&args.out.with_extension("md"), grid.card(&report).as_bytes())?;
    if !args.report.json {
        let card = report.out.with_extension("md");
        print::line(format_args!("wrote the data card to {}", card.display()))?;
    }
    Ok(code)
}
