//! The images of many files, by one prepared method on all processors.
//!
//! # Invariant
//! An image is the one that its file alone gives, and images are in the order of the files, whichever
//! is made first (`tests::images_are_those_of_the_files_alone_in_their_order`). A file that gives no
//! image is named with the reason and takes no other with it
//! (`tests::a_file_without_an_image_is_named_and_the_others_are_there`).

use super::{Solved, Solver, SolverError, not_read_words};
use crate::causes::in_one_line;
use crate::imaging::MethodReport;
use crate::provenance::Taken;
use crate::source::{Index, OutlierReport, Source, SourceError, SourceOptions};
use nirspi_recon::reconstruct::GoingOn;
use nirspi_recon::words::count_of;
use nirspi_recon::{Image, Rows};
use rayon::prelude::*;
use serde::Serialize;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The image of one measurement of one of many files.
#[derive(Debug)]
pub struct FileImage {
    /// The file.
    pub file: PathBuf,
    /// Number of the measurement in a file of several, or of the frame of a recording, from 0.
    pub index: Option<usize>,
    /// The image.
    pub image: Image,
    /// The same with the readings as they are, for networks.
    pub with_readings: Image,
    /// The patterns that were used.
    pub used: Rows,
    /// The name of the order that chose them.
    pub order: String,
    /// Whether the readings are complex, so that the image is their magnitude.
    pub complex: bool,
    /// Whether the readings are those of a recording: ADC counts.
    pub recorded: bool,
    /// The method's report.
    pub report: MethodReport,
    /// Where the readings come from.
    pub taken: Taken,
    /// Readings that light cannot have given, whose patterns are left out.
    pub outliers: Vec<OutlierReport>,
    /// What contradicts the readings.
    pub warnings: Vec<String>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// A file without an image.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Skipped {
    /// The file.
    pub file: PathBuf,
    /// Why it has no image, in one line.
    pub reason: String,
}

/// What many files give.
#[derive(Debug, Default)]
pub(super) struct ManyImages {
    /// The images, in the order of the files. All have one side: that of the first.
    pub images: Vec<FileImage>,
    /// The files that give none.
    pub skipped: Vec<Skipped>,
}

/// Why a file gives no image.
#[derive(Debug, Error)]
enum NoImage {
    #[error(transparent)]
    Source(#[from] SourceError),
    #[error(transparent)]
    Solver(#[from] SolverError),
    // JSON has no such names.
    #[error("{}: found a name that is no UTF-8, expected a name in UTF-8", .0.display())]
    Name(PathBuf),
    #[error("{}: images of {n} x {n}, expected {expected} x {expected} as of the first file", .file.display())]
    Side { file: PathBuf, n: usize, expected: usize },
}

/// Makes the image of each measurement of these files: all measurements of a measurement file, the sum
/// of a recording's frames. With [`SourceOptions::index`], that one measurement of each file, or each
/// frame of each recording. `side` is that of the images of files before these. `done` is called after each file, from any
/// thread.
pub(super) fn many_images(
    files: &[PathBuf],
    options: &SourceOptions,
    solver: &Solver,
    side: Option<usize>,
    done: &(dyn Fn() + Sync),
) -> ManyImages {
    let made: Vec<_> = files
        .par_iter()
        .map(|file| {
            let made = images_of(file, options, solver);
            done();
            made
        })
        .collect();
    let (mut all, mut side) = (ManyImages::default(), side);
    for (file, made) in files.iter().zip(made) {
        match made.and_then(|images| of_one_side(file, images, &mut side)) {
            Ok(images) => all.images.extend(images),
            Err(error) => {
                let file = file.to_string_lossy().into_owned().into();
                all.skipped.push(Skipped { file, reason: in_one_line(&error) });
            }
        }
    }
    all
}

fn of_one_side(
    file: &Path,
    images: Vec<FileImage>,
    side: &mut Option<usize>,
) -> Result<Vec<FileImage>, NoImage> {
    let Some(n) = images.first().map(|image| image.image.side().pixels()) else {
        return Ok(images);
    };
    match *side.get_or_insert(n) {
        expected if n != expected => Err(NoImage::Side { file: file.to_owned(), n, expected }),
        _ => Ok(images),
    }
}

fn images_of(
    file: &Path,
    options: &SourceOptions,
    solver: &Solver,
) -> Result<Vec<FileImage>, NoImage> {
    if file.to_str().is_none() {
        return Err(NoImage::Name(file.to_owned()));
    }
    let is_one = match options.index {
        Some(Index::One(_)) => true,
        Some(Index::All) => false,
        None => options.fits_recording(file)?,
    };
    let sources = match is_one {
        true => vec![Source::read(file, options)?],
        false => Source::read_all(file, options)?,
    };
    let all = Part { from: 0, several: sources.len() > 1 };
    Ok(file_images(file, &sources, solver, all, false, &|| Ok(()))?)
}

/// Which of the measurements of a file these are.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    /// Number of the first one.
    pub from: usize,
    /// Whether the file has several.
    pub several: bool,
}

/// The images of measurements of one file, in their order. In a video, each frame starts from the
/// frames before. `going_on` is called before the image of each.
pub(super) fn file_images(
    file: &Path,
    sources: &[Source],
    solver: &Solver,
    part: Part,
    is_video: bool,
    going_on: GoingOn<'_>,
) -> Result<Vec<FileImage>, SolverError> {
    let made = solver.solve_all(file, sources, is_video, going_on)?;
    let image = |(index, (source, solved)): (usize, (&Source, Solved))| {
        let Solved { image, with_readings, parts, used, order, report, .. } = solved;
        // The frames of one recording lack the same, and are judged together.
        let warnings = match index {
            0 => all_warnings(source, &report),
            _ => source.warnings.clone(),
        };
        let computed = report.made.computed.as_deref().map(str::to_owned);
        let notes = losses(source).chain(source.notes.iter().cloned()).chain(computed);
        FileImage {
            file: file.to_owned(),
            index: part.several.then_some(index),
            image,
            with_readings,
            used: used.rows().clone(),
            order,
            complex: parts.is_some(),
            recorded: source.frames.is_some(),
            report,
            outliers: source.outliers.iter().map(OutlierReport::of).collect(),
            notes: notes.collect(),
            warnings,
            taken: source.taken.clone(),
        }
    };
    let all = sources.iter().zip(made).enumerate();
    Ok(all.map(|(at, both)| image((part.from + at, both))).collect())
}

/// What a user must know of an image: of its readings, and whether they belong to their patterns.
pub(super) fn all_warnings(source: &Source, report: &MethodReport) -> Vec<String> {
    let mut warnings = source.all_warnings();
    // A named form of the readings says more.
    let doubt = source.warnings.is_empty().then(|| report.doubt(&source.measurements)).flatten();
    // A recording of our own camera numbers its readings.
    let may_be_shifted = doubt.is_none() && source.frames.is_none();
    let shift = may_be_shifted.then(|| report.better_shift(&source.measurements)).flatten();
    warnings.extend(doubt.or(shift));
    warnings
}

/// The readings that a measurement lacks, in words.
fn losses(source: &Source) -> impl Iterator<Item = String> {
    let dropped = |lost: &nirspi_recon::Dropout| {
        format!("drop-out: {} from y[{}] on", count_of(lost.length, "reading"), lost.start)
    };
    let not_read = (!source.not_read.is_empty()).then(|| not_read_words(&source.not_read));
    source.dropouts.iter().map(dropped).chain(not_read)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::Recipe;
    use crate::source::FirstPatterns;
    use nirspi_recon::Sampling;
    use nirspi_recon::reconstruct::{Method, MethodSettings};
    use std::fmt::Write;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn solver() -> Solver {
        solver_of(Method::HADAMARD)
    }

    fn solver_of(method: Method) -> Solver {
        Solver::new(Recipe {
            method,
            settings: MethodSettings::default(),
            dictionary: None,
            first: FirstPatterns::Recorded,
            sampling: Sampling::ALL,
        })
        .unwrap()
    }

    /// A measurement of n x n patterns, whose readings depend on `number`.
    fn measured(folder: &Path, number: usize, n: usize) -> PathBuf {
        let mut text = "n,h_row,d\n".to_owned();
        for row in 0..n * n {
            writeln!(text, "{n},{row},{}.5", (row * 7 + number * 11) % 31).unwrap();
        }
        let path = folder.join(format!("{number:02}.csv"));
        std::fs::write(&path, text).unwrap();
        path
    }

    #[test]
    fn images_are_those_of_the_files_alone_in_their_order() {
        let folder = tempfile::tempdir().unwrap();
        let files: Vec<PathBuf> = (0..40).map(|k| measured(folder.path(), k, 8)).collect();
        let (options, solver, done) = (SourceOptions::default(), solver(), AtomicUsize::new(0));
        let made = many_images(&files, &options, &solver, None, &|| {
            done.fetch_add(1, Ordering::Relaxed);
        });
        assert_eq!((made.skipped, done.into_inner()), (Vec::new(), 40));
        assert!(made.images.iter().map(|image| &image.file).eq(&files));
        for image in &made.images {
            let source = Source::read(&image.file, &options).unwrap();
            let alone = solver.solve(&image.file, &source).unwrap();
            assert_eq!(image.image.pixels(), alone.image.pixels());
            assert_eq!((image.index, image.used.len()), (None, 64));
        }
        assert_ne!(made.images[0].image.pixels(), made.images[1].image.pixels());
    }

    #[test]
    fn a_file_without_an_image_is_named_and_the_others_are_there() {
        let folder = tempfile::tempdir().unwrap();
        let [first, last] = [1, 2].map(|k| measured(folder.path(), k, 8));
        let other_side = measured(folder.path(), 3, 4);
        let gone = folder.path().join("gone.csv");
        let files = [first.clone(), gone.clone(), other_side.clone(), last.clone()];
        let made = many_images(&files, &SourceOptions::default(), &solver(), None, &|| {});
        let with: Vec<&PathBuf> = made.images.iter().map(|image| &image.file).collect();
        let without: Vec<&PathBuf> = made.skipped.iter().map(|skipped| &skipped.file).collect();
        assert_eq!((with, without), (vec![&first, &last], vec![&gone, &other_side]));
        assert!(made.skipped[0].reason.contains("no such file"), "{:?}", made.skipped);
        assert!(made.skipped[1].reason.contains("images of 4 x 4, expected 8 x 8"));
        assert!(made.skipped.iter().all(|skipped| !skipped.reason.contains('\n')));
    }

    #[test]
    fn a_stack_whose_readings_belong_to_other_patterns_is_doubted_once() {
        let folder = tempfile::tempdir().unwrap();
        let solver = solver_of(Method::TIKHONOV);
        let doubts = |value: fn(usize) -> f64| -> Vec<usize> {
            let path = folder.path().join("stack.csv");
            let mut text = "n,h_row,d\n".to_owned();
            (0..256).for_each(|row| writeln!(text, "16,{row},{}", value(row)).unwrap());
            std::fs::write(&path, text).unwrap();
            let read = || Source::read(&path, &SourceOptions::default()).unwrap();
            let sources: Vec<Source> = (0..10).map(|_| read()).collect();
            let all = Part { from: 0, several: true };
            let images = file_images(&path, &sources, &solver, all, false, &|| Ok(())).unwrap();
            let is_doubt = |warning: &&String| warning.contains("no better than chance");
            images.iter().map(|image| image.warnings.iter().filter(is_doubt).count()).collect()
        };
        // Readings of no scene, and those of a bright corner.
        let mut once = vec![0; 10];
        once[0] = 1;
        assert_eq!(doubts(|row| ((row * 7919 + 13) % 101) as f64 - 50.0), once);
        assert_eq!(doubts(|row| if row & 0x88 == 0 { 64.0 } else { 0.0 }), vec![0; 10]);
    }
}
