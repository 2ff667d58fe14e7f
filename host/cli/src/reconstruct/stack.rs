//! `nirspi reconstruct --index all`: every measurement of a file or frame of a recording, as a
//! video.

use super::{Args, print, spinning};
use crate::Usage;
use crate::provenance::made;
use crate::report::{StageTimes, stages};
use anyhow::{Result, bail};
use nirspi::reconstruct::{
    ManyImages, StackFolder, StackFolderError, StackReport, file_images, write_stack,
};
use nirspi::source::FirstPatterns;
use nirspi_recon::reconstruct::{Method, Setting};
use nirspi_recon::words::count_of;
use std::process::ExitCode;

pub fn run(args: &Args, first: FirstPatterns) -> Result<ExitCode> {
    if args.warm_start && !args.method.method.takes(Setting::WarmStart) {
        let methods = Method::listed(|method| method.takes(Setting::WarmStart));
        return Err(Usage(format!("--warm-start belongs to --method {methods}")).into());
    }
    let mut times = stages();
    let solver = args.method.solver(first, args.sampling)?;
    let input = &args.source.input;
    let sources = times.time("read", || args.source.load_all())?;
    if sources.is_empty() {
        bail!("{}: no measurement in it", input.display());
    }
    let solve = || file_images(input, sources, &solver, args.warm_start);
    let images = times.time("reconstruct", || spinning(solve))?;
    let many = ManyImages { images, skipped: Vec::new() };
    let report = write(args, many, input.display().to_string(), false, times)?;
    args.report.print(&report, report.pictures.provenance(), |report| say(args, report))
}

/// Enhances the stack if that is asked for, and writes it with its pictures and its report.
pub fn write(
    args: &Args,
    images: ManyImages,
    named: String,
    many: bool,
    times: StageTimes,
) -> Result<StackReport> {
    let folder = StackFolder {
        input: &args.source.input,
        named,
        many,
        warm_start: args.warm_start,
        enhance: args.enhance.then(|| args.method.device()).transpose()?,
        out: &args.out,
        made: made(),
        figure: args.figure.figure,
    };
    spinning(|| write_stack(&folder, images, times)).map_err(|error| match error {
        StackFolderError::Complex => Usage(error.to_string()).into(),
        error => error.into(),
    })
}

fn say(args: &Args, report: &StackReport) -> Result<()> {
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
