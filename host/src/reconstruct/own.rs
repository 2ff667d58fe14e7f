//! The image of readings by patterns of a user's own, or the images of all readings of a file, with
//! pictures and a report, in a folder.

use super::images::Images;
use super::{SolverError, check_finite, not_read_words, read_atoms, write_image};
use crate::files::FileError;
use crate::files::measurement::{PatternSelection, Plain, Selection, read_plain, read_plain_all};
use crate::files::output::OutputDir;
use crate::imaging::{HeldBackReport, by_chance};
use crate::picture::{FigureStyle, Pictures, Unit};
use crate::provenance;
use crate::stage_times::StageTimes;
use nirspi_own::{DarkLevel, KnownNoise, MatrixError, MatrixReconstruction, NoiseFrom, OwnMatrix};
use nirspi_recon::reconstruct::{
    MatrixMethod, MatrixSettings, Method, MethodSettings, Penalty, Setting, Sparsity,
};
use nirspi_recon::words::count_of;
use nirspi_recon::{Image, Sampling, Size};
use serde::{Serialize, Serializer};
use std::path::{Path, PathBuf};
use std::sync::Arc;
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
    /// Whether to make the image of every measurement of the file, instead of the one that `readings` chooses.
    pub all: bool,
    /// The method, and its settings without a user's own atoms.
    pub settings: MatrixSettings,
    /// A file of a user's own atoms: images of the size of the patterns.
    pub dictionary: Option<&'r Path>,
    /// The largest number of patterns to use, as a share of the number of pixels.
    pub sampling: Sampling,
    /// Folder for the results.
    pub out: &'r Path,
    /// The program, for the provenance of the results.
    pub made: &'r provenance::Made,
    /// What the pictures are made for.
    pub figure: FigureStyle,
}

/// The report of such an image, or of all of a file.
#[derive(Debug, Serialize)]
pub struct OwnReport {
    /// What the image is made of.
    #[serde(flatten)]
    pub of: OwnInput,
    /// How it was made.
    #[serde(flatten)]
    pub made: OwnFrames,
    /// What is black and white in the pictures.
    pub pictures: Pictures,
    /// The time of each stage.
    pub stage_ms: StageTimes,
}

/// One image, or those of all measurements of a file.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum OwnFrames {
    /// One image.
    One(Box<OwnMade>),
    /// All, in their order.
    All {
        /// How each was made.
        frames: Vec<OwnMade>,
    },
}

/// Readings by patterns of a user's own.
#[derive(Debug, Serialize)]
pub struct OwnInput {
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
}

/// How an image of such readings was made.
#[derive(Debug, Clone, Serialize)]
pub struct OwnMade {
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
    /// Standard deviation of the noise of a reading, where it is known and says how much readings count.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_of_a_reading: Option<f64>,
    /// What says how large that noise is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_from: Option<&'static str>,
    /// Norm of the residual, relative to the norm of the readings without the dark level.
    pub relative_residual: f64,
    /// Patterns that the file marks as not read.
    pub not_read: Vec<usize>,
    /// Patterns whose readings no scene can have given beside the others. They are left out.
    pub outliers: Vec<usize>,
    /// How well held-back readings are predicted by the others, where that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_back: Option<HeldBackReport>,
    /// What speaks against the image, one line each.
    pub warnings: Vec<String>,
    /// Notes for the user.
    pub notes: Vec<String>,
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

/// Reconstructs one image, or the image of every measurement of the file as one stack, and writes it with
/// its pictures and its report. An image of a stack is the one that its measurement alone gives, if that knows as much of its
/// noise.
///
/// # Errors
/// [`OwnError`] names the file and the problem. Nothing is left behind.
pub fn own_image(request: OwnImage<'_>, mut times: StageTimes) -> Result<OwnReport, OwnError> {
    let OwnImage { input, matrix, patterns, readings, figure, .. } = &request;
    let read = || match request.all {
        true => read_plain_all(matrix, patterns, input, readings),
        false => Ok(vec![read_plain(matrix, patterns, input, readings)?]),
    };
    let plain = times.time("read", read)?;
    let provenance = plain[0].taken.clone().from_file(input).made(request.made);
    let (of, all) = images(&request, plain, &mut times)?;
    let (mut images, mut frames): (Vec<Image<Size>>, Vec<OwnMade>) = all.into_iter().unzip();
    if !request.all {
        let (image, made) = (images.remove(0), OwnFrames::One(Box::new(frames.remove(0))));
        let pictures = Pictures::of_image(&image, Unit::Readings, None, *figure, &provenance);
        let report = OwnReport { of, made, pictures, stage_ms: times };
        write_image(request.out, &image, None, None, &report.pictures, &report)?;
        return Ok(report);
    }
    let mut out = OutputDir::create(request.out)?;
    let wrong = |error| FileError::io(request.out, "write to", error);
    let mut array = Images::new(&out, "image.npy", (of.height, of.width))?;
    let mut write = || images.iter().try_for_each(|image| array.push(image.pixels()));
    times.time("write", &mut write).map_err(wrong)?;
    let header = format!("{}, {} frames", input.display(), images.len());
    let draw = || {
        let shown = array.chosen()?;
        Ok(Pictures::of_stack(&shown.sheet(header, Unit::Readings), None, *figure, &provenance))
    };
    let pictures = times.time("pictures", draw).map_err(wrong)?;
    times.time("write", || array.finish(&mut out).and_then(|()| pictures.write(&mut out)))?;
    let report = OwnReport { of, made: OwnFrames::All { frames }, pictures, stage_ms: times };
    out.write("report.json", provenance.sign(&report).unwrap_or_default().as_bytes())?;
    out.commit()?;
    Ok(report)
}

/// An image, and how it was made.
type Made = (Image<Size>, OwnMade);

/// The images of these readings, all by the same patterns or some of them: what the readings have in
/// common is found out once.
fn images(
    request: &OwnImage<'_>,
    plain: Vec<Plain>,
    times: &mut StageTimes,
) -> Result<(OwnInput, Vec<Made>), OwnError> {
    let mut settings = request.settings.clone();
    let size = plain[0].patterns.size;
    if let Some(atoms) = request.dictionary {
        settings.atoms = Some(read_atoms(atoms, (size.height(), size.width()))?);
    }
    let most = ((request.sampling.share() * size.area() as f64).round() as usize).max(1);
    let shortened = |plain: &Plain| match request.sampling < Sampling::ALL {
        true => plain.values.len().min(most),
        false => plain.values.len(),
    };
    let of = OwnInput {
        input: request.input.to_owned(),
        matrix: request.matrix.to_owned(),
        height: size.height(),
        width: size.width(),
        patterns: plain[0].patterns.count,
    };
    let mut made: Vec<Option<Made>> = plain.iter().map(|_| None).collect();
    for first in 0..plain.len() {
        if made[first].is_some() {
            continue;
        }
        let used = shortened(&plain[first]);
        let alike = |at: &usize| {
            Arc::ptr_eq(&plain[*at].patterns, &plain[first].patterns)
                && plain[*at].places == plain[first].places
                && plain[*at].noise == plain[first].noise
        };
        let all: Vec<usize> = (first..plain.len()).filter(alike).collect();
        settings.dark = request.settings.dark && plain[first].dark;
        let found = same(request, &settings, &plain, &all, used, times)?;
        for (at, found) in all.into_iter().zip(found) {
            made[at] = Some(found);
        }
    }
    Ok((of, made.into_iter().flatten().collect()))
}

/// The images of measurements by the same patterns, of which the first `used` are used.
fn same(
    request: &OwnImage<'_>,
    settings: &MatrixSettings,
    plain: &[Plain],
    all: &[usize],
    used: usize,
    times: &mut StageTimes,
) -> Result<Vec<Made>, OwnError> {
    let refused = |problem| OwnError::Matrix { path: request.matrix.to_owned(), problem };
    let Plain { patterns, places, .. } = &plain[all[0]];
    let kept = patterns.select(&places[..used]);
    let own = times.time("rank", || OwnMatrix::new(patterns.size, &kept)).map_err(refused)?;
    drop(kept);
    let readings: Vec<&[f64]> = all.iter().map(|&at| &plain[at].values[..used]).collect();
    let known = match (plain[all[0]].noise, own.weighs_noise(settings)) {
        (_, false) => None,
        (Some(sigma), true) => Some(KnownNoise { sigma, from: NoiseFrom::Stated }),
        (None, true) => own.known_noise(&readings),
    };
    let most_noise = all.iter().map(|&at| plain[at].most_noise).collect();
    let noise = known.map(|known| known.sigma);
    let settings = &MatrixSettings { noise, most_noise, ..settings.clone() };
    let solve = || own.reconstruct_all(&readings, settings);
    let found = times.time("reconstruct", solve).map_err(refused)?;
    let basis = match request.dictionary {
        Some(path) => path.display().to_string(),
        None => settings.basis.to_string(),
    };
    let asked = settings.sparsity.map_or(MethodSettings::default().sparsity, Sparsity::Fixed);
    let doubts: Vec<String> = matrix_doubts(&own).collect();
    let made = |(&at, found): (&usize, MatrixReconstruction)| {
        check_finite(request.input, &found.image)?;
        let Plain { not_read, notes, .. } = &plain[at];
        let mut notes = notes.clone();
        let warnings = matrix_warnings(&found, |k| places[k]);
        let outliers: Vec<usize> = found.outliers.iter().map(|&k| places[k]).collect();
        notes.extend((!not_read.is_empty()).then(|| not_read_words(not_read)));
        notes.extend(doubts.iter().cloned());
        notes.extend(found.dark.note().map(str::to_owned));
        let method = Method::of_matrix(found.method).unwrap_or_default();
        let weighed = known.filter(|_| found.method == MatrixMethod::Penalty(Penalty::Tikhonov));
        let made = OwnMade {
            used: used - outliers.len(),
            rank: found.rank,
            unseen_pixels: own.unseen_pixels(),
            method,
            basis: method.takes(Setting::Basis).then(|| basis.clone()),
            strength: found.strength,
            sparsity: found.atoms.map(|(size, _)| size),
            stop: found.atoms.map(|(_, stop)| asked.reason(stop)),
            dark_level: (found.dark != DarkLevel::LeftOut).then_some(found.dark.value()),
            noise_of_a_reading: weighed.map(|known| known.sigma),
            noise_from: weighed.map(|known| known.from.name()),
            relative_residual: found.residual,
            not_read: not_read.clone(),
            outliers,
            held_back: found.held_back.map(Into::into),
            warnings,
            notes,
        };
        Ok((found.image, made))
    };
    all.iter().zip(found).map(made).collect()
}

/// What patterns leave open, one line each.
pub fn matrix_doubts(own: &OwnMatrix) -> impl Iterator<Item = String> + use<> {
    let used = own.patterns();
    let others = used.min(own.size().area()).saturating_sub(own.rank());
    let are = if others == 1 { "is a combination" } else { "are combinations" };
    let others = (others > 0).then(|| format!("{others} of {used} patterns {are} of others"));
    let unseen = own.unseen_pixels();
    let unseen = (unseen > 0).then(|| format!("no pattern sees {}", count_of(unseen, "pixel")));
    others.into_iter().chain(unseen)
}

/// What speaks against an image, one line each. `place` is that of a reading's pattern among those shown.
#[must_use]
pub fn matrix_warnings(
    found: &MatrixReconstruction,
    place: impl Fn(usize) -> usize,
) -> Vec<String> {
    let outliers = found.outliers.iter().map(|&k| {
        let at = place(k);
        format!("outlier: reading [{at}] is far outside all others; its pattern is left out")
    });
    let doubt = found.held_back.zip(found.doubt.as_ref());
    let doubt = doubt.map(|(held_back, doubt)| by_chance(held_back, doubt));
    outliers.chain(doubt).collect()
}

impl OwnMade {
    /// The method in words.
    fn words(&self) -> String {
        let strength = self.strength.map(|t| format!(", strength {t}")).unwrap_or_default();
        let atoms = self.sparsity.map(|k| format!(", {}", count_of(k, "atom"))).unwrap_or_default();
        let basis = self.basis.as_ref().map(|b| format!(", {b} basis")).unwrap_or_default();
        let dark =
            self.dark_level.map(|level| format!(", dark level {level:.4}")).unwrap_or_default();
        let noise = self.noise_of_a_reading.zip(self.noise_from);
        let noise = noise
            .map(|(sigma, from)| format!(", noise of a reading {sigma:.4} ({from})"))
            .unwrap_or_default();
        let (method, residual) = (self.method.name(), self.relative_residual);
        format!("{method}{basis}{atoms}{strength}{dark}{noise}, relative residual {residual:.3}")
    }
}

impl OwnReport {
    /// The report in words, a line each: patterns, the method, of a stack that of the last image.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let OwnInput { input, height, width, patterns, matrix } = &self.of;
        let (input, matrix) = (input.display(), matrix.display());
        match &self.made {
            OwnFrames::One(made) => {
                let OwnMade { used, rank, .. } = &**made;
                let of = format!("{used} of {patterns} patterns of {matrix}, rank {rank}");
                vec![format!("{input}: {height} x {width}, {of}"), made.words()]
            }
            OwnFrames::All { frames } => {
                let each = self.stage_ms.of("reconstruct") / frames.len() as f64;
                let count = count_of(frames.len(), "frame");
                let of = format!("{patterns} patterns of {matrix}, {each:.3} ms a frame");
                let mut words = vec![format!("{input}: {count} of {height} x {width}, {of}")];
                words.extend(frames.last().map(|last| {
                    format!("the last: {} of {patterns} patterns, {}", last.used, last.words())
                }));
                words
            }
        }
    }

    /// The notes for the user: one that all images of a stack have stands there once.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        self.lines(|made| &made.notes)
    }

    /// What speaks against the images, in the same way.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        self.lines(|made| &made.warnings)
    }

    fn lines(&self, of: impl Fn(&OwnMade) -> &Vec<String>) -> Vec<String> {
        let frames = match &self.made {
            OwnFrames::One(made) => return of(made).clone(),
            OwnFrames::All { frames } => frames,
        };
        let Some((first, others)) = frames.split_first() else { return Vec::new() };
        let is_of_all = |line: &&String| others.iter().all(|frame| of(frame).contains(line));
        let of_all: Vec<String> = of(first).iter().filter(is_of_all).cloned().collect();
        let own = frames.iter().enumerate().flat_map(|(at, frame)| {
            let own = of(frame).iter().filter(|line| !of_all.contains(line));
            own.map(|line| format!("frame {at}: {line}")).collect::<Vec<_>>()
        });
        let own: Vec<String> = own.collect();
        [of_all, own].concat()
    }
}
