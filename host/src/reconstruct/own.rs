//! The image of readings by patterns of a user's own, with its pictures and its report, in a folder.

use super::{SolverError, check_finite, not_read_words, read_atoms, write_image};
use crate::files::FileError;
use crate::files::measurement::{PatternSelection, Plain, Selection, read_plain};
use crate::picture::{FigureStyle, Pictures, Unit};
use crate::provenance::{Made, Taken};
use crate::stage_times::StageTimes;
use nirspi_recon::Sampling;
use nirspi_recon::reconstruct::{
    DarkLevel, MatrixError, MatrixSettings, Method, MethodSettings, OwnMatrix, Setting, Sparsity,
};
use nirspi_recon::words::count_of;
use serde::{Serialize, Serializer};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A request for the image of readings by patterns of a user's own.
pub struct OwnImage<'r> {
    /// The file of the readings.
    pub input: &'r Path,
    /// The file of the patterns, or a folder of pictures.
    pub matrix: &'r Path,
    /// What the file of the patterns does not say.
    pub patterns: PatternSelection,
    /// What the file of the readings does not say.
    pub readings: Selection,
    /// The method, and its settings without a user's own atoms.
    pub settings: MatrixSettings,
    /// A file of a user's own atoms: images of the size of the patterns.
    pub dictionary: Option<&'r Path>,
    /// The largest number of patterns to use, as a share of the number of pixels.
    pub sampling: Sampling,
    /// Folder for the results.
    pub out: &'r Path,
    /// The program, for the provenance of the results.
    pub made: &'r Made,
    /// What the pictures are made for.
    pub figure: FigureStyle,
}

/// The report of such an image.
#[derive(Debug, Serialize)]
pub struct OwnReport {
    /// The file of the readings.
    pub input: PathBuf,
    /// The file of the patterns.
    pub matrix: PathBuf,
    /// Height of the image in pixels.
    pub height: usize,
    /// Width of the image in pixels.
    pub width: usize,
    /// Number of patterns.
    pub patterns: usize,
    /// Number of patterns used.
    pub used: usize,
    /// Patterns used that are no combination of others.
    pub rank: usize,
    /// Pixels that no pattern lights.
    pub unseen_pixels: usize,
    /// The method.
    #[serde(serialize_with = "by_argument")]
    pub method: Method,
    /// The basis of the coefficients, or the file of the atoms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub basis: Option<String>,
    /// Strength of the penalty.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub strength: Option<f64>,
    /// Number of atoms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sparsity: Option<usize>,
    /// Why the pursuit stopped.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stop: Option<&'static str>,
    /// The reading without light that was fitted with the image, if there was to be one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dark_level: Option<f64>,
    /// Norm of the residual, relative to the norm of the readings without the dark level.
    pub relative_residual: f64,
    /// Patterns that the file marks as not read.
    pub not_read: Vec<usize>,
    /// Notes for the user.
    pub notes: Vec<String>,
    /// What is black and white in the pictures.
    pub pictures: Pictures,
    /// The time of each stage.
    pub stage_ms: StageTimes,
}

fn by_argument<S: Serializer>(method: &Method, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(method.argument())
}

/// Why there is no image.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum OwnError {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The atoms do not fit, or the image is too large.
    #[error(transparent)]
    Solver(#[from] SolverError),
    /// The patterns, or a setting, give no image.
    #[error("{}: {problem}", .path.display())]
    Matrix {
        /// The file of the patterns.
        path: PathBuf,
        /// The problem.
        problem: MatrixError,
    },
}

/// Reconstructs one image and writes it with its pictures and its report.
///
/// # Errors
/// [`OwnError`] names the file and the problem. Nothing is left behind.
pub fn own_image(request: OwnImage<'_>, mut times: StageTimes) -> Result<OwnReport, OwnError> {
    let OwnImage { input, matrix, mut settings, .. } = request;
    let read = || read_plain(matrix, &request.patterns, input, &request.readings);
    let Plain { patterns, values: y, places, not_read, simulated, mut notes, dark } =
        times.time("read", read)?;
    settings.dark &= dark;
    let size = patterns.size;
    if let Some(atoms) = request.dictionary {
        settings.atoms = Some(read_atoms(atoms, (size.height(), size.width()))?);
    }
    let most = ((request.sampling.share() * size.area() as f64).round() as usize).max(1);
    let used = if request.sampling < Sampling::ALL { y.len().min(most) } else { y.len() };
    let refused = |problem| OwnError::Matrix { path: matrix.to_owned(), problem };
    let kept = patterns.select(&places[..used]);
    let own = times.time("rank", || OwnMatrix::new(size, &kept)).map_err(refused)?;
    let solve = || own.reconstruct(&y[..used], &settings);
    let found = times.time("reconstruct", solve).map_err(refused)?;
    check_finite(input, &found.image)?;

    notes.extend((!not_read.is_empty()).then(|| not_read_words(&not_read)));
    notes.extend(doubts(&own, used));
    notes.extend(found.dark.note().map(str::to_owned));
    let basis = match request.dictionary {
        Some(path) => path.display().to_string(),
        None => settings.basis.to_string(),
    };
    let method = Method::of_matrix(found.method).unwrap_or_default();
    let sparsity = settings.sparsity.map_or(MethodSettings::default().sparsity, Sparsity::Fixed);
    let provenance = Taken::of_file(input, simulated).made(request.made);
    let report = OwnReport {
        input: input.to_owned(),
        matrix: matrix.to_owned(),
        height: size.height(),
        width: size.width(),
        patterns: patterns.count,
        used,
        rank: own.rank(),
        unseen_pixels: own.unseen_pixels(),
        method,
        basis: method.takes(Setting::Basis).then_some(basis),
        strength: found.strength,
        sparsity: found.atoms.map(|(size, _)| size),
        stop: found.atoms.map(|(_, stop)| sparsity.reason(stop)),
        dark_level: (found.dark != DarkLevel::LeftOut).then_some(found.dark.value()),
        relative_residual: found.residual,
        not_read,
        notes,
        pictures: Pictures::of_image(
            &found.image,
            Unit::Readings,
            None,
            request.figure,
            &provenance,
        ),
        stage_ms: times,
    };
    write_image(request.out, &found.image, None, None, &report.pictures, &report)?;
    Ok(report)
}

/// What patterns leave open.
fn doubts(own: &OwnMatrix, used: usize) -> impl Iterator<Item = String> {
    let others = used.min(own.size().area()).saturating_sub(own.rank());
    let are = if others == 1 { "is a combination" } else { "are combinations" };
    let others = (others > 0).then(|| format!("{others} of {used} patterns {are} of others"));
    let unseen = own.unseen_pixels();
    let unseen = (unseen > 0).then(|| format!("no pattern sees {}", count_of(unseen, "pixel")));
    others.into_iter().chain(unseen)
}

impl OwnReport {
    /// The report in words, a line each: patterns, method.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let Self { input, height, width, used, patterns, matrix, rank, .. } = self;
        let (input, matrix) = (input.display(), matrix.display());
        let strength = self.strength.map(|t| format!(", strength {t}")).unwrap_or_default();
        let atoms = self.sparsity.map(|k| format!(", {}", count_of(k, "atom"))).unwrap_or_default();
        let basis = self.basis.as_ref().map(|b| format!(", {b} basis")).unwrap_or_default();
        let dark =
            self.dark_level.map(|level| format!(", dark level {level:.4}")).unwrap_or_default();
        vec![
            format!(
                "{input}: {height} x {width}, {used} of {patterns} patterns of {matrix}, rank {rank}"
            ),
            format!(
                "{}{basis}{atoms}{strength}{dark}, relative residual {:.3}",
                self.method.name(),
                self.relative_residual
            ),
        ]
    }
}
