//! `nirspi reconstruct`: an image from measurements of nirspi or of another lab.

mod matrix;
mod stack;

use super::camera::parse_order;
use super::method::MethodArgs;
use super::progress::Progress;
use super::provenance::made;
use super::report::{FigureArgs, ReportArgs, StageTimes, stages};
use super::source::{SourceArgs, usage_or_failure};
use super::{Usage, print};
use anyhow::Result;
use nirspi::files::output::OutputDir;
use nirspi::imaging::Enhance;
use nirspi::reconstruct::{OneReport, Pipeline, PipelineError, ResultFolder};
use nirspi::source::{FirstPatterns, Index, Source};
use nirspi_recon::{Sampling, Size};
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Make an image of a measurement or a recording, or a stack of many
///
/// The command writes image.npy (float32, n x n), image.png and report.json. For complex readings it also writes real.npy
/// and imaginary.npy. From several files, or from a folder, it makes one stack: image.npy has the images of all measurements,
/// (F, n, n), and report.json the file of each. Files that give no image are named, and make the exit code 1.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi reconstruct wing.npz --out out/\n\
    \x20 nirspi reconstruct wing.npz --method omp --sampling 30% --basis dct --out out/\n\
    \x20 nirspi reconstruct spyrit.npy --shown walsh-2d --out out/\n\
    \x20 nirspi reconstruct dmd.npz --matrix patterns.npy --method tv --out out/\n\
    \x20 nirspi reconstruct rec.mcap --index all --warm-start --sampling 0.3 --out video/\n\
    \x20 nirspi reconstruct monday/ friday.npz --sampling 30% --out week/")]
pub struct Args {
    /// Share of all n x n patterns to use: 0.3 or 30%
    #[arg(long, value_name = "SHARE", default_value_t = Sampling::ALL)]
    sampling: Sampling,
    /// Which patterns --sampling uses: the first of this order, by its name, or of the order in which they were shown
    /// (recorded) [default: the patterns of the lowest sequencies, whatever order was recorded]
    #[arg(long, value_name = "ORDER")]
    first_of: Option<String>,
    #[command(flatten)]
    method: MethodArgs,
    /// Patterns of your own instead of Hadamard rows: fourier:3, fourier:4 or s-matrix:N; a file of any format with one pattern in each row, (M, height * width),
    /// or one picture for each pattern, (M, height, width), or a folder of PNG files. `y` in the input then has one reading
    /// for each pattern, or pattern and complement side by side, (M, 2); --readings names other forms. --strength is relative
    /// to the variance of the readings
    #[arg(long, value_name = "FILE|SET", conflicts_with_all = ["first_of", "residual", "stop_at_noise", "as_printed", "shown", "side",
          "keep_leak", "warm_start", "complements_first", "inverted", "shift", "sweeps"])]
    matrix: Option<PathBuf>,
    /// With --matrix: height and width of the image, such as 12x15, if patterns are rows and the image is no square
    #[arg(long, value_name = "HxW", requires = "matrix")]
    size: Option<Size>,
    /// With --matrix: the array of the patterns, in a file of several [default: patterns or matrix, or the only array of two or
    /// three axes]
    #[arg(long, value_name = "NAME", requires = "matrix")]
    matrix_field: Option<String>,
    /// With --matrix: fit no dark level. By default one constant (ambient light, the offset of an amplifier) is fitted with
    /// the image
    #[arg(long, requires = "matrix")]
    no_dark: bool,
    /// With --index all: start each frame from the frames before. omp starts from their atoms, as long as the result explains
    /// the readings as well. The other methods use the earlier images, moved with the scene: these count less the more the
    /// scene has changed
    #[arg(long, conflicts_with_all = ["dictionary", "non_negative"])]
    warm_start: bool,
    /// Also enlarge and deblur an image of 32 x 32 or 64 x 64 pixels by networks (enhanced.npy and enhanced.png). The mean
    /// of the brightest 2 x 2 pixels counts as white; with --index all, the median of these means
    #[arg(long, conflicts_with = "matrix")]
    enhance: bool,
    #[command(flatten)]
    source: SourceArgs,
    /// More files, or folders of files
    #[arg(value_name = "MORE", help_heading = "Input")]
    more: Vec<PathBuf>,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    #[command(flatten)]
    figure: FigureArgs,
    #[command(flatten)]
    report: ReportArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let first = match args.first_of.as_deref() {
        None => FirstPatterns::LowestSequencies,
        Some("recorded") => FirstPatterns::Recorded,
        Some(order) => FirstPatterns::Of(parse_order("--first-of", order)?),
    };
    args.method.check(args.enhance)?;
    OutputDir::create(&args.out)?.check(["image.npy", "report.json"])?;
    if args.source.input.is_dir() || !args.more.is_empty() {
        return stack::of_files(args, first);
    }
    if let Some(path) = &args.matrix {
        return matrix::run(args, path);
    }
    if args.source.index == Some(Index::All) {
        return stack::of_file(args, first);
    }
    if args.warm_start {
        return Err(Usage("--warm-start belongs to --index all".to_owned()).into());
    }
    let mut times = stages();
    let source = times.time("read", || args.source.load())?;
    let pipeline = args.method.pipeline(first, args.sampling, args.enhance)?;
    let folder = ResultFolder::of_file(&args.source.input, &args.out, made(), args.figure.figure);
    let report = one_image(&pipeline, source, &folder, times)?;
    args.report.print(&report, report.pictures.provenance(), |report| say(args, report))
}

/// Reconstructs the measurements of a capture as one image, and enhances it if the networks take its size. The folder `out`
/// gets the files of `reconstruct --enhance`.
pub fn picture(
    source: Source,
    recording: &Path,
    out: &Path,
    figure: FigureArgs,
    json: bool,
) -> Result<()> {
    let enhance = Enhance::takes(source.measurements.side());
    let first = FirstPatterns::LowestSequencies;
    let pipeline = MethodArgs::default().pipeline(first, Sampling::ALL, enhance)?;
    let folder = ResultFolder::of_file(recording, out, made(), figure.figure);
    let report = one_image(&pipeline, source, &folder, stages())?;
    report.all_warnings().for_each(print::warning);
    let name = if enhance { "enhanced.png" } else { "image.png" };
    match json {
        true => Ok(()),
        false => print::line(format_args!("picture: {}", out.join(name).display())),
    }
}

fn one_image(
    pipeline: &Pipeline,
    source: Source,
    folder: &ResultFolder<'_>,
    times: StageTimes,
) -> Result<OneReport> {
    spinning(|| pipeline.one(source, folder, times)).map_err(failure)
}

/// Why there is no image, in the words of the command line.
fn failure(error: PipelineError) -> anyhow::Error {
    match error {
        PipelineError::Complex => {
            Usage("--enhance needs real images: choose --part real or --part imaginary".to_owned())
                .into()
        }
        PipelineError::Source(error) => usage_or_failure(error),
        // The command line handles these errors by their own types.
        PipelineError::File(error) => error.into(),
        PipelineError::Solver(error) => error.into(),
        PipelineError::Networks(error) => anyhow::Error::from(error).context("--enhance"),
        error => error.into(),
    }
}

/// Shows that the program works, because OMP takes seconds for thousands of patterns.
fn spinning<T>(work: impl FnOnce() -> T) -> T {
    let _progress = Progress::working("reconstructing");
    work()
}

fn say(args: &Args, report: &OneReport) -> Result<()> {
    report.words().iter().try_for_each(print::line)?;
    report.all_warnings().for_each(print::warning);
    print::notes(&report.notes)?;
    let enhanced = if args.enhance { ", enhanced.npy, enhanced.png" } else { "" };
    let parts =
        if report.part.is_some() { " (the magnitude), real.npy, imaginary.npy" } else { "" };
    wrote(format_args!("image.npy, image.png{parts}{enhanced}"), &args.out)
}

/// Says which files are in the folder.
fn wrote(files: fmt::Arguments<'_>, out: &Path) -> Result<()> {
    let out = out.display();
    print::line(format_args!(
        "wrote {files} and report.json to {out}; pictures also as .svg and .pdf"
    ))
}
