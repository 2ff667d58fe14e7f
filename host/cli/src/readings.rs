//! `nirspi readings`: readings of a trace, for `nirspi reconstruct`.

use super::report::{FigureArgs, Overwrite, ReportArgs, words};
use super::{Usage, print, provenance};
use anyhow::Result;
use nirspi::files::measurement::write_readings;
use nirspi::files::output::Existing;
use nirspi::files::trace::{self, Cut, Raw};
use nirspi::picture::{Figure, of_trace};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Make readings of a trace: samples of an oscilloscope or ADC
///
/// A reading is the mean of the samples of one pattern. A pattern begins where the trigger rises (--trigger), or every K
/// samples (--samples). The trace is a .npz, .npy, .mat, .h5, .csv, .txt or .wav file with the samples in time order, or numbers
/// without a heading (--raw). An array of K samples a reading, (M, K), is a trace, too. The command writes the readings as y in
/// a .npz file for `nirspi reconstruct`, and beside it a figure of the first readings (OUT.picture.png), which shows where
/// they begin and end. A pattern whose trigger is missing has no reading (NaN). The number of readings is compared with that
/// of a full sweep.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("cut").args(["samples", "trigger"]).multiple(true).required(true))]
#[command(after_help = "Examples:\n\
    \x20 nirspi readings scope.csv --field CH1 --trigger CH2 --settle 4 --out m.npz\n\
    \x20 nirspi readings adc.i16 --raw i16 --samples 20 --skip 137 --count 2048 --out m.npz\n\
    \x20 nirspi reconstruct m.npz --shown natural --out out/")]
pub struct Args {
    /// The file with the samples
    #[arg(value_name = "TRACE")]
    trace: PathBuf,
    /// Samples of a pattern. With --trigger, the number of samples that must be between two edges
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..))]
    samples: Option<u32>,
    /// The field or column with the trigger's samples. A pattern begins where the trigger rises through the middle of its range;
    /// with NAME:fall where the trigger falls, with NAME:both at every change
    #[arg(long, value_name = "NAME", conflicts_with = "raw")]
    trigger: Option<String>,
    /// Samples before the first pattern, to leave out
    #[arg(long, value_name = "S", default_value_t = 0)]
    skip: usize,
    /// Samples at the beginning of each pattern to leave out, while the light settles
    #[arg(long, value_name = "B", default_value_t = 0)]
    settle: usize,
    /// Readings to keep, for a trace that goes on after the last pattern. A trace with fewer is refused
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    count: Option<u32>,
    /// The field or column with the detector's samples, for a file with several
    #[arg(long, value_name = "NAME", conflicts_with = "raw")]
    field: Option<String>,
    /// The file has numbers and no heading: little-endian, of this kind
    #[arg(long, value_name = "KIND", value_parser = words(&Raw::ALL, |raw| (raw.name(), raw.about())))]
    raw: Option<Raw>,
    /// Every comma in a text file is a decimal comma
    #[arg(long, conflicts_with = "raw")]
    decimal_comma: bool,
    /// File to write
    #[arg(long, value_name = "FILE.npz")]
    out: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
    #[command(flatten)]
    figure: FigureArgs,
    #[command(flatten)]
    report: ReportArgs,
}

#[derive(Debug, Serialize)]
struct Report {
    input: PathBuf,
    output: PathBuf,
    picture: PathBuf,
    /// Number of readings, those that are not there included.
    readings: usize,
    samples_a_pattern: usize,
    samples: usize,
    samples_before: usize,
    samples_after: usize,
    /// Readings that are not there.
    lost: Vec<usize>,
    overloads: Vec<usize>,
    /// Samples with an edge that comes too early.
    extra_edges: Vec<usize>,
    words: Vec<String>,
    notes: Vec<String>,
    warnings: Vec<String>,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let out = &args.out;
    if out.extension().is_none_or(|extension| extension != "npz") {
        let found = out.display();
        return Err(Usage(format!("--out {found}: expected a name that ends in .npz")).into());
    }
    let picture = out.with_extension("picture.png");
    let existing = Existing::of(args.overwrite.overwrite, Some(&args.trace));
    existing.check(out)?;
    Figure::paths_of_chart(&picture).iter().try_for_each(|path| existing.check(path))?;
    let cut = Cut {
        field: args.field.clone(),
        trigger: args.trigger.clone(),
        samples: args.samples.map(|samples| samples as usize),
        skip: args.skip,
        settle: args.settle,
        count: args.count.map(|count| count as usize),
        raw: args.raw,
        decimal_comma: args.decimal_comma,
    };
    let found = trace::read(&args.trace, &cut)?;
    let provenance = found.taken.made(provenance::made());
    let figure = Figure::from(of_trace(&found, String::new()));
    let report = Report {
        input: args.trace.clone(),
        output: out.clone(),
        picture,
        readings: found.readings.len(),
        samples_a_pattern: found.samples,
        samples: found.length,
        samples_before: found.outside.0,
        samples_after: found.outside.1,
        words: found.words(),
        notes: found.skipped.iter().cloned().collect(),
        warnings: found.warnings(),
        lost: found.lost,
        overloads: found.overloads,
        extra_edges: found.extra,
    };
    write_readings(out, existing, &found.readings, &provenance)?;
    figure.write_files(&report.picture, existing, args.figure.figure, &provenance)?;
    args.report.print(&report, &provenance, |report| {
        report.words.iter().try_for_each(print::line)?;
        report.warnings.iter().for_each(print::warning);
        print::notes(&report.notes)?;
        print::line(format_args!(
            "wrote {}; look at {}; nirspi reconstruct {} --shown ORDER makes an image",
            out.display(),
            report.picture.display(),
            out.display()
        ))
    })
}
