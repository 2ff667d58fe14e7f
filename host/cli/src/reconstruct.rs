//! `nirspi reconstruct`: an image from measurements of nirspi or of another lab.

mod matrix;
mod stack;

use super::camera::parse_order;
use super::method::{MethodArgs, Solved, solve};
use super::progress::Progress;
use super::report::{ReportArgs, StageTimes, stages, to_json};
use super::source::SourceArgs;
use super::{Usage, print};
use anyhow::{Context, Result, bail};
use nirspi::account::LossCounters;
use nirspi::calibration::KeptFlatField;
use nirspi::capture::Capture;
use nirspi::files::npy;
use nirspi::files::output::OutputDir;
use nirspi::imaging::{FrameReport, MethodReport, enhance_frames};
use nirspi::picture::{Pictures, Unit};
use nirspi::source::{FirstPatterns, Index, Part, Source};
use nirspi_recon::words::count_of;
use nirspi_recon::{Image, Sampling, metrics};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Make an image from a measurement file (.npz, .npy, .mat, .h5, .csv, .txt) or a recording (.mcap)
///
/// The command writes image.npy (float32, n x n), image.png and report.json. For complex readings it also writes real.npy
/// and imaginary.npy.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi reconstruct wing.npz --out out/\n\
    \x20 nirspi reconstruct wing.npz --method omp --sampling 30% --basis dct --out out/\n\
    \x20 nirspi reconstruct spyrit.npy --shown walsh-2d --out out/\n\
    \x20 nirspi reconstruct dmd.npz --matrix patterns.npy --method tv --out out/\n\
    \x20 nirspi reconstruct rec.mcap --index all --method omp --warm-start --sampling 0.3 --out video/")]
pub struct Args {
    /// Share of all n x n patterns to use: 0.3, 30% or 30
    #[arg(long, value_name = "SHARE", default_value_t = Sampling::ALL)]
    sampling: Sampling,
    /// Which patterns --sampling uses: the first of this order, by its name, or of the order in which they were shown
    /// (recorded) [default: the patterns of the lowest sequencies, whatever order was recorded]
    #[arg(long, value_name = "ORDER")]
    order: Option<String>,
    #[command(flatten)]
    method: MethodArgs,
    /// Patterns of your own instead of Hadamard rows: (M, n * n) weights, one pattern in each row. `y` in the input then has
    /// one reading for each pattern, and --strength is relative to the variance of the readings
    #[arg(long, value_name = "NPY", conflicts_with_all = ["order", "keep", "residual", "stop_at_noise", "as_printed",
          "non_differential", "readings", "shown", "side", "transpose", "keep_leak", "warm_start"])]
    matrix: Option<PathBuf>,
    /// OMP with --index all: start each frame from the frame before, as long as the result explains the readings as well
    #[arg(long, conflicts_with_all = ["dictionary", "non_negative"])]
    warm_start: bool,
    /// Also enlarge and deblur an image of 32 x 32 or 64 x 64 pixels by networks (enhanced.npy and enhanced.png). The mean
    /// of the brightest 2 x 2 pixels counts as white; with --index all, the median of these means
    #[arg(long, conflicts_with = "matrix")]
    enhance: bool,
    #[command(flatten)]
    source: SourceArgs,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    #[command(flatten)]
    report: ReportArgs,
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
    method: MethodReport,
    dropouts: Vec<DropoutReport>,
    /// Positions in the order shown of patterns that the file marks as not read.
    not_read: Vec<usize>,
    /// The part of complex readings in image.npy.
    #[serde(skip_serializing_if = "Option::is_none")]
    part: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    frames: Option<LossCounters>,
    #[serde(skip_serializing_if = "Option::is_none")]
    correlation_with_files_recon: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    enhancement: Option<FrameReport>,
    notes: Vec<String>,
    /// What is black and white in the pictures.
    pictures: Pictures,
    stage_ms: StageTimes,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let first = match args.order.as_deref() {
        None => FirstPatterns::LowestSequencies,
        Some("recorded") => FirstPatterns::Recorded,
        Some(order) => FirstPatterns::Of(parse_order("--order", order)?),
    };
    args.method.check()?;
    if let Some(path) = &args.matrix {
        return matrix::run(args, path);
    }
    if args.source.index == Some(Index::All) {
        return stack::run(args, &first);
    }
    if args.warm_start {
        return Err(Usage("--warm-start belongs to --index all".to_owned()).into());
    }
    let mut times = stages();
    let source = times.time("read", || args.source.load())?;
    let request = Request {
        input: &args.source.input,
        method: &args.method,
        first: &first,
        sampling: args.sampling.share(),
        enhance: args.enhance,
        out: &args.out,
    };
    let report = one_image(&request, source, times)?;
    args.report.print(&report, |report| say(args, report))
}

/// Reconstructs and enhances the frames of a capture as one image. The folder `out` gets the files
/// of `reconstruct --enhance`.
pub fn picture(
    captured: &Capture,
    flat_field: Option<KeptFlatField>,
    recording: &Path,
    out: &Path,
) -> Result<Vec<String>> {
    let request = Request {
        input: recording,
        method: &MethodArgs::default(),
        first: &FirstPatterns::LowestSequencies,
        sampling: 1.0,
        enhance: true,
        out,
    };
    let mut source = Source::of_capture(captured)?;
    if let Some(kept) = flat_field {
        source = source.with_flat_field(kept);
    }
    let report = one_image(&request, source, stages())?;
    Ok(report.enhancement.map(|enhancement| enhancement.warnings).unwrap_or_default())
}

/// The reconstruction of one measurement.
struct Request<'r> {
    input: &'r Path,
    method: &'r MethodArgs,
    first: &'r FirstPatterns,
    sampling: f64,
    enhance: bool,
    out: &'r Path,
}

/// Reconstructs one image and writes it with its report.
fn one_image(request: &Request<'_>, source: Source, mut times: StageTimes) -> Result<Report> {
    let all = source.measurements.rows().len();
    let named = || request.input.display().to_string();
    let (used, order_name) =
        request.first.take(&source.measurements, request.sampling).with_context(named)?;
    let solved = times.time("reconstruct", || spinning(|| solve(request.method, &used)));
    let Solved { image, report: method } = solved?;
    let parts = match &source.imaginary {
        None => None,
        Some(_) if request.enhance => {
            return Err(Usage(
                "--enhance needs a real image: choose --part real or --part imaginary".to_owned(),
            )
            .into());
        }
        Some(imaginary) => {
            let (used, _) = request.first.take(imaginary, request.sampling).with_context(named)?;
            let other =
                times.time("reconstruct", || spinning(|| solve(request.method, &used)))?.image;
            Some([image.clone(), other])
        }
    };
    let image = match &parts {
        None => image,
        Some([real, imaginary]) => Image::magnitude(real, imaginary),
    };
    check_finite(request.input, &image)?;
    let image = source.flattened(image);

    let side = image.side().pixels();
    let correlation = source.reference.as_ref().and_then(|reference| {
        metrics::correlation(reference.pixels(), image.pixels(), side, side).ok()
    });
    let (sharp, enhancement) = if request.enhance {
        let (sharp, mut reports) =
            enhance_frames(&[(&image, used.rows())], &mut times).context("--enhance")?;
        (Some(sharp), reports.pop())
    } else {
        (None, None)
    };
    let unit = Unit::of_readings(source.frames.is_some());
    let short = enhancement.as_ref().map(|enhancement| enhancement.short.clone());
    let report = Report {
        pictures: Pictures::of_image(&image, unit, sharp.as_deref().zip(short)),
        input: request.input.to_owned(),
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
        not_read: source.not_read,
        part: parts.as_ref().map(|_| Part::Magnitude.name()),
        frames: source.frames,
        correlation_with_files_recon: correlation,
        enhancement,
        notes: source.notes,
        stage_ms: times,
    };
    write(request.out, &image, parts.as_ref(), sharp.as_deref(), &report.pictures, &report)?;
    Ok(report)
}

/// Shows that the program works, because OMP takes seconds for thousands of patterns.
fn spinning<T>(work: impl FnOnce() -> T) -> T {
    let _progress = Progress::working("reconstructing");
    work()
}

fn check_finite(input: &Path, image: &Image) -> Result<()> {
    if image.pixels().iter().all(|pixel| pixel.is_finite()) {
        return Ok(());
    }
    bail!("{}: the readings are too large for an image of 32-bit floats", input.display())
}

/// Writes an image, the real and imaginary part of a complex image, the enhanced image, if there is
/// one, and the pictures.
fn write(
    out: &Path,
    image: &Image,
    parts: Option<&[Image; 2]>,
    sharp: Option<&[f32]>,
    pictures: &Pictures,
    report: &impl Serialize,
) -> Result<()> {
    let side = image.side().pixels();
    let mut out = OutputDir::create(out)?;
    out.write("image.npy", &npy::encode(&[side, side], image.pixels()))?;
    for (name, part) in ["real.npy", "imaginary.npy"].iter().zip(parts.into_iter().flatten()) {
        out.write(name, &npy::encode(&[side, side], part.pixels()))?;
    }
    if let Some(sharp) = sharp {
        let side = nirspi_nets::deblur::SIDE;
        out.write("enhanced.npy", &npy::encode(&[side, side], sharp))?;
    }
    pictures.write(&mut out)?;
    out.write("report.json", to_json(report)?.as_bytes())?;
    out.commit()?;
    Ok(())
}

/// The number of patterns that were not read, and the first of them, in words.
fn not_read_words(places: &[usize]) -> String {
    const SHOWN: usize = 5;
    let first: Vec<String> = places.iter().take(SHOWN).map(usize::to_string).collect();
    let more = if places.len() > SHOWN { ", ..." } else { "" };
    let patterns = count_of(places.len(), "pattern");
    format!("not read: {patterns} left out, at [{}{more}] of those shown", first.join(", "))
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
            "drop-out: {} from y[{}] on, {} left out",
            count_of(dropout.readings, "reading"),
            dropout.first_reading,
            count_of(dropout.rows.len(), "pattern")
        ))?;
    }
    if !report.not_read.is_empty() {
        print::line(not_read_words(&report.not_read))?;
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
        for warning in &enhancement.warnings {
            print::line(format_args!("warning: {warning}"))?;
        }
    }
    print::notes(&report.notes)?;
    let enhanced = if args.enhance { ", enhanced.npy, enhanced.png" } else { "" };
    let parts =
        if report.part.is_some() { " (the magnitude), real.npy, imaginary.npy" } else { "" };
    print::line(format_args!(
        "wrote image.npy, image.png{parts}{enhanced} and report.json to {}",
        args.out.display()
    ))
}
