//! `nirspi eval sampling`: the quality by share of the patterns, for every order, basis and method.

use crate::camera::parse_order;
use crate::progress::Progress;
use crate::provenance::made;
use crate::report::{FigureArgs, ReportArgs};
use crate::source::SourceArgs;
use crate::{print, refused};
use anyhow::{Context, Result};
use nirspi::files::output::OutputDir;
use nirspi_eval::sampling::{JudgedBy, RECORDED, Study, default_orders};
use nirspi_recon::Sampling;
use std::path::PathBuf;
use std::process::ExitCode;

/// Compare orders, bases and methods at partial sampling, on measurements of a full sweep
///
/// An independent measurement of the scene judges the images: the other half of a recording's frames, or --against. Without
/// either, the image of all patterns of the same readings does, which has their noise. The command writes sampling.md (tables), sampling.json (every number),
/// sampling.png (each order's gain over zero filling, and the best image at each share) and sampling_images.png (the best images
/// of each order).
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi eval sampling capture.mcap --out sampling/\n\
    \x20 nirspi eval sampling wing.npz --against wing_again.npz --out sampling/")]
pub struct Args {
    #[command(flatten)]
    source: SourceArgs,
    /// Shares of all patterns to compare, each as 0.3 or 30%
    #[arg(long, value_name = "SHARE,...", value_delimiter = ',', default_values = ["0.1", "0.2", "0.3", "0.5"])]
    sampling: Vec<Sampling>,
    /// Orders to compare, by their names; `recorded` is the order in which the patterns were shown
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_values_t = default_orders())]
    orders: Vec<String>,
    /// A second measurement of the same scene, which judges the images: its noise is independent. Read with the same options
    #[arg(long, value_name = "FILE")]
    against: Option<PathBuf>,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "sampling")]
    out: PathBuf,
    #[command(flatten)]
    figure: FigureArgs,
    #[command(flatten)]
    report: ReportArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    OutputDir::create(&args.out)?.check(["sampling.json"])?;
    let orders = args
        .orders
        .iter()
        .map(|name| {
            let order = (name != RECORDED).then(|| parse_order("--orders", name)).transpose()?;
            Ok((name.clone(), order))
        })
        .collect::<Result<_>>()?;
    let shares = args.sampling.iter().map(|sampling| sampling.share()).collect();
    let study = Study::new(orders, shares).map_err(refused)?;
    let input = &args.source.input;
    let (mut measurements, taken) = args.source.load_real()?;
    let judge = match &args.against {
        Some(other) => {
            let other = SourceArgs { input: other.clone(), ..args.source.clone() };
            Some((other.load_real()?.0, JudgedBy::OtherMeasurement))
        }
        None => args.source.halves()?.map(|[one, other]| {
            measurements = one;
            (other, JudgedBy::OtherFrames)
        }),
    };
    let judge = judge.as_ref().map(|(judge, judged_by)| (judge, *judged_by));
    let provenance = taken.made(made());
    let bar = Progress::of("sampling", study.images(), "images");
    let report = study
        .run(input.clone(), &measurements, judge, &|| bar.add(1))
        .with_context(|| input.display().to_string())?;
    drop(bar);
    let tables = format!("{}\n{provenance}\n", study.tables(&report));
    let mut out = OutputDir::create(&args.out)?;
    out.write("sampling.md", tables.as_bytes())?;
    out.write("sampling.json", provenance.sign(&report)?.as_bytes())?;
    for (name, figure) in study.figures(&report) {
        figure.write(&mut out, name, args.figure.figure, &provenance)?;
    }
    out.commit()?;
    args.report.print(&report, &provenance, |_| {
        print::line(tables.trim_end())?;
        let folder = args.out.display();
        print::line(format_args!(
            "wrote sampling.md, sampling.json, sampling.png and sampling_images.png to {folder}"
        ))
    })
}
