//! `nirspi physics range`: the range of the camera in rain (the paper's Algorithm 2 and Table 2).

use super::camera::ModelArgs;
use super::{print, provenance, refused};
use crate::report::{FigureArgs, ReportArgs};
use anyhow::Result;
use nirspi::files::output::OutputDir;
use nirspi_eval::range::{Report, Settings, figures, range};
use std::path::PathBuf;
use std::process::ExitCode;

/// Say how far the camera sees in rain, beside the paper's Table 2
///
/// The range is the farthest distance at which one pixel of a white target still has the signal-to-noise ratio of --snr. It
/// follows from the photon budget and from the extinction of the rain (Mie scattering). Beside it are the ranges of the
/// paper's Algorithm 2 as printed and with the gain of all patterns, the exposure that a pixel needs against distance, and
/// the assumptions that would be needed to agree with the paper. --out writes charts of the same, and of resolution and SNR
/// of this camera and of the shipped ones.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi physics range\n\
    \x20 nirspi physics range --snr 2 --reflectance 0.5 --out range/")]
pub struct Args {
    /// Signal of a pixel over its noise at the farthest distance
    #[arg(long, value_name = "SNR", default_value_t = 1.0)]
    snr: f64,
    /// Reflectance of the target
    #[arg(long, value_name = "0..1", default_value_t = 1.0)]
    reflectance: f64,
    /// Exposures of a pattern, in µs
    #[arg(long, value_name = "US,...", value_delimiter = ',', default_values_t = [8.0, 25.0])]
    exposures_us: Vec<f64>,
    #[command(flatten)]
    model: ModelArgs,
    /// Folder for range.png, exposure.png, range.json, and the finest line (resolution.png) and SNR (snr.png) against
    /// distance of this camera and the shipped ones, and the SNR of the paper's camera if one assumed constant were another
    /// (assumptions.png)
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    figure: FigureArgs,
    #[command(flatten)]
    report: ReportArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let settings = Settings {
        snr: args.snr,
        reflectance: args.reflectance,
        exposures_us: args.exposures_us.clone(),
        camera: args.model.read()?,
    };
    let report = range(&settings).map_err(refused)?;
    let provenance = provenance::simulated();
    if let Some(out) = &args.out {
        let mut out = OutputDir::create(out)?;
        for (name, figure) in figures(&settings)? {
            figure.write(&mut out, name, args.figure.figure, &provenance)?;
        }
        out.write("range.json", provenance.sign(&report)?.as_bytes())?;
        out.commit()?;
    }
    args.report.print(&report, &provenance, |report| say(args, report))
}

fn say(args: &Args, report: &Report) -> Result<()> {
    print::line(format_args!(
        "range of camera {} for an SNR of {} a pixel, target of reflectance {} (simulated)",
        report.camera, report.snr, report.reflectance
    ))?;
    print::line(
        "rain    mm/h  drop mm  exposure µs   paper m    physics m  dry air m  as printed m  with gain m",
    )?;
    let metres =
        |range: Option<f64>| range.map_or_else(|| "none".to_owned(), |m| format!("{m:.3}"));
    for row in &report.rows {
        print::line(format_args!(
            "{:<6} {:5.2}  {:7.1}  {:11}   {:>3} to {:<3} {:>9}  {:>9}  {:>12.2}  {:>11.2}",
            row.rain,
            row.rate_mm_per_h,
            row.drop_mm,
            row.exposure_us,
            row.paper_m.0,
            row.paper_m.1,
            metres(row.physics_m),
            metres(row.dry_air_m),
            row.as_printed_m,
            row.as_printed_with_gain_m
        ))?;
    }
    print::line(format_args!(
        "exposure needed in heavy rain, µs: distance m, for SNR {}, for SNR {}, the paper's",
        report.snr,
        5.0 * report.snr
    ))?;
    for row in &report.exposures {
        let paper = row.paper_us.map_or_else(String::new, |us| format!("{us}"));
        print::line(format_args!(
            "  {:4}  {:9.4}  {:9.3}  {paper}",
            row.distance_m, row.needed_us, row.needed_for_5_times_us
        ))?;
    }
    for (title, lines) in [("reading", &report.reading), ("assumed", &report.assumptions)] {
        for line in lines {
            print::line(format_args!("{title}: {line}"))?;
        }
    }
    if let Some(out) = &args.out {
        print::line(format_args!(
            "wrote range.png, exposure.png, resolution.png, snr.png, assumptions.png and range.json to {}",
            out.display()
        ))?;
    }
    Ok(())
}
