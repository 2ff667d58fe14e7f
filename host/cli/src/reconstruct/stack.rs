//! `nirspi reconstruct --index all`: every measurement of a file or frame of a recording, as a
//! video; and what many files give, as one stack.

use super::{Args, print, spinning};
use crate::Usage;
use crate::method::Solved;
use crate::provenance::made;
use crate::report::{StageTimes, stages};
use anyhow::{Context, Result, bail};
use nirspi::files::npy;
use nirspi::files::output::OutputDir;
use nirspi::imaging::{
    Enhance, FrameReport as Enhanced, FramesError, MethodReport, enhance_frames_by,
};
use nirspi::picture::{Pictures, Unit};
use nirspi::provenance::Provenance;
use nirspi::reconstruct::{Skipped, check_finite, losses};
use nirspi::source::{FirstPatterns, OutlierReport};
use nirspi_nets::Device;
use nirspi_recon::reconstruct::{Method, Reconstruct, Reconstruction, Setting, Stacked};
use nirspi_recon::words::count_of;
use nirspi_recon::{Image, Measurements, Rows};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(Debug, Serialize)]
pub struct Report {
    input: PathBuf,
    pub n: usize,
    pub order: String,
    warm_start: bool,
    pub frames: Vec<FrameReport>,
    /// Files without an image.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<Skipped>,
    pub pictures: Pictures,
    stage_ms: StageTimes,
}

#[derive(Debug, Serialize)]
pub struct FrameReport {
    /// The file, if there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Number of the measurement in this file, if it has several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub index: Option<usize>,
    pub used: usize,
    /// Whether the frame started from the previous one.
    pub warm: bool,
    #[serde(flatten)]
    pub method: MethodReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub enhancement: Option<Enhanced>,
    pub outliers: Vec<OutlierReport>,
    pub warnings: Vec<String>,
    pub notes: Vec<String>,
}

/// A stack that was made.
pub struct Made {
    /// What was named, for the pictures.
    pub named: String,
    pub images: Vec<Image>,
    /// Lengths of the stretches of images that have one white level.
    pub stretches: Vec<usize>,
    /// The images with the readings as they are, for networks, and the patterns of each.
    pub given: Vec<(Image, Rows)>,
    pub unit: Unit,
    pub provenance: Provenance,
    pub order: String,
    pub frames: Vec<FrameReport>,
    pub skipped: Vec<Skipped>,
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
    let unit = Unit::of_readings(sources[0].frames.is_some());
    let provenance = sources[0].taken.made(made());
    let (mut images, mut given, mut frames) = (Vec::new(), Vec::new(), Vec::new());
    for (at, (made, (used, source))) in solved.into_iter().zip(used.iter().zip(sources)).enumerate()
    {
        let warm = made.report.warm;
        let Solved { mut image, with_readings, report } = args.method.solved(made, used);
        if let Some(other) = others.next() {
            image = Image::magnitude(&image, &other.image);
        }
        check_finite(&args.source.input, &image)?;
        images.push(source.flattened(image));
        given.push((source.flattened(with_readings), used.rows().clone()));
        frames.push(FrameReport {
            file: None,
            index: None,
            used: used.rows().len(),
            warm,
            method: report,
            enhancement: None,
            outliers: source.outliers.iter().map(OutlierReport::of).collect(),
            notes: losses(&source).chain(source.notes.iter().cloned()).collect(),
            // The frames of one recording lack the same.
            warnings: if at == 0 { source.all_warnings() } else { source.warnings },
        });
    }
    let order = orders.into_iter().next().unwrap_or_default();
    let (stretches, skipped) = (vec![images.len()], Vec::new());
    let named = named();
    let made = Made { named, images, stretches, given, unit, provenance, order, frames, skipped };
    let (report, provenance) = write(args, made, times)?;
    args.report.print(&report, &provenance, |report| say(args, report))
}

/// Enhances the stack if that is asked for, and writes it with its pictures and its report.
pub fn write(args: &Args, made: Made, mut times: StageTimes) -> Result<(Report, Provenance)> {
    let Made { named, images, stretches, given, unit, provenance, order, mut frames, skipped } =
        made;
    let mut sharp = None;
    if args.enhance {
        let (pixels, reports) =
            spinning(|| enhanced(&given, &stretches, &mut times)).context("--enhance")?;
        for (frame, report) in frames.iter_mut().zip(reports) {
            frame.enhancement = Some(report);
        }
        sharp = Some(pixels);
    }
    let n = images[0].side().pixels();
    let short = |at: &usize| frames[*at].enhancement.as_ref().is_some_and(|e| !e.short.is_empty());
    let warned = (0..frames.len()).filter(short).collect();
    let sharp_and_warned = sharp.as_deref().map(|sharp| (sharp, warned));
    let pictures = Pictures::of_video(&named, &images, unit, sharp_and_warned, &provenance);
    let report = Report {
        input: args.source.input.clone(),
        n,
        order,
        warm_start: args.warm_start,
        frames,
        skipped,
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
    Ok((report, provenance))
}

/// The enhanced pixels of all images, and a report of each.
fn enhanced(
    given: &[(Image, Rows)],
    stretches: &[usize],
    times: &mut StageTimes,
) -> Result<(Vec<f32>, Vec<Enhanced>), FramesError> {
    let networks = Enhance::built_in(&Device::cpu())?;
    let given: Vec<(&Image, &Rows)> = given.iter().map(|(image, rows)| (image, rows)).collect();
    let (mut rest, mut pixels, mut reports) = (&given[..], Vec::new(), Vec::new());
    for &length in stretches {
        let (stretch, after) = rest.split_at(length);
        let (mut made, mut told) = enhance_frames_by(&networks, stretch, times)?;
        pixels.append(&mut made);
        reports.append(&mut told);
        rest = after;
    }
    Ok((pixels, reports))
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
    print::line(format_args!(
        "{}: {} of {} x {}, order {}, {warm} started from the frame before, {:.3} ms a frame",
        report.input.display(),
        count_of(report.frames.len(), "frame"),
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
            print::line(format_args!("frame {at}: {outlier}"))?;
        }
        for warning in warnings.chain(&frame.warnings) {
            print::warning(format_args!("frame {at}: {warning}"));
        }
        for note in &frame.notes {
            print::note(format_args!("frame {at}: {note}"))?;
        }
    }
    let enhanced = if args.enhance { ", enhanced.npy" } else { "" };
    print::line(format_args!(
        "wrote image.npy{enhanced}, {} and report.json to {}",
        report.pictures,
        args.out.display()
    ))
}
