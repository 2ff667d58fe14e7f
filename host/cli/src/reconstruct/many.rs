//! `nirspi reconstruct FILE FILE ...` and `nirspi reconstruct DIR`: the images of many files, as one
//! stack.

use super::stack::write;
use super::{Args, print};
use crate::Usage;
use crate::progress::Progress;
use crate::report::stages;
use anyhow::{Result, bail};
use nirspi::files::folder::measurement_files;
use nirspi::reconstruct::{StackReport, many_images};
use nirspi::source::FirstPatterns;
use nirspi_recon::words::count_of;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

pub fn run(args: &Args, first: FirstPatterns) -> Result<ExitCode> {
    if args.warm_start || args.matrix.is_some() {
        let name = if args.warm_start { "--warm-start" } else { "--matrix" };
        return Err(Usage(format!("{name} belongs to a single file")).into());
    }
    let named: Vec<_> = std::iter::once(&args.source.input).chain(&args.more).cloned().collect();
    let files = measurement_files(&named)?;
    let options = args.source.options()?;
    let solver = args.method.solver(first, args.sampling)?;
    let mut times = stages();
    let bar = Progress::of("reconstructing", files.len(), "files");
    let many = times.time("reconstruct", || many_images(&files, &options, &solver, &|| bar.add(1)));
    drop(bar);
    if many.images.is_empty() {
        let reason = many.skipped.first().map(|skipped| skipped.reason.as_str());
        let reason = reason.unwrap_or_default();
        bail!("none of {} gave an image; the first: {reason}", count_of(files.len(), "file"));
    }
    let named = match &named[..] {
        [folder] => folder.display().to_string(),
        all => count_of(all.len(), "name"),
    };
    let report = write(args, many, named, true, times)?;
    let provenance = report.pictures.provenance();
    let code = args.report.print(&report, provenance, |report| say(args, &files, report))?;
    if report.skipped.is_empty() {
        return Ok(code);
    }
    let (count, all) = (report.skipped.len(), count_of(files.len(), "file"));
    print::complain(format_args!("{}: {count} of {all} gave no image", args.out.display()));
    Ok(ExitCode::FAILURE)
}

fn say(args: &Args, files: &[PathBuf], report: &StackReport) -> Result<()> {
    for skipped in &report.skipped {
        print::note(format_args!("skipped: {}", skipped.reason))?;
    }
    for frame in &report.frames {
        let file = frame.file.as_deref().unwrap_or(Path::new("")).display();
        let at = frame.index.map(|index| format!(", {index}")).unwrap_or_default();
        for outlier in &frame.outliers {
            print::line(format_args!("{file}{at}: {outlier}"))?;
        }
        let enhanced = frame.enhancement.iter().flat_map(|enhancement| &enhancement.warnings);
        for warning in enhanced.chain(&frame.warnings) {
            print::warning(format_args!("{file}{at}: {warning}"));
        }
    }
    let (images, n) = (count_of(report.frames.len(), "image"), report.n);
    let files = count_of(files.len(), "file");
    print::line(format_args!("{images} of {n} x {n} of {files}, order {}", report.order))?;
    let enhanced = if args.enhance { ", enhanced.npy" } else { "" };
    print::line(format_args!(
        "wrote image.npy{enhanced}, {} and report.json to {}",
        report.pictures,
        args.out.display()
    ))
}
