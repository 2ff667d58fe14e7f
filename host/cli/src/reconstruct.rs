//! `nirspi reconstruct`: an image from measurements, ours or anybody's.

mod enhanced;
mod matrix;
mod stack;

use super::camera::{check_sampling, parse_order};
use super::method::{MethodArgs, Solved, solve};
use super::report::{StageTimes, to_json};
use super::source::{Index, Source, SourceArgs};
use super::{Usage, print};
use anyhow::{Context, Result, bail};
use clap::Parser;
use indicatif::ProgressBar;
use nirspi::account::LossCounters;
use nirspi::files::output::OutputDir;
use nirspi::files::{image::encode_grey, npy};
use nirspi_recon::{Image, Order, metrics, reconstruct};
use serde::Serialize;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

/// Make an image from a measurement file (.npz) or a recording (.mcap)
///
/// Writes image.npy (float32, n x n), image.png and report.json.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi reconstruct wing.npz --method hadamard --out out/\n\
    \x20 nirspi reconstruct wing.npz --method omp --sampling 0.3 --basis dct --out out/\n\
    \x20 nirspi reconstruct dmd.npz --matrix patterns.npy --method tv --out out/\n\
    \x20 nirspi reconstruct rec.mcap --index all --warm-start --sampling 0.3 --out video/")]
pub struct Args {
    #[command(flatten)]
    method: MethodArgs,
    /// Use only this share of all n x n patterns
    #[arg(long, value_name = "0..1", default_value_t = 1.0, allow_negative_numbers = true)]
    sampling: f64,
    /// Which patterns come first when sampling: recorded, or an order's name; default: recorded, unless that is the
    /// natural order, whose first part cannot resolve an image
    #[arg(long, value_name = "ORDER")]
    order: Option<String>,
    /// Patterns of your own instead of Hadamard rows: (M, n * n) weights, a pattern a row, of which `y` in the input has one
    /// reading each. --strength is then relative to the readings' variance
    #[arg(long, value_name = "NPY", conflicts_with_all = ["order", "keep", "residual", "stop_at_noise", "as_printed",
          "non_differential", "keep_leak", "warm_start"])]
    matrix: Option<PathBuf>,
    /// OMP of --index all: start each frame from the one before, as long as that explains it as well
    #[arg(long, conflicts_with_all = ["dictionary", "non_negative"])]
    warm_start: bool,
    #[command(flatten)]
    source: SourceArgs,
    /// Also enlarge and deblur the image, of 32 x 32 or 64 x 64 pixels, by the learned stages (enhanced.npy and .png);
    /// its brightest 2 x 2 pixels are taken for white, of --index all their median
    #[arg(long, conflicts_with = "matrix")]
    enhance: bool,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct DropoutReport {
    first_reading: usize,
    readings: usize,
    rows: Vec<u32>,
}

#[derive(Debug, Serialize)]
struct Report {
    input: PathBuf,
    n: usize,
    measurements: usize,
    used: usize,
    sampling: f64,
    order: String,
    #[serde(flatten)]
    method: super::method::Report,
    dropouts: Vec<DropoutReport>,
    #[serde(skip_serializing_if = "Option::is_none")]
    frames: Option<LossCounters>,
    #[serde(skip_serializing_if = "Option::is_none")]
    correlation_with_files_recon: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    enhancement: Option<enhanced::Report>,
    notes: Vec<String>,
    stage_ms: StageTimes,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    check_sampling(args.sampling)?;
    let order = args.order.as_deref().filter(|o| *o != "recorded").map(parse_order).transpose()?;
    args.method.check()?;
    if let Some(path) = &args.matrix {
        return matrix::run(args, path);
    }
    if args.source.index == Some(Index::All) {
        return stack::run(args, order);
    }
    if args.warm_start {
        return Err(Usage("--warm-start belongs to --index all".to_owned()).into());
    }
    let report = one_image(args, order)?;
    if args.json {
        print::json(&report)?;
    } else {
        say(args, &report)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The frames of a recording as one image, enhanced; the folder `out` gets what `reconstruct --enhance` writes.
pub fn picture(recording: &Path, out: &Path) -> Result<()> {
    #[derive(clap::Parser)]
    struct Alone {
        #[command(flatten)]
        args: Args,
    }
    let line = [OsStr::new("reconstruct"), recording.as_os_str(), OsStr::new("--enhance")];
    let line = line.into_iter().chain([OsStr::new("--out"), out.as_os_str()]);
    one_image(&Alone::try_parse_from(line)?.args, None)?;
    Ok(())
}

/// Reconstructs one image and writes it with its report.
fn one_image(args: &Args, order: Option<Order>) -> Result<Report> {
    let mut times = StageTimes::default();

    let source = times.time("read", || args.source.load())?;
    let all = source.measurements.rows().len();
    let (order, order_name) = choose_order(args, order, &source);
    let used = source
        .measurements
        .take(order.as_ref(), args.sampling)
        .with_context(|| args.source.input.display().to_string())?;
    let solved = times.time("reconstruct", || spinning(|| solve(&args.method, &used)));
    let Solved { image, report: method } = solved?;
    check_finite(args, &image)?;

    let side = image.side().pixels();
    let correlation = source.reference.as_ref().and_then(|reference| {
        metrics::correlation(reference.pixels(), image.pixels(), side, side).ok()
    });
    let (sharp, enhancement) = if args.enhance {
        let (sharp, mut reports) = enhanced::run(&[(&image, used.rows())], &mut times)?;
        (Some(sharp), reports.pop())
    } else {
        (None, None)
    };
    let report = Report {
        input: args.source.input.clone(),
        n: side,
        measurements: all,
        used: used.rows().len(),
        sampling: used.rows().len() as f64 / image.side().area() as f64,
        order: order_name,
        method,
        dropouts: source
            .dropouts
            .iter()
            .map(|d| DropoutReport {
                first_reading: d.start,
                readings: d.length,
                rows: d.rows.clone(),
            })
            .collect(),
        frames: source.frames,
        correlation_with_files_recon: correlation,
        enhancement,
        notes: source.notes,
        stage_ms: times,
    };
    write(args, &image, sharp.as_deref(), &report)?;
    Ok(report)
}

/// Which patterns come first, and what to call that.
fn choose_order(args: &Args, asked: Option<Order>, source: &Source) -> (Option<Order>, String) {
    if let Some(order) = asked {
        let name = order.to_string();
        return (Some(order), name);
    }
    let automatic = reconstruct::default_selection(source.measurements.rows());
    match automatic {
        // All patterns give the same image in any order.
        Some(order) if args.order.is_none() && args.sampling < 1.0 => {
            let name = format!("{order} (the recorded order is the natural one)");
            (Some(order), name)
        }
        _ => (None, "recorded".to_owned()),
    }
}

/// Shows that something is done: thousands of patterns take OMP seconds.
fn spinning<T>(work: impl FnOnce() -> T) -> T {
    let spinner = ProgressBar::new_spinner().with_message("reconstructing");
    spinner.enable_steady_tick(Duration::from_millis(100));
    let done = work();
    spinner.finish_and_clear();
    done
}

fn check_finite(args: &Args, image: &Image) -> Result<()> {
    if image.pixels().iter().all(|pixel| pixel.is_finite()) {
        return Ok(());
    }
    let input = args.source.input.display();
    bail!("{input}: the readings are too large for an image of 32-bit floats")
}

fn write(args: &Args, image: &Image, sharp: Option<&[f32]>, report: &impl Serialize) -> Result<()> {
    let side = image.side().pixels();
    let mut out = OutputDir::create(&args.out)?;
    out.write("image.npy", &npy::encode(&[side, side], image.pixels()))?;
    out.write("image.png", &enlarged_png(&image.stretched()))?;
    if let Some(sharp) = sharp {
        let side = nirspi_nets::deblur::SIDE;
        out.write("enhanced.npy", &npy::encode(&[side, side], sharp))?;
        out.write("enhanced.png", &encode_grey(side, side, sharp))?;
    }
    out.write("report.json", to_json(report)?.as_bytes())?;
    out.commit()?;
    Ok(())
}

/// A PNG whose pixels a person can see: squares, at least 256 px for the whole image.
pub fn enlarged_png(image: &Image) -> Vec<u8> {
    let side = image.side().pixels();
    let factor = (256 / side).max(1);
    let width = side * factor;
    let pixels: Vec<f32> = (0..width * width)
        .map(|p| image.pixels()[p / width / factor * side + p % width / factor])
        .collect();
    encode_grey(width, width, &pixels)
}

fn say(args: &Args, report: &Report) -> Result<()> {
    print::line(format_args!(
        "{}: {} x {}, {} of {} measurements ({:.1} %), order {}",
        args.source.input.display(),
        report.n,
        report.n,
        report.used,
        report.n * report.n,
        report.sampling * 100.0,
        report.order
    ))?;
    for dropout in &report.dropouts {
        print::line(format_args!(
            "drop-out: {} readings from y[{}] on, {} patterns left out",
            dropout.readings,
            dropout.first_reading,
            dropout.rows.len()
        ))?;
    }
    if let Some(frames) = report.frames {
        print::line(format_args!("frames: {frames}"))?;
    }
    print::line(format_args!("{}", report.method))?;
    if let Some(correlation) = report.correlation_with_files_recon {
        print::line(format_args!(
            "correlation with the file's own reconstruction: {correlation:.6}"
        ))?;
    }
    if let Some(enhancement) = &report.enhancement {
        print::line(enhancement.line())?;
    }
    for note in &report.notes {
        print::line(format_args!("note: {note}"))?;
    }
    print::line(format_args!(
        "wrote image.npy, image.png and report.json to {}",
        args.out.display()
    ))
}
