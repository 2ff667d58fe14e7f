//! `nirspi reconstruct --matrix`: measurements by patterns of the user's own.

use super::{Args, print, spinning, wrote};
use crate::Usage;
use crate::provenance::made;
use crate::report::stages;
use anyhow::Result;
use nirspi::files::measurement::{PatternSelection, Selection};
use nirspi::reconstruct::{OwnImage, OwnReport, own_image};
use nirspi::source::Index;
use nirspi_recon::reconstruct::MatrixSettings;
use std::path::Path;
use std::process::ExitCode;

pub fn run(args: &Args, matrix: &Path) -> Result<ExitCode> {
    let patterns = PatternSelection {
        size: args.size,
        field: args.matrix_field.clone(),
        transpose: args.source.transpose,
    };
    let refused = |why| Usage(format!("--{why}"));
    let of_method =
        args.method.method.matrix_settings(&args.method.settings()?).map_err(refused)?;
    let all = args.source.index == Some(Index::All);
    let index = if all { None } else { args.source.one()? };
    let request = OwnImage {
        input: &args.source.input,
        matrix,
        patterns,
        readings: Selection { index, ..args.source.selection()? },
        all,
        settings: MatrixSettings { dark: !args.no_dark, ..of_method },
        dictionary: args.method.dictionary.as_deref(),
        sampling: args.sampling,
        out: &args.out,
        made: made(),
        figure: args.figure.figure,
    };
    let report = spinning(|| own_image(request, stages()))?;
    args.report.print(&report, report.pictures.provenance(), |report| say(args, report))
}

fn say(args: &Args, report: &OwnReport) -> Result<()> {
    report.words().iter().try_for_each(print::line)?;
    report.warnings().iter().for_each(print::warning);
    print::notes(&report.notes())?;
    wrote(format_args!("image.npy, {}", report.pictures), &args.out)
}
