//! `nirspi reconstruct --index all`: every measurement of a file or frame of a recording, as a
//! video.

use super::{Args, print, spinning};
use crate::Usage;
use crate::method::Solved;
use crate::provenance::made;
use crate::report::{StageTimes, stages};
use anyhow::{Context, Result, bail};
use nirspi::files::npy;
use nirspi::files::output::OutputDir;
use nirspi::imaging::{FrameReport as Enhanced, MethodReport, enhance_frames};
use nirspi::picture::{Pictures, Unit};
use nirspi::reconstruct::{check_finite, not_read_words};
use nirspi::source::{FirstPatterns, Index, OutlierReport};
use nirspi_recon::reconstruct::{Method, Reconstruct, Reconstruction, Setting, Stacked};
use nirspi_recon::words::count_of;
use nirspi_recon::{Image, Measurements, Rows};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(Debug, Serialize)]
struct Report {
    input: PathBuf,
    n: usize,
    order: String,
    warm_start: bool,
    frames: Vec<FrameReport>,
    pictures: Pictures,
    stage_ms: StageTimes,
}

#[derive(Debug, Serialize)]
struct FrameReport {
    used: usize,
    /// Whether the frame started from the previous one.
    warm: bool,
    #[serde(flatten)]
    method: MethodReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    enhancement: Option<Enhanced>,
    outliers: Vec<OutlierReport>,
    warnings: Vec<String>,
    notes: Vec<String>,
}

pub fn run(args: &Args, first: &FirstPatterns) -> Result<ExitCode> {
    if args.warm_start && !args.method.method.takes(Setting::WarmStart) {
        let methods = Method::listed(|method| method.takes(Setting::WarmStart));
        return Err(Usage(format!("--warm-start belongs to --method {methods}")).into());
    }
    let mut times = stages();
    let sources = times.time("read", || args.source.load_all())?;
    let named = || args.source.input.display().to_string();
    if sources.is_empty() {
        bail!("{}: no measurement in it", named());
    }
    let (used, orders): (Vec<Measurements>, Vec<String>) = sources
        .iter()
        .map(|source| first.take(&source.measurements, args.sampling.share()))
        .collect::<Result<_, _>>()
        .with_context(named)?;
    let solved = times.time("reconstruct", || spinning(|| solve_all(args, &used)))?;
    // Imaginary parts of complex readings: all frames of a file have one, or none has.
    let imaginary: Vec<Measurements> = sources
        .iter()
        .filter_map(|source| source.imaginary.as_ref())
        .map(|imaginary| Ok(first.take(imaginary, args.sampling.share())?.0))
        .collect::<Result<_>>()
        .with_context(named)?;
    if args.enhance && !imaginary.is_empty() {
        return Err(Usage(
            "--enhance needs real images: choose --part real or --part imaginary".to_owned(),
        )
        .into());
    }
    let others = times.time("reconstruct", || spinning(|| solve_all(args, &imaginary)))?;
    let mut others = others.into_iter();
    let (mut images, mut frames) = (Vec::new(), Vec::new());
    let mut given = Vec::new();
    let unit = Unit::of_readings(sources[0].frames.is_some());
    let provenance = sources[0].taken.made(made());
    for (made, (used, source)) in solved.into_iter().zip(used.iter().zip(sources)) {
        let warm = made.report.warm;
        let Solved { mut image, with_readings, report } = args.method.solved(made, used);
        if let Some(other) = others.next() {
            image = Image::magnitude(&image, &other.image);
        }
        check_finite(&args.source.input, &image)?;
        let image = source.flattened(image);
        given.push(source.flattened(with_readings));
        let dropped = |d: &nirspi_recon::Dropout| {
            format!("drop-out: {} from y[{}] on", count_of(d.length, "reading"), d.start)
        };
        let mut notes: Vec<String> = source.dropouts.iter().map(dropped).collect();
        if !source.not_read.is_empty() {
            notes.push(not_read_words(&source.not_read));
        }
        let outliers: Vec<_> = source.outliers.iter().map(OutlierReport::of).collect();
        let warnings = source.warnings;
        notes.extend(source.notes);
        let used = used.rows().len();
        frames.push(FrameReport {
            used,
            warm,
            method: report,
            enhancement: None,
            outliers,
            warnings,
            notes,
        });
        images.push(image);
    }
    let mut sharp = None;
    if args.enhance {
        let made: Vec<(&Image, &Rows)> =
            given.iter().zip(&used).map(|(image, used)| (image, used.rows())).collect();
        let (pixels, reports) =
            spinning(|| enhance_frames(&made, &mut times)).context("--enhance")?;
        for (frame, report) in frames.iter_mut().zip(reports) {
            frame.enhancement = Some(report);
        }
        sharp = Some(pixels);
    }
    let n = images[0].side().pixels();
    let short = |at: &usize| frames[*at].enhancement.as_ref().is_some_and(|e| !e.short.is_empty());
    let warned = (0..frames.len()).filter(short).collect();
    let sharp_and_warned = sharp.as_deref().map(|sharp| (sharp, warned));
    let pictures = Pictures::of_video(&named(), &images, unit, sharp_and_warned, &provenance);
    let report = Report {
        input: args.source.input.clone(),
        n,
        order: orders.into_iter().next().unwrap_or_default(),
        warm_start: args.warm_start,
        frames,
        pictures,
        stage_ms: times,
    };
    let mut out = OutputDir::create(&args.out)?;
    let pixels: Vec<f32> = images.iter().flat_map(Image::pixels).copied().collect();
    out.write("image.npy", &npy::encode(&[images.len(), n, n], &pixels))?;
    if let Some(sharp) = sharp {
        let side = nirspi_nets::deblur::SIDE;
        out.write("enhanced.npy", &npy::encode(&[images.len(), side, side], &sharp))?;
    }
    report.pictures.write(&mut out)?;
    out.write("report.json", provenance.sign(&report)?.as_bytes())?;
    out.commit()?;
    args.report.print(&report, &provenance, |report| say(args, report))
}

/// The image of each frame.
fn solve_all(args: &Args, used: &[Measurements]) -> Result<Vec<Reconstruction>> {
    let Some(first) = used.first() else { return Ok(Vec::new()) };
    let method = Stacked::new(args.method.prepare(first.side().pixels())?);
    Ok(match args.warm_start {
        true => method.reconstruct_video(used)?,
        false => used.iter().map(|used| method.reconstruct(used)).collect::<Result<_, _>>()?,
    })
}

fn say(args: &Args, report: &Report) -> Result<()> {
    let warm = report.frames.iter().filter(|frame| frame.warm).count();
    let what = if args.source.detector == Some(Index::All) { "detector" } else { "frame" };
    print::line(format_args!(
        "{}: {} of {} x {}, order {}, {warm} started from the frame before, {:.3} ms a {what}",
        report.input.display(),
        count_of(report.frames.len(), what),
        report.n,
        report.n,
        report.order,
        report.stage_ms.of("reconstruct") / report.frames.len() as f64,
    ))?;
    if let Some(last) = report.frames.last() {
        print::line(format_args!(
            "the last: {}, {}",
            count_of(last.used, "measurement"),
            last.method
        ))?;
    }
    for (at, frame) in report.frames.iter().enumerate() {
        let warnings = frame.enhancement.iter().flat_map(|enhancement| &enhancement.warnings);
        for outlier in &frame.outliers {
            print::line(format_args!("{what} {at}: {outlier}"))?;
        }
        for warning in warnings.chain(&frame.warnings) {
            print::line(format_args!("warning: {what} {at}: {warning}"))?;
        }
        for note in &frame.notes {
            print::note(format_args!("{what} {at}: {note}"))?;
        }
    }
    let enhanced = if args.enhance { ", enhanced.npy" } else { "" };
    print::line(format_args!(
        "wrote image.npy{enhanced}, {} and report.json to {}",
        report.pictures,
        args.out.display()
    ))
}
