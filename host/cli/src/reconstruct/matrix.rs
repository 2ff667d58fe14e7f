//! `nirspi reconstruct --matrix`: measurements by patterns of the user's own.

use super::{Args, print, spinning};
use crate::Usage;
use crate::provenance::made;
use crate::report::stages;
use anyhow::Result;
use nirspi::files::measurement::{PatternSelection, Selection};
use nirspi::reconstruct::{OwnImage, OwnReport, own_image};
use nirspi::source::Index;
use nirspi_recon::reconstruct::{MatrixSettings, Method};
use std::path::Path;
use std::process::ExitCode;

pub fn run(args: &Args, matrix: &Path) -> Result<ExitCode> {
    let patterns = PatternSelection {
        size: args.size,
        field: args.matrix_field.clone(),
        transpose: args.source.transpose,
    };
    let all = args.source.index == Some(Index::All);
    let index = if all { None } else { args.source.one()? };
    let request = OwnImage {
        input: &args.source.input,
        matrix,
        patterns,
        readings: Selection { index, ..args.source.selection()? },
        all,
        settings: settings(args)?,
        dictionary: args.method.dictionary.as_deref(),
        sampling: args.sampling,
        out: &args.out,
        made: made(),
        figure: args.figure.figure,
    };
    let report = spinning(|| own_image(request, stages()))?;
    args.report.print(&report, report.pictures.provenance(), |report| say(args, report))
}

fn settings(args: &Args) -> Result<MatrixSettings> {
    let asked = args.method.method;
    let Some(method) = asked.with_matrix() else {
        let methods = Method::listed(|method| method.with_matrix().is_some());
        return Err(Usage(format!(
            "--method {asked} needs Hadamard rows, and --matrix gives other patterns: expected {methods}"
        ))
        .into());
    };
    Ok(MatrixSettings {
        basis: args.method.basis()?,
        strength: args.method.strength,
        sparsity: args.method.sparsity,
        non_negative: args.method.non_negative,
        dark: !args.no_dark,
        ..MatrixSettings::new(method)
    })
}

fn say(args: &Args, report: &OwnReport) -> Result<()> {
    report.words().iter().try_for_each(print::line)?;
    print::notes(&report.notes())?;
    let (pictures, out) = (&report.pictures, args.out.display());
    print::line(format_args!("wrote image.npy, {pictures} and report.json to {out}"))
}
