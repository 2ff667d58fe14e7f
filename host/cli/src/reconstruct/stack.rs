//! `nirspi reconstruct --index all`, `nirspi reconstruct FILE FILE ...` and `nirspi reconstruct DIR`: a stack of images, of the
//! frames of a recording, of the measurements of a file, or of many files.

use super::{Args, failure, print, wrote};
use crate::Usage;
use crate::progress::Progress;
use crate::provenance::made;
use crate::report::stages;
use anyhow::Result;
use nirspi::files::folder::measurement_files;
use nirspi::files::interrupt;
use nirspi::reconstruct::{Kind, ResultFolder, StackReport, Step};
use nirspi::source::{FirstPatterns, Sources};
use nirspi_recon::reconstruct::{Method, Setting};
use nirspi_recon::words::count_of;
use std::process::ExitCode;
use std::sync::OnceLock;
use std::sync::atomic::Ordering;

/// The measurements of one file.
pub fn of_file(args: &Args, first: FirstPatterns) -> Result<ExitCode> {
    if args.warm_start && !args.method.method.takes(Setting::WarmStart) {
        let methods = Method::listed(|method| method.takes(Setting::WarmStart));
        return Err(Usage(format!("--warm-start belongs to --method {methods}")).into());
    }
    let pipeline = args.method.pipeline(first, args.sampling, args.enhance)?;
    let mut times = stages();
    let options = args.source.options()?;
    let input = &args.source.input;
    let sources = times.time("read", || Sources::open(input, &options));
    let sources = sources.map_err(|error| failure(error.into()))?;
    let folder = ResultFolder { warm_start: args.warm_start, ..folder(args) };
    let bars = Bars::new(sources.len(), "frames");
    let made = pipeline.all(sources, &folder, &|step| bars.step(step), times);
    drop(bars);
    finish(args, made.map_err(failure)?, false, |report| {
        report.words().iter().try_for_each(print::line)
    })
}

/// The measurements of many files.
pub fn of_files(args: &Args, first: FirstPatterns) -> Result<ExitCode> {
    if args.warm_start || args.matrix.is_some() {
        let name = if args.warm_start { "--warm-start" } else { "--matrix" };
        return Err(Usage(format!("{name} belongs to a single file")).into());
    }
    let named: Vec<_> = std::iter::once(&args.source.input).chain(&args.more).cloned().collect();
    let files = measurement_files(&named)?;
    let options = args.source.options()?;
    let pipeline = args.method.pipeline(first, args.sampling, args.enhance)?;
    let named = match &named[..] {
        [folder] => folder.display().to_string(),
        all => count_of(all.len(), "name"),
    };
    let folder = ResultFolder { named, many: true, ..folder(args) };
    let bars = Bars::new(files.len(), "files");
    let made = pipeline.files(&files, &options, &folder, &|step| bars.step(step), stages());
    drop(bars);
    let report = made.map_err(failure)?;
    let skipped = report.skipped.len();
    let code = finish(args, report, true, |report| {
        for skipped in &report.skipped {
            print::note(format_args!("skipped: {}", skipped.reason))?;
        }
        let (images, n) = (count_of(report.frames.len(), "image"), report.n);
        let files = count_of(files.len(), "file");
        print::line(format_args!("{images} of {n} x {n} of {files}, order {}", report.order))
    })?;
    if skipped == 0 {
        return Ok(code);
    }
    let (out, files) = (args.out.display(), count_of(files.len(), "file"));
    print::complain(format_args!("{out}: {skipped} of {files} gave no image"));
    Ok(ExitCode::FAILURE)
}

fn folder(args: &Args) -> ResultFolder<'_> {
    ResultFolder::of_file(&args.source.input, &args.out, made(), args.figure.figure)
}

/// Progress on a terminal, and whether the user has asked to stop.
struct Bars {
    of: (usize, &'static str),
    made: Progress,
    enhanced: OnceLock<Progress>,
}

impl Bars {
    fn new(count: usize, unit: &'static str) -> Self {
        let made = Progress::of("reconstructing", count, unit);
        Self { of: (count, unit), made, enhanced: OnceLock::new() }
    }

    fn step(&self, step: Step) -> bool {
        let enhancing = || Progress::of("enhancing", self.of.0, self.of.1);
        match step {
            Step::Reconstruct => self.made.add(1),
            Step::Enhance => self.enhanced.get_or_init(enhancing).add(1),
        }
        !interrupt::stop_flag().load(Ordering::Relaxed)
    }
}

fn finish(
    args: &Args,
    report: StackReport,
    many: bool,
    say: impl FnOnce(&StackReport) -> Result<()>,
) -> Result<ExitCode> {
    let code = args.report.print(&report, report.pictures.provenance(), |report| {
        say(report)?;
        for said in report.said.texts() {
            let words = said.words(many);
            match said.kind {
                Kind::Outlier => print::line(words)?,
                Kind::Warning => print::warning(words),
                Kind::Note => print::note(words)?,
            }
        }
        if let more @ 1.. = report.said.left_out() {
            print::note(format_args!("{more} more such lines are in report.json"))?;
        }
        let enhanced = if report.enhanced { ", enhanced.npy" } else { "" };
        wrote(format_args!("image.npy{enhanced}, {}", report.pictures), &args.out)
    })?;
    let Some(reason) = &report.ended else { return Ok(code) };
    let images = count_of(report.frames.len(), "image");
    print::complain(format_args!("{}: {images}, then: {reason}", args.out.display()));
    Ok(ExitCode::FAILURE)
}
