//! The images of many files, which are one stack: what is the same for measurements of
//! [one kind](nirspi_recon::reconstruct::stack) is found out once, as for the measurements of one file.
//!
//! # Invariant
//! Images are those of a file with all measurements, in the order of the files
//! (`tests::images_are_those_of_one_file_with_all_measurements_in_their_order`). A file that gives no
//! image is named with the reason and takes no other with it
//! (`tests::a_file_without_an_image_is_named_and_the_others_are_there`).

use super::{Solved, Solver, SolverError, not_read_words};
use crate::causes::in_one_line;
use crate::imaging::MethodReport;
use crate::provenance::Taken;
use crate::source::{Index, OutlierReport, Source, SourceError, SourceOptions};
use nirspi_recon::reconstruct::{GoingOn, HeldBack, ReconstructError};
use nirspi_recon::words::count_of;
use nirspi_recon::{Image, Rows};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
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
    /// The same with the readings as they are, for networks; `None` where that is the image itself.
    pub with_readings: Option<Image>,
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
    /// Whether the work was ended. Then there are no images.
    pub stopped: bool,
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
/// frame of each recording. `goes_on` is called once a file, from any thread; if it is false there are no images.
pub(super) fn many_images(
    files: &[PathBuf],
    options: &SourceOptions,
    series: &mut Series<'_>,
    goes_on: &(dyn Fn() -> bool + Sync),
) -> ManyImages {
    let read: Vec<_> = files.par_iter().map(|file| sources_of(file, options)).collect();
    let (mut wrong, mut right) = (BTreeMap::new(), Vec::new());
    for (number, (file, read)) in files.iter().zip(read).enumerate() {
        match read.and_then(|sources| of_one_side(file, sources, &mut series.side)) {
            Ok(sources) => right.push(Read { number, file, sources }),
            Err(error) => {
                wrong.insert(number, error);
                goes_on();
            }
        }
    }
    let pace = Pace::new(&right, goes_on);
    let images = images_of(&right, series, &mut wrong, &pace);
    let skipped = |(number, error): (usize, NoImage)| {
        let file = files[number].to_string_lossy().into_owned().into();
        Skipped { file, reason: in_one_line(&error) }
    };
    let skipped = wrong.into_iter().map(skipped).collect();
    ManyImages { images, skipped, stopped: pace.stopped.into_inner() }
}

/// Files of which some are read at a time, and what is known of them so far.
pub(super) struct Series<'s> {
    solver: &'s Solver,
    /// That of the images.
    pub side: Option<usize>,
    verdicts: Verdicts,
}

impl<'s> Series<'s> {
    /// Files whose images this solver makes.
    pub(super) fn of(solver: &'s Solver) -> Self {
        Self { solver, side: None, verdicts: Verdicts::default() }
    }
}

/// A file that was read.
struct Read<'f> {
    number: usize,
    file: &'f Path,
    sources: Vec<Source>,
}

impl Read<'_> {
    /// The measurements, each with its number in a file of several.
    fn each(&self) -> impl Iterator<Item = (Option<usize>, &Source)> {
        let several = self.sources.len() > 1;
        self.sources.iter().enumerate().map(move |(at, source)| (several.then_some(at), source))
    }
}

/// How far the images of files are. `goes_on` is called as often as there are files, whatever the number of their images.
struct Pace<'g> {
    files: usize,
    images: usize,
    begun: AtomicUsize,
    goes_on: &'g (dyn Fn() -> bool + Sync),
    stopped: AtomicBool,
}

impl<'g> Pace<'g> {
    fn new(read: &[Read<'_>], goes_on: &'g (dyn Fn() -> bool + Sync)) -> Self {
        let images = read.iter().map(|read| read.sources.len()).sum();
        let (begun, stopped) = (AtomicUsize::new(0), AtomicBool::new(false));
        Self { files: read.len(), images, begun, goes_on, stopped }
    }

    fn before_image(&self) -> Result<(), ReconstructError> {
        let begun = self.begun.fetch_add(1, Ordering::Relaxed);
        // Images that are made again do not count.
        let files = |images: usize| images.min(self.images) * self.files / self.images.max(1);
        if files(begun + 1) > files(begun) && !(self.goes_on)() {
            self.stopped.store(true, Ordering::Relaxed);
        }
        match self.stopped.load(Ordering::Relaxed) {
            true => Err(ReconstructError::Stopped),
            false => Ok(()),
        }
    }
}

fn of_one_side(
    file: &Path,
    sources: Vec<Source>,
    side: &mut Option<usize>,
) -> Result<Vec<Source>, NoImage> {
    let Some(n) = sources.first().map(|source| source.measurements.side().pixels()) else {
        return Ok(sources);
    };
    match *side.get_or_insert(n) {
        expected if n != expected => Err(NoImage::Side { file: file.to_owned(), n, expected }),
        _ => Ok(sources),
    }
}

fn sources_of(file: &Path, options: &SourceOptions) -> Result<Vec<Source>, NoImage> {
    if file.to_str().is_none() {
        return Err(NoImage::Name(file.to_owned()));
    }
    let is_one = match options.index {
        Some(Index::One(_)) => true,
        Some(Index::All) => false,
        None => options.fits_recording(file)?,
    };
    Ok(match is_one {
        true => vec![Source::read(file, options)?],
        false => Source::read_all(file, options)?,
    })
}

/// The images of all files that give some; the others are added to `wrong`. Where files give none together, each gives its own.
fn images_of(
    read: &[Read<'_>],
    series: &Series<'_>,
    wrong: &mut BTreeMap<usize, NoImage>,
    pace: &Pace<'_>,
) -> Vec<FileImage> {
    if let Ok(images) = together(read, series, pace) {
        return images;
    }
    let alone = |read: &Read<'_>| together(std::slice::from_ref(read), series, pace);
    let made: Vec<_> = read.par_iter().map(alone).collect();
    let mut all = Vec::new();
    if pace.stopped.load(Ordering::Relaxed) {
        return all;
    }
    for (read, made) in read.iter().zip(made) {
        match made {
            Ok(images) => all.extend(images),
            Err(error) => drop(wrong.insert(read.number, error.into())),
        }
    }
    all
}

/// The images of all measurements of these files, in their order.
fn together(
    read: &[Read<'_>],
    series: &Series<'_>,
    pace: &Pace<'_>,
) -> Result<Vec<FileImage>, SolverError> {
    let Some(first) = read.first() else { return Ok(Vec::new()) };
    let all: Vec<(&Path, Option<usize>, &Source)> = read
        .iter()
        .flat_map(|read| read.each().map(|(index, source)| (read.file, index, source)))
        .collect();
    // Parts of complex readings are made together: those of files that have both.
    let (complex, real): (Vec<usize>, Vec<usize>) =
        (0..all.len()).partition(|&at| all[at].2.imaginary.is_some());
    let mut made = BTreeMap::new();
    for places in [complex, real] {
        let sources: Vec<&Source> = places.iter().map(|&at| all[at].2).collect();
        let solved =
            series.solver.solve_all(first.file, &sources, false, &|| pace.before_image())?;
        for (at, solved) in places.into_iter().zip(solved) {
            let (file, index, source) = all[at];
            let doubts = series.verdicts.doubts(source, &solved.report);
            let warnings = source.all_warnings().into_iter().chain(doubts).collect();
            made.insert(at, file_image((file, index), source, solved, warnings));
        }
    }
    Ok(made.into_values().collect())
}

/// The doubts about measurements, found out once for those of the same patterns of which held-back readings confirm about the
/// same share.
#[derive(Default)]
struct Verdicts(Mutex<HashMap<Doubted, Vec<Verdict>>>);

/// The patterns, and what else the doubts depend on.
type Doubted = (Rows, [bool; 3]);

/// What held-back readings say of measurements, and the doubts about them.
type Verdict = (HeldBack, Vec<String>);

/// Difference of the confirmed shares from which the doubts about measurements are found out for each.
const ANOTHER_SHARE: f64 = 0.05;

impl Verdicts {
    /// Whether the readings belong to their patterns.
    fn doubts(&self, source: &Source, report: &MethodReport) -> Vec<String> {
        let Some(found) = report.made.held_back else { return Vec::new() };
        let can_be_judged = MethodReport::can_be_judged(&source.measurements);
        let of_source = [source.warnings.is_empty(), source.frames.is_some(), can_be_judged];
        let of = (source.measurements.rows().clone(), of_source);
        let is_alike = |(one, _): &&Verdict| {
            one.is_by_chance() == found.is_by_chance()
                && (one.confirmed - found.confirmed).abs() < ANOTHER_SHARE
        };
        let all = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let known = all().get(&of).and_then(|known| known.iter().find(is_alike).cloned());
        // Not while others wait: finding out takes the other threads too.
        let (_, doubts) = known.unwrap_or_else(|| {
            let verdict = (found, doubts(source, report));
            all().entry(of).or_default().push(verdict.clone());
            verdict
        });
        doubts
    }
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
    series: &Series<'_>,
    part: Part,
    is_video: bool,
    going_on: GoingOn<'_>,
) -> Result<Vec<FileImage>, SolverError> {
    let made = series.solver.solve_all(file, sources, is_video, going_on)?;
    let all = sources.iter().zip(made).enumerate();
    let image = |(at, (source, solved)): (usize, (&Source, Solved))| {
        let index = part.from + at;
        // The frames of one recording lack the same.
        let mut warnings = match index {
            0 => source.all_warnings(),
            _ => source.warnings.clone(),
        };
        warnings.extend(series.verdicts.doubts(source, &solved.report));
        file_image((file, part.several.then_some(index)), source, solved, warnings)
    };
    Ok(all.map(image).collect())
}

/// The image of one measurement, with the number of the measurement in a file of several.
fn file_image(
    (file, index): (&Path, Option<usize>),
    source: &Source,
    solved: Solved,
    warnings: Vec<String>,
) -> FileImage {
    let Solved { image, with_readings, parts, used, order, report, .. } = solved;
    let computed = report.made.computed.as_deref().map(str::to_owned);
    let notes = losses(source).chain(source.notes.iter().cloned()).chain(computed);
    FileImage {
        file: file.to_owned(),
        index,
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
}

/// Whether the readings belong to their patterns.
pub(super) fn doubts(source: &Source, report: &MethodReport) -> Vec<String> {
    // A named form of the readings says more.
    let doubt = source.warnings.is_empty().then(|| report.doubt(&source.measurements)).flatten();
    // A recording of our own camera numbers its readings.
    let may_be_shifted = doubt.is_none() && source.frames.is_none();
    let shift = may_be_shifted.then(|| report.better_shift(&source.measurements)).flatten();
    doubt.or(shift).into_iter().collect()
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
        Solver::new(recipe_of(method)).unwrap()
    }

    fn recipe_of(method: Method) -> Recipe {
        Recipe {
            method,
            settings: MethodSettings::default(),
            dictionary: None,
            first: FirstPatterns::Recorded,
            sampling: Sampling::ALL,
        }
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
    fn images_are_those_of_one_file_with_all_measurements_in_their_order() {
        let folder = tempfile::tempdir().unwrap();
        let files: Vec<PathBuf> = (0..40).map(|k| measured(folder.path(), k, 8)).collect();
        let (options, asked) = (SourceOptions::default(), AtomicUsize::new(0));
        let read = |file| Source::read(file, &options).unwrap();
        let sources: Vec<Source> = files.iter().map(|file| read(file)).collect();
        for method in [Method::HADAMARD, Method::TIKHONOV] {
            let solver = solver_of(method);
            let made = many_images(&files, &options, &mut Series::of(&solver), &|| {
                asked.fetch_add(1, Ordering::Relaxed);
                true
            });
            assert!(made.skipped.is_empty() && !made.stopped);
            assert!(made.images.iter().map(|image| &image.file).eq(&files));
            let all = solver.solve_all(&files[0], &sources, false, &|| Ok(())).unwrap();
            for (image, of_stack) in made.images.iter().zip(&all) {
                assert_eq!(image.image.pixels(), of_stack.image.pixels());
                assert_eq!((image.index, image.used.len()), (None, 64));
            }
            assert_ne!(made.images[0].image.pixels(), made.images[1].image.pixels());
        }
        assert_eq!(asked.into_inner(), 80, "once a file");
        let made = many_images(&files, &options, &mut Series::of(&solver()), &|| false);
        assert!(made.stopped && made.images.is_empty() && made.skipped.is_empty());
    }

    #[test]
    fn files_that_give_no_image_together_are_each_named() {
        let folder = tempfile::tempdir().unwrap();
        let files: Vec<PathBuf> = (0..20).map(|k| measured(folder.path(), k, 8)).collect();
        let dictionary = Some(folder.path().join("gone.npy"));
        let solver = Solver::new(Recipe { dictionary, ..recipe_of(Method::OMP) }).unwrap();
        let made =
            many_images(&files, &SourceOptions::default(), &mut Series::of(&solver), &|| true);
        assert!(made.images.is_empty() && !made.stopped);
        assert!(made.skipped.iter().map(|skipped| &skipped.file).eq(&files));
        assert!(made.skipped.iter().all(|skipped| skipped.reason.contains("gone.npy")));
    }

    #[test]
    fn files_of_one_kind_are_doubted_together_and_others_by_themselves() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, value: &dyn Fn(usize) -> f64| {
            let mut text = "n,h_row,d\n".to_owned();
            (0..256).for_each(|row| writeln!(text, "16,{row},{}", value(row)).unwrap());
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let of_no_scene = |row: usize| ((row * 7919 + 13) % 101) as f64 - 50.0;
        let corner = |row: usize| if row & 0x88 == 0 { 64.0 } else { 0.0 };
        let mut files: Vec<PathBuf> =
            (0..10).map(|k| write(&format!("{k}.csv"), &of_no_scene)).collect();
        files.push(write("bright.csv", &|row| 100.0 * corner(row)));
        let solver = solver_of(Method::TIKHONOV);
        let mut series = Series::of(&solver);
        let is_doubt = |warning: &&String| warning.contains("no better than chance");
        let mut doubts = |files: &[PathBuf]| -> Vec<usize> {
            let made = many_images(files, &SourceOptions::default(), &mut series, &|| true);
            let doubts = |image: &FileImage| image.warnings.iter().filter(is_doubt).count();
            made.images.iter().map(doubts).collect()
        };
        assert_eq!(doubts(&files), [[1; 10].as_slice(), &[0]].concat());
        // Files after them are known.
        assert_eq!(doubts(&files[5..]), [1, 1, 1, 1, 1, 0]);
        let known = series.verdicts.0.into_inner().unwrap();
        assert_eq!(known.values().map(Vec::len).collect::<Vec<_>>(), [2]);
    }

    #[test]
    fn a_file_without_an_image_is_named_and_the_others_are_there() {
        let folder = tempfile::tempdir().unwrap();
        let [first, last] = [1, 2].map(|k| measured(folder.path(), k, 8));
        let other_side = measured(folder.path(), 3, 4);
        let gone = folder.path().join("gone.csv");
        let files = [first.clone(), gone.clone(), other_side.clone(), last.clone()];
        let made =
            many_images(&files, &SourceOptions::default(), &mut Series::of(&solver()), &|| true);
        let with: Vec<&PathBuf> = made.images.iter().map(|image| &image.file).collect();
        let without: Vec<&PathBuf> = made.skipped.iter().map(|skipped| &skipped.file).collect();
        assert_eq!((with, without), (vec![&first, &last], vec![&gone, &other_side]));
        assert!(made.skipped[0].reason.contains("no such file"), "{:?}", made.skipped);
        assert!(made.skipped[1].reason.contains("images of 4 x 4, expected 8 x 8"));
        assert!(made.skipped.iter().all(|skipped| !skipped.reason.contains('\n')));
    }

    #[test]
    fn each_image_of_a_stack_whose_readings_belong_to_other_patterns_is_doubted() {
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
            let images = file_images(&path, &sources, &Series::of(&solver), all, false, &|| Ok(()));
            let is_doubt = |warning: &&String| warning.contains("no better than chance");
            images
                .unwrap()
                .iter()
                .map(|image| image.warnings.iter().filter(is_doubt).count())
                .collect()
        };
        // Readings of no scene, and those of a bright corner.
        assert_eq!(doubts(|row| ((row * 7919 + 13) % 101) as f64 - 50.0), vec![1; 10]);
        assert_eq!(doubts(|row| if row & 0x88 == 0 { 64.0 } else { 0.0 }), vec![0; 10]);
    }
}
