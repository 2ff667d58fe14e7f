//! `nirspi reconstruct --matrix`: measurements by patterns of the user's own.

use super::{Args, print, spinning};
use crate::Usage;
use crate::provenance::made;
use crate::report::{StageTimes, stages};
use anyhow::{Context, Result, bail};
use nirspi::files::measurement::{Plain, Selection, read_plain};
use nirspi::files::npy;
use nirspi::picture::{Pictures, Unit};
use nirspi::provenance::Taken;
use nirspi::reconstruct::{check_finite, not_read_words, read_atoms, write_image};
use nirspi_recon::reconstruct::{DarkLevel, MatrixSettings, Method, OwnMatrix, Setting};
use nirspi_recon::words::count_of;
use nirspi_recon::{Sampling, Side};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(Debug, Serialize)]
struct Report {
    input: PathBuf,
    matrix: PathBuf,
    n: usize,
    patterns: usize,
    used: usize,
    /// Patterns used that are no combination of others.
    rank: usize,
    unseen_pixels: usize,
    method: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    basis: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    strength: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sparsity: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    stop: Option<&'static str>,
    /// The reading without light that was fitted with the image; none with --no-dark.
    #[serde(skip_serializing_if = "Option::is_none")]
    dark_level: Option<f64>,
    relative_residual: f64,
    not_read: Vec<usize>,
    notes: Vec<String>,
    pictures: Pictures,
    stage_ms: StageTimes,
}

pub fn run(args: &Args, path: &Path) -> Result<ExitCode> {
    let mut settings = settings(args)?;
    let index = args.source.one()?;
    let mut times = stages();
    let matrix = times.time("read", || npy::read_matrix(path))?;
    let n = matrix.columns.isqrt();
    let side = Side::new(n as u64).ok().filter(|side| side.area() == matrix.columns);
    let Some(side) = side else {
        bail!(
            "{}: {} patterns of {} weights, expected n * n weights with n a power of two from 2 to 256",
            path.display(),
            matrix.rows,
            matrix.columns
        );
    };
    let want = Selection { index, ..args.source.selection()? };
    let Plain { values: y, patterns, not_read } =
        read_plain(&args.source.input, &want, matrix.rows)?;
    if let Some(atoms) = &args.method.dictionary {
        settings.atoms = Some(read_atoms(atoms, n)?);
    }
    let most = ((args.sampling.share() * side.area() as f64).round() as usize).max(1);
    let used = if args.sampling < Sampling::ALL { y.len().min(most) } else { y.len() };
    let named = || path.display().to_string();
    let kept = matrix.select(&patterns[..used]);
    let own = times.time("rank", || OwnMatrix::new(side, &kept)).with_context(named)?;
    let solve = || spinning(|| own.reconstruct(&y[..used], &settings));
    let found = times.time("reconstruct", solve).with_context(named)?;
    check_finite(&args.source.input, &found.image)?;

    let mut notes = Vec::new();
    if !not_read.is_empty() {
        notes.push(not_read_words(&not_read));
    }
    if own.rank() < used.min(side.area()) {
        let others = used - own.rank();
        let are = if others == 1 { "is a combination" } else { "are combinations" };
        notes.push(format!("{others} of {used} patterns {are} of others"));
    }
    if own.unseen_pixels() > 0 {
        notes.push(format!("no pattern sees {}", count_of(own.unseen_pixels(), "pixel")));
    }
    notes.extend(found.dark.note().map(str::to_owned));
    let basis = match &args.method.dictionary {
        Some(path) => path.display().to_string(),
        None => settings.basis.to_string(),
    };
    let method = Method::of_matrix(found.method).unwrap_or(args.method.method);
    let provenance = Taken::of_file(&args.source.input, None).made(made());
    let report = Report {
        input: args.source.input.clone(),
        matrix: path.to_owned(),
        n,
        patterns: matrix.rows,
        used,
        rank: own.rank(),
        unseen_pixels: own.unseen_pixels(),
        method: method.argument(),
        basis: method.takes(Setting::Basis).then_some(basis),
        strength: found.strength,
        sparsity: found.atoms.map(|(size, _)| size),
        stop: found.atoms.map(|(_, stop)| args.method.atoms().reason(stop)),
        dark_level: (found.dark != DarkLevel::LeftOut).then_some(found.dark.value()),
        relative_residual: found.residual,
        not_read,
        notes,
        pictures: Pictures::of_image(&found.image, Unit::Readings, None, &provenance),
        stage_ms: times,
    };
    write_image(&args.out, &found.image, None, None, &report.pictures, &report)?;
    args.report.print(&report, &provenance, |report| say(args, method, report))
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

fn say(args: &Args, method: Method, report: &Report) -> Result<()> {
    print::line(format_args!(
        "{}: {} x {}, {} of {} patterns of {}, rank {}",
        report.input.display(),
        report.n,
        report.n,
        report.used,
        report.patterns,
        report.matrix.display(),
        report.rank
    ))?;
    let strength = report.strength.map(|t| format!(", strength {t}")).unwrap_or_default();
    let atoms = report.sparsity.map(|k| format!(", {}", count_of(k, "atom"))).unwrap_or_default();
    let basis = report.basis.as_ref().map(|b| format!(", {b} basis")).unwrap_or_default();
    let dark =
        report.dark_level.map(|level| format!(", dark level {level:.4}")).unwrap_or_default();
    print::line(format_args!(
        "{}{basis}{atoms}{strength}{dark}, relative residual {:.3}",
        method.name(),
        report.relative_residual
    ))?;
    print::notes(&report.notes)?;
    print::line(format_args!(
        "wrote image.npy, image.png and report.json to {}",
        args.out.display()
    ))
}
