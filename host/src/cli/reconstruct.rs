//! `nirspi reconstruct`: an image from measurements, ours or anybody's.

use super::Usage;
use super::camera::{check_sampling, parse_order};
use super::method::{MethodArgs, Solved, solve};
use super::print;
use super::report::StageTimes;
use anyhow::{Context, Result, bail};
use indicatif::ProgressBar;
use nirspi::account::LossCounters;
use nirspi::files::npz::{self, Readings, Selection};
use nirspi::files::output::OutputDir;
use nirspi::files::{image::encode_grey, npy};
use nirspi::recording::{self, Recording};
use nirspi::tally::tally_recording;
use nirspi_recon::{Dropout, Image, Measurements, Order, metrics, reconstruct};
use serde::Serialize;
use std::io::Read;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// Make an image from a measurement file (.npz) or a recording (.mcap)
///
/// Writes image.npy (float32, n x n), image.png and report.json.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi reconstruct wing.npz --method hadamard --out out/\n\
    \x20 nirspi reconstruct wing.npz --method omp --sampling 0.3 --basis dct --out out/")]
pub struct Args {
    /// Measurement file or recording
    input: PathBuf,
    #[command(flatten)]
    method: MethodArgs,
    /// Use only this share of all n x n patterns
    #[arg(long, value_name = "0..1", default_value_t = 1.0, allow_negative_numbers = true)]
    sampling: f64,
    /// Which patterns come first when sampling: recorded, or an order's name; default: recorded, unless that is the
    /// natural order, whose first part cannot resolve an image
    #[arg(long, value_name = "ORDER")]
    order: Option<String>,
    /// Which measurement of a file that holds several
    #[arg(long, value_name = "N")]
    index: Option<usize>,
    /// The file's `y` holds one reading a pattern, taken without complements
    #[arg(long)]
    non_differential: bool,
    /// Leave the settling leak of a recording as it is
    #[arg(long)]
    keep_leak: bool,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

/// Measurements with what is known about where they come from.
struct Source {
    measurements: Measurements,
    dropouts: Vec<Dropout>,
    reference: Option<Image>,
    frames: Option<LossCounters>,
    notes: Vec<String>,
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
    notes: Vec<String>,
    stage_ms: StageTimes,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    check_sampling(args.sampling)?;
    let order = args.order.as_deref().filter(|o| *o != "recorded").map(parse_order).transpose()?;
    args.method.check()?;
    let mut times = StageTimes::default();

    let source = times.time("read", || load(args))?;
    let all = source.measurements.rows().len();
    let (order, order_name) = choose_order(args, order, &source)?;
    let used = source
        .measurements
        .take(order.as_ref(), args.sampling)
        .with_context(|| args.input.display().to_string())?;
    // Thousands of patterns take OMP seconds.
    let spinner = ProgressBar::new_spinner().with_message("reconstructing");
    spinner.enable_steady_tick(Duration::from_millis(100));
    let solved = times.time("reconstruct", || solve(&args.method, &used));
    spinner.finish_and_clear();
    let Solved { image, report: method } = solved?;
    if !image.pixels().iter().all(|pixel| pixel.is_finite()) {
        bail!("{}: the readings are too large for an image of 32-bit floats", args.input.display());
    }

    let side = image.side().pixels();
    let correlation = source.reference.as_ref().and_then(|reference| {
        metrics::correlation(reference.pixels(), image.pixels(), side, side).ok()
    });
    let report = Report {
        input: args.input.clone(),
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
        notes: source.notes,
        stage_ms: times,
    };
    write(args, &image, &report)?;
    if args.json {
        print::json(&report)?;
    } else {
        say(args, &report)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Which patterns come first, and what to call that.
fn choose_order(
    args: &Args,
    asked: Option<Order>,
    source: &Source,
) -> Result<(Option<Order>, String)> {
    if let Some(order) = asked {
        let name = order.to_string();
        return Ok((Some(order), name));
    }
    let automatic = reconstruct::default_selection(source.measurements.rows());
    match automatic {
        // All patterns give the same image in any order.
        Some(order) if args.order.is_none() && args.sampling < 1.0 => {
            let name = format!("{order} (the recorded order is the natural one)");
            Ok((Some(order), name))
        }
        _ => Ok((None, "recorded".to_owned())),
    }
}

fn load(args: &Args) -> Result<Source> {
    let mut magic = [0; 4];
    let is_mcap = std::fs::File::open(&args.input)
        .and_then(|mut file| file.read_exact(&mut magic))
        .is_ok_and(|()| magic[1..] == *b"MCA");
    let named_mcap = args.input.extension().is_some_and(|e| e == "mcap");
    if is_mcap || named_mcap {
        if args.index.is_some() || args.non_differential {
            let text = "--index and --non-differential belong to .npz files, not to recordings";
            return Err(Usage(text.to_owned()).into());
        }
        from_recording(args)
    } else {
        from_npz(args)
    }
}

fn from_npz(args: &Args) -> Result<Source> {
    let selection = Selection { index: args.index, non_differential: args.non_differential };
    let file = npz::read(&args.input, selection)?;
    let named = || args.input.display().to_string();
    let rows = &file.h_row;
    let mut notes = file.notes;
    let (measurements, dropouts) = match &file.readings {
        Readings::Pairs(y) => Measurements::from_pairs(file.side, rows, y).with_context(named)?,
        Readings::Differential(d) => {
            (Measurements::from_differential(file.side, rows, d).with_context(named)?, Vec::new())
        }
        Readings::Single(y) => {
            let mut measurements =
                Measurements::from_single(file.side, rows, y).with_context(named)?;
            if let Some(level) = measurements.remove_dark_level() {
                notes.push(format!("a dark level of {level:.4} was found in `y` and removed"));
            }
            (measurements, Vec::new())
        }
    };
    Ok(Source { measurements, dropouts, reference: file.reference, frames: None, notes })
}

/// Sums the frames of a recording, counting again what became of each.
fn from_recording(args: &Args) -> Result<Source> {
    let path = &args.input;
    // The setup stands at the start of the file; packets are summed in a second pass.
    let Recording { setup, settling, cut_short, account, .. } = recording::read(path, |_, _| {})?;
    let (integrated, counters) = tally_recording(path, &setup)?;
    if integrated.frames() == 0 {
        bail!("{}: no intact frame in the recording, expected at least one", path.display());
    }
    let mut notes: Vec<String> = integrated.warnings().into_iter().map(str::to_owned).collect();
    if let Some(reason) = cut_short {
        notes.push(format!("the recording is cut short or damaged: {reason}"));
    }
    if account.is_some_and(|account| account != counters) {
        notes.push("the frames found are not those that the capture counted".to_owned());
    }
    if settling.is_none() {
        notes.push("no calibration in the recording: the settling leak stays".to_owned());
    }
    let measurements = integrated
        .measurements(&setup, settling.as_ref(), args.keep_leak)
        .with_context(|| path.display().to_string())?;
    Ok(Source {
        measurements,
        dropouts: Vec::new(),
        reference: None,
        frames: Some(counters),
        notes,
    })
}

fn write(args: &Args, image: &Image, report: &Report) -> Result<()> {
    let side = image.side().pixels();
    let mut out = OutputDir::create(&args.out)?;
    out.write("image.npy", &npy::encode(&[side, side], image.pixels()))?;
    out.write("image.png", &enlarged_png(&image.stretched()))?;
    out.write("report.json", format!("{}\n", serde_json::to_string_pretty(report)?).as_bytes())?;
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
        args.input.display(),
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
    for note in &report.notes {
        print::line(format_args!("note: {note}"))?;
    }
    print::line(format_args!(
        "wrote image.npy, image.png and report.json to {}",
        args.out.display()
    ))
}
