//! A method of reconstruction with its settings, prepared once for each side of images.

use crate::files::{FileError, npy};
use crate::imaging::{KnownReadings, MethodReport};
use crate::source::{FirstPatterns, Source};
use nirspi_recon::reconstruct::{
    GoingOn, Method, MethodSettings, OwnAtoms, Reconstruct, ReconstructError, Reconstruction,
    stack_while,
};
use nirspi_recon::words::count_of;
use nirspi_recon::{Image, MeasurementError, Measurements, Rows, Sampling, Shape, ShorterSweep};
use rayon::prelude::*;
use std::borrow::Borrow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use thiserror::Error;

/// How to make images of measurements.
#[derive(Debug, Clone)]
pub struct Recipe {
    /// The method.
    pub method: Method,
    /// Its settings, without a user's own atoms.
    pub settings: MethodSettings,
    /// A file of a user's own atoms: images of the measurements' side.
    pub dictionary: Option<PathBuf>,
    /// Which patterns a share uses.
    pub first: FirstPatterns,
    /// Share of the patterns to use.
    pub sampling: Sampling,
}

impl Default for Recipe {
    /// The default method with the shipped network, on all patterns.
    fn default() -> Self {
        Self {
            method: Method::default(),
            settings: nirspi_nets::prior::settings(),
            dictionary: None,
            first: FirstPatterns::default(),
            sampling: Sampling::ALL,
        }
    }
}

/// A recipe, ready for measurements of any side.
pub struct Solver {
    recipe: Recipe,
    prepared: Mutex<BTreeMap<usize, Arc<dyn Reconstruct>>>,
}

/// The image of one measurement.
#[derive(Debug)]
pub struct Solved {
    /// The image in the readings' units, corrected by the flat field; of complex readings, the
    /// magnitude.
    pub image: Image,
    /// The same with the readings as they are, for networks; `None` where that is the image itself, and of complex readings,
    /// which networks do not take.
    pub with_readings: Option<Image>,
    /// Of complex readings, the images of the real and of the imaginary part.
    pub parts: Option<[Image; 2]>,
    /// The measurements that were used.
    pub used: Measurements,
    /// The name of the order that chose them.
    pub order: String,
    /// How the readings were taken and the image was made, if their noise is known.
    pub readings: Option<KnownReadings>,
    /// The method's report.
    pub report: MethodReport,
}

/// Why measurements give no image.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SolverError {
    /// The share of the patterns cannot be taken of these measurements.
    #[error("{}", .path.display())]
    Measurements {
        /// The file.
        path: PathBuf,
        /// The problem.
        #[source]
        problem: MeasurementError,
    },
    /// The method gives no image.
    #[error(transparent)]
    Method(#[from] ReconstructError),
    /// The method gives no image with the user's own atoms.
    #[error("{}", .path.display())]
    WithAtoms {
        /// The file of the atoms.
        path: PathBuf,
        /// The problem.
        #[source]
        problem: ReconstructError,
    },
    /// The file of the user's own atoms cannot be read.
    #[error(transparent)]
    Atoms(#[from] FileError),
    /// The atoms have another size than the image.
    #[error("{}: images of {found:?}, expected {expected:?}", .path.display())]
    AtomsSize {
        /// The file of the atoms.
        path: PathBuf,
        /// Height and width of the atoms.
        found: (usize, usize),
        /// Height and width of the image.
        expected: (usize, usize),
    },
    /// A pixel is infinite.
    #[error("{}: the readings are too large for an image of 32-bit floats", .0.display())]
    TooLarge(PathBuf),
}

impl Solver {
    /// Checks the recipe. Files are read when they are needed.
    ///
    /// # Errors
    /// [`SolverError::Method`] if a setting is out of range or belongs to another method.
    pub fn new(recipe: Recipe) -> Result<Self, SolverError> {
        let mut settings = recipe.settings.clone();
        let atoms = |path: &PathBuf| own_atoms(path, Vec::new());
        settings.dictionary = recipe.dictionary.as_ref().map(atoms);
        settings.check(recipe.method)?;
        Ok(Self { recipe, prepared: Mutex::default() })
    }

    /// The method for images of this side, prepared once.
    ///
    /// # Errors
    /// [`SolverError`] if the atoms cannot be read or do not fit.
    pub fn prepared(&self, side: usize) -> Result<Arc<dyn Reconstruct>, SolverError> {
        let mut prepared = self.prepared.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(ready) = prepared.get(&side) {
            return Ok(Arc::clone(ready));
        }
        let Recipe { method, settings, dictionary, .. } = &self.recipe;
        let mut settings = settings.clone();
        if let Some(path) = dictionary {
            settings.dictionary = Some(own_atoms(path, read_atoms(path, (side, side))?));
        }
        let ready: Arc<dyn Reconstruct> = Arc::from(method.prepare(&settings)?);
        prepared.insert(side, Arc::clone(&ready));
        Ok(ready)
    }

    /// The images of measurements of one side: of [one kind](nirspi_recon::reconstruct::stack), or a video in which each frame starts
    /// from the frames before.
    fn images(
        &self,
        measurements: &[Measurements],
        is_video: bool,
        going_on: GoingOn<'_>,
    ) -> Result<Vec<Reconstruction>, SolverError> {
        let Some(first) = measurements.first() else { return Ok(Vec::new()) };
        let method = self.prepared(first.side().pixels())?;
        let made = match (is_video, measurements) {
            (true, _) => method.reconstruct_video(measurements),
            (false, [one]) => method.reconstruct(one).map(|made| vec![made]),
            (false, _) => stack_while(&*method, measurements, going_on),
        };
        match &self.recipe.dictionary {
            Some(path) => {
                made.map_err(|problem| SolverError::WithAtoms { path: path.clone(), problem })
            }
            None => Ok(made?),
        }
    }

    /// The image of measurements that were read from `path`.
    ///
    /// # Errors
    /// [`SolverError`] names the file and the problem.
    pub fn solve(&self, path: &Path, source: &Source) -> Result<Solved, SolverError> {
        Ok(self.solve_all(path, std::slice::from_ref(source), false, &|| Ok(()))?.remove(0))
    }

    /// The images of all measurements that were read from `path`, in their order. What is the same for
    /// measurements of [one kind](nirspi_recon::reconstruct::stack) is found out once. In a video, each frame starts from the
    /// frames before. `going_on` is called before the image of each, from any thread.
    ///
    /// # Errors
    /// As [`solve`](Self::solve); and the error of `going_on`.
    pub fn solve_all<S: Borrow<Source> + Sync>(
        &self,
        path: &Path,
        sources: &[S],
        is_video: bool,
        going_on: GoingOn<'_>,
    ) -> Result<Vec<Solved>, SolverError> {
        let Recipe { method, settings, dictionary, first, sampling } = &self.recipe;
        let wrong = |problem| SolverError::Measurements { path: path.to_owned(), problem };
        // Most measurements of a file have the same rows.
        let mut last: Option<(Rows, (ShorterSweep, String))> = None;
        let mut take = |measurements: &Measurements| {
            let rows = measurements.rows();
            let (sweep, order) = match last.take_if(|(of, _)| of == rows) {
                Some((_, taken)) => taken,
                None => first.among(rows, sampling.share()).map_err(wrong)?,
            };
            let taken = (sweep.of(measurements), order.clone());
            last = Some((rows.clone(), (sweep, order)));
            Ok::<_, SolverError>(taken)
        };
        let taken: Vec<(Measurements, String)> = sources
            .iter()
            .map(|source| take(&source.borrow().measurements))
            .collect::<Result<_, _>>()?;
        let (used, orders): (Vec<Measurements>, Vec<String>) = taken.into_iter().unzip();
        // Imaginary parts of complex readings: all measurements of a file have one, or none has.
        let imaginary = sources.iter().filter_map(|source| source.borrow().imaginary.as_ref());
        let imaginary: Vec<Measurements> =
            imaginary.map(|part| Ok(take(part)?.0)).collect::<Result<_, SolverError>>()?;
        let others = self.images(&imaginary, is_video, going_on)?.into_iter().map(Some);
        let others = others.chain(std::iter::repeat_with(|| None));
        let made = self.images(&used, is_video, going_on)?;
        let all: Vec<_> = made.into_iter().zip(others).zip(used).zip(orders).zip(sources).collect();
        let solved = |((((made, other), used), order), source): (_, &S)| {
            let source = source.borrow();
            let (made, other): (Reconstruction, Option<Reconstruction>) = (made, other);
            let Reconstruction { image, report: made } = made;
            let with_readings = match &other {
                None => made.with_readings(image.pixels(), &used),
                Some(_) => None,
            };
            let with_readings =
                with_readings.map(|pixels| source.flattened(Image::new(image.side(), pixels)));
            let parts = other.map(|other| [image.clone(), other.image]);
            let image = match &parts {
                None => image,
                Some([real, imaginary]) => Image::magnitude(real, imaginary),
            };
            check_finite(path, &image)?;
            let image = source.flattened(image);
            let report = MethodReport { method: *method, made };
            let readings = KnownReadings::new(&report, settings, &used);
            let readings = readings.filter(|_| dictionary.is_none());
            Ok(Solved { image, with_readings, parts, used, order, readings, report })
        };
        all.into_par_iter().map(solved).collect()
    }
}

/// Refuses an image with a pixel that is not finite.
///
/// # Errors
/// [`SolverError::TooLarge`], which names the file.
pub fn check_finite(path: &Path, image: &Image<impl Shape>) -> Result<(), SolverError> {
    match image.pixels().iter().all(|pixel| pixel.is_finite()) {
        true => Ok(()),
        false => Err(SolverError::TooLarge(path.to_owned())),
    }
}

/// A user's own images as atoms, named by their file.
#[must_use]
pub fn own_atoms(path: &Path, values: Vec<f32>) -> OwnAtoms {
    OwnAtoms { name: path.display().to_string(), values: values.into() }
}

/// A user's own images as atoms, of the height and width of the image.
///
/// # Errors
/// [`SolverError`] if the file cannot be read, or its images have another size.
pub fn read_atoms(path: &Path, expected: (usize, usize)) -> Result<Vec<f32>, SolverError> {
    let atoms = npy::read_stack(path)?;
    let found = (atoms.height, atoms.width);
    match found == expected {
        true => Ok(atoms.values),
        false => Err(SolverError::AtomsSize { path: path.to_owned(), found, expected }),
    }
}

/// The number of patterns that were not read, and the first of them, in words.
#[must_use]
pub fn not_read_words(places: &[usize]) -> String {
    const SHOWN: usize = 5;
    let first: Vec<String> = places.iter().take(SHOWN).map(usize::to_string).collect();
    let more = if places.len() > SHOWN { ", ..." } else { "" };
    let patterns = count_of(places.len(), "pattern");
    format!("not read: {patterns} left out, at [{}{more}] of those shown", first.join(", "))
}
