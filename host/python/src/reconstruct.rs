//! Reconstruction of one measurement or of many.
//!
//! # Invariant
//! An image is that of `nirspi reconstruct` on the same measurement, to the bit (`test_cli.py`).

use crate::arrays::{array, fill, room, rows, side, slice, whole};
use crate::errors::{of_source, refusal, refused};
use crate::made::said;
use crate::measurement::{self, numbers};
use crate::orders::named;
use crate::work::{backend, long};
use nirspi::imaging::MethodReport;
use nirspi::source::{FirstPatterns, Index, Several};
use nirspi_nets::{deblur, fusion};
use nirspi_own::{KnownNoise, NoiseFrom, OwnMatrix};
use nirspi_recon::reconstruct::{
    MatrixMethod, MatrixSettings, Method, MethodSettings, OwnAtoms, Penalty, Reconstruct,
    ReconstructError, Reconstruction, Report, Setting, Sparsity, Strength, stack_while,
};
use nirspi_recon::{Basis, Measurements, Rows, Sampling, SamplingError, ShorterSweep, Size};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// Word, name, description and settings of every method.
#[pyfunction]
pub fn methods() -> Vec<(&'static str, &'static str, &'static str)> {
    Method::ALL.iter().map(|method| (method.argument(), method.name(), method.about())).collect()
}

/// The words of the bases.
#[pyfunction]
pub fn bases() -> Vec<String> {
    Basis::ALL.iter().map(Basis::to_string).collect()
}

/// Options of a reconstruction.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Options<'py> {
    method: String,
    sampling: String,
    first_of: Option<String>,
    basis: Option<String>,
    dictionary: Option<PyReadonlyArray1<'py, f32>>,
    sparsity: Option<usize>,
    residual: Option<f64>,
    stop_at_noise: bool,
    strength: Option<f64>,
    as_printed: bool,
    non_negative: bool,
    warm_start: bool,
    /// Standard deviation of the noise of a difference, one number for all measurements or one for each; NaN or `None`:
    /// estimated.
    noise: Option<Vec<f64>>,
    /// What it is at most.
    most_noise: Option<Vec<f64>>,
    dark: bool,
    device: String,
}

impl Options<'_> {
    fn of_sampling(&self, error: &SamplingError) -> PyErr {
        refused(format!("sampling is {}, {error}", self.sampling))
    }

    fn method(&self) -> PyResult<Method> {
        self.method.parse().map_err(refusal)
    }

    fn sampling(&self) -> PyResult<f64> {
        let share: Sampling = self.sampling.parse().map_err(|error| self.of_sampling(&error))?;
        Ok(share.share())
    }

    fn first(&self) -> PyResult<FirstPatterns> {
        Ok(match self.first_of.as_deref() {
            None => FirstPatterns::LowestSequencies,
            Some("recorded") => FirstPatterns::Recorded,
            Some(order) => FirstPatterns::Of(named(order)?),
        })
    }

    fn basis(&self) -> PyResult<Basis> {
        match &self.basis {
            Some(name) => name.parse().map_err(refusal),
            None => Ok(Basis::Dct),
        }
    }

    fn settings(&self) -> PyResult<MethodSettings> {
        let default = MethodSettings::default();
        if self.stop_at_noise && (self.sparsity.is_some() || self.as_printed) {
            return Err(refused(
                "stop_at_noise beside sparsity or as_printed, expected one of them",
            ));
        }
        if self.as_printed && self.sparsity.is_none() {
            return Err(refused("as_printed needs sparsity"));
        }
        let dictionary = match &self.dictionary {
            Some(atoms) => Some(OwnAtoms {
                name: "atoms of the caller".to_owned(),
                values: slice(atoms)?.to_vec().into(),
            }),
            None => None,
        };
        Ok(MethodSettings {
            basis: self.basis()?,
            dictionary,
            sparsity: match self.sparsity {
                Some(atoms) => Sparsity::Fixed(atoms),
                None if self.stop_at_noise => Sparsity::Noise,
                None => default.sparsity,
            },
            residual: self.residual.unwrap_or(default.residual),
            as_printed: self.as_printed,
            non_negative: self.non_negative,
            strength: self.strength.map_or(default.strength, Strength::Fixed),
            network: Some(nirspi_nets::prior::shipped()),
            backend: backend(&self.device)?.0,
        })
    }
}

/// The measurements of a frame without the patterns that were not read (NaN).
fn frame(rows: &Rows, d: &[f64], [known, most]: [Option<f64>; 2]) -> PyResult<Measurements> {
    let with_noise = |measurements: Measurements| match known {
        Some(noise) => measurements.with_most_noise(most).with_noise(noise),
        None => Ok(measurements.with_most_noise(most)),
    };
    // Without an early end, so that the compiler uses vectors.
    if !d.iter().fold(false, |nan, value| nan | value.is_nan()) {
        return Measurements::from_differential(rows, d).and_then(with_noise).map_err(refusal);
    }
    let read = || rows.iter().zip(d).filter(|(_, value)| !value.is_nan());
    let kept = Rows::new(rows.side(), read().map(|(&row, _)| row));
    let kept =
        kept.map_err(|_| refused("d has no pattern that was read, expected at least one"))?;
    let values: Vec<f64> = read().map(|(_, &value)| value).collect();
    Measurements::from_differential(&kept, &values).and_then(with_noise).map_err(refusal)
}

fn stopped() -> PyErr {
    refused("stopped")
}

/// The text of a refusal, without the words of the command line.
fn of_method(error: ReconstructError) -> PyErr {
    refusal(error)
}

/// What is known of the noise of a difference, and what it is at most: one number for all measurements, or one for each.
#[derive(Clone, Default)]
struct Noise([Option<Vec<f64>>; 2]);

impl Noise {
    /// Checks that there is one number, or one for each measurement.
    fn check(&self, count: usize) -> PyResult<()> {
        match self.0.iter().flatten().find(|said| said.len() != 1 && said.len() != count) {
            None => Ok(()),
            Some(said) => {
                let found = said.len();
                Err(refused(format!("{found} noises, expected one, or one for each of {count}")))
            }
        }
    }

    /// That of the measurement of this index.
    fn of(&self, index: usize) -> [Option<f64>; 2] {
        let said = |all: &Option<Vec<f64>>| all.as_ref().map(|all| all[index % all.len()]);
        [&self.0[0], &self.0[1]].map(|all| said(all).filter(|sigma| !sigma.is_nan()))
    }
}

/// A method made ready for measurements of the same rows.
struct Ready {
    method: Box<dyn Reconstruct>,
    rows: Rows,
    first: FirstPatterns,
    sampling: f64,
    noise: Noise,
    /// Worked out once, for all measurements without a pattern that was not read.
    whole: ShorterSweep,
    order: String,
}

impl Ready {
    fn new(
        method: Method,
        settings: &MethodSettings,
        rows: Rows,
        first: FirstPatterns,
        sampling: f64,
        noise: Noise,
    ) -> PyResult<Self> {
        let method = method.prepare(settings).map_err(of_method)?;
        let (whole, order) = first.among(&rows, sampling).map_err(refusal)?;
        Ok(Self { method, rows, first, sampling, noise, whole, order })
    }

    /// The measurements that are used of the differences of this index, and the name of the order that chose them.
    fn taken(&self, index: usize, d: &[f64]) -> PyResult<(Measurements, String)> {
        let frame = frame(&self.rows, d, self.noise.of(index))?;
        if *frame.rows() == self.rows {
            return Ok((self.whole.shorten(frame), self.order.clone()));
        }
        self.first.take(&frame, self.sampling).map_err(refusal)
    }

    /// Writes the image of the differences of this index to `pixels`.
    fn image(&self, index: usize, d: &[f64], pixels: &mut [f32]) -> PyResult<Made> {
        let (used, order) = self.taken(index, d)?;
        let report = self.method.reconstruct_into(&used, pixels).map_err(of_method)?;
        Made::new(report, &used, order, pixels)
    }

    /// Writes the images of these differences to `pixels`, one after another: each frame of a video may
    /// start from those before, and what is the same for all of a kind is found out once.
    fn images(
        &self,
        d: &[f64],
        pixels: &mut [f32],
        warm: bool,
        stop: &AtomicBool,
    ) -> PyResult<Vec<Made>> {
        let area = self.rows.side().area();
        let is_on = || !stop.load(Ordering::Relaxed);
        if !warm && self.method.is_of_each() {
            let one = |(index, (d, place)): (usize, (&[f64], &mut [f32]))| match is_on() {
                true => self.image(index, d, place),
                false => Err(stopped()),
            };
            let frames = d.par_chunks_exact(self.rows.len());
            let frames = frames.zip(pixels.par_chunks_exact_mut(area)).enumerate();
            return frames.map(one).collect();
        }
        let frames = d.par_chunks_exact(self.rows.len()).enumerate();
        let taken = frames.map(|(index, d)| self.taken(index, d)).collect::<PyResult<Vec<_>>>()?;
        let (used, orders): (Vec<Measurements>, Vec<String>) = taken.into_iter().unzip();
        let going_on = || if is_on() { Ok(()) } else { Err(ReconstructError::Stopped) };
        let made = match warm {
            true => self.method.reconstruct_video(&used),
            false => stack_while(&*self.method, &used, &going_on),
        };
        let parts = made.map_err(of_method)?.into_iter().zip(used.iter().zip(orders));
        let one = |((made, (used, order)), place): ((Reconstruction, _), &mut [f32])| {
            place.copy_from_slice(made.image.pixels());
            Made::new(made.report, used, order, place)
        };
        parts.zip(pixels.chunks_exact_mut(area)).map(one).collect()
    }
}

/// Sides of the images of readings that `enhance` takes.
const NETWORKS_SIDES: [usize; 2] = [fusion::SIDE, deblur::SIDE];

/// What an image was made of.
struct Made {
    report: Report,
    used: Rows,
    order: String,
    /// The pixels that the networks get, where these are others and the networks take this size.
    for_networks: Option<Vec<f32>>,
}

impl Made {
    /// Refuses an image that 32-bit floats cannot hold.
    fn new(report: Report, used: &Measurements, order: String, pixels: &[f32]) -> PyResult<Self> {
        // Without an early end, so that the compiler uses vectors.
        if !pixels.iter().fold(true, |finite, pixel| finite & pixel.is_finite()) {
            return Err(refused("the readings are too large for an image of 32-bit floats"));
        }
        let of_networks = NETWORKS_SIDES.contains(&used.side().pixels());
        let for_networks = of_networks.then(|| report.with_readings(pixels, used)).flatten();
        Ok(Self { report, used: used.rows().clone(), order, for_networks })
    }

    fn has_report_of(&self, other: &Self) -> bool {
        self.report == other.report
            && self.used.len() == other.used.len()
            && self.order == other.order
    }

    /// The report as JSON.
    fn report(&self, method: Method) -> PyResult<String> {
        let made = &self.report;
        let named = MethodReport { method, made: made.clone() };
        let mut report =
            serde_json::to_value(&named).map_err(|error| refused(error.to_string()))?;
        report["used"] = self.used.len().into();
        report["order"] = self.order.as_str().into();
        report["warm"] = made.warm.into();
        report["words"] = made.to_string().into();
        Ok(report.to_string())
    }
}

/// Reports as JSON, each with the number of images in a row that it is of.
type Reports = Vec<(String, usize)>;

/// How images were made, and the rows used: of each image, or those of all if they are the same.
struct Account {
    reports: Reports,
    rows: Vec<Rows>,
    /// The images that the networks get; none where these are the images themselves.
    for_networks: Vec<f32>,
}

/// Images one after another.
type Pixels<'py> = Bound<'py, PyArray1<f32>>;

/// An [`Account`] for Python: reports, rows, pixels for the networks.
type OfPython<'py> = (Reports, Vec<Bound<'py, PyArray1<i64>>>, Pixels<'py>);

impl Account {
    fn of(mut made: Vec<Made>, method: Method, pixels: &[f32]) -> PyResult<Self> {
        let mut for_networks = Vec::new();
        if made.iter().any(|one| one.for_networks.is_some()) {
            let area = pixels.len() / made.len();
            for (one, shown) in made.iter_mut().zip(pixels.chunks_exact(area)) {
                for_networks.extend_from_slice(one.for_networks.take().as_deref().unwrap_or(shown));
            }
        }
        // The reports of a simple method are all the same.
        let alike = made.chunk_by(|one, next| next.has_report_of(one));
        let reports = alike.map(|alike| Ok((alike[0].report(method)?, alike.len())));
        let reports = reports.collect::<PyResult<Vec<_>>>()?;
        let mut rows: Vec<Rows> = made.into_iter().map(|one| one.used).collect();
        if rows.windows(2).all(|two| two[0] == two[1]) {
            rows.truncate(1);
        }
        Ok(Self { reports, rows, for_networks })
    }

    fn into_python(self, py: Python<'_>) -> OfPython<'_> {
        let rows = self.rows.iter().map(|rows| array(py, numbers(rows))).collect();
        (self.reports, rows, array(py, self.for_networks))
    }
}

/// The images of frames of differences, and an [`Account`] of them.
#[pyfunction]
pub fn reconstruct<'py>(
    py: Python<'py>,
    n: u64,
    shown: PyReadonlyArray1<'py, i64>,
    d: PyReadonlyArray1<'py, f64>,
    options: &Bound<'py, PyDict>,
) -> PyResult<(Pixels<'py>, OfPython<'py>)> {
    let mut options: Options<'_> = options.extract()?;
    let (method, settings) = (options.method()?, options.settings()?);
    let (first, sampling) = (options.first()?, options.sampling()?);
    let warm = options.warm_start;
    let noise = Noise([options.noise.take(), options.most_noise.take()]);
    if warm && !method.takes(Setting::WarmStart) {
        let methods = Method::listed(|method| method.takes(Setting::WarmStart));
        return Err(refused(format!("warm-start belongs to {methods}, not to {method}")));
    }
    settings.check(method).map_err(of_method)?;
    let rows = rows(side(n)?, &shown)?;
    let d = slice(&d)?;
    let area = rows.side().area();
    let count = whole("d", d.len(), rows.len())?;
    noise.check(count)?;
    let pixels = room::<f32>(py, count * area)?;
    let mut place = pixels.readwrite();
    let places = fill(&mut place)?;
    let account = long(py, |stop| {
        let ready = Ready::new(method, &settings, rows, first, sampling, noise)?;
        let made = ready.images(d, places, warm, stop)?;
        Account::of(made, method, places)
    })?;
    drop(place);
    Ok((pixels, account.into_python(py)))
}

/// Side of the images, their number, the images, an account of them, and where the readings come from, as JSON.
type OfFile<'py> = (usize, usize, Pixels<'py>, OfPython<'py>, String);

/// As [`reconstruct`], of all measurements of a file, which are read while they are reconstructed; before them the side
/// of the images and their number. `None` for a file or options that need all measurements in memory first, and for a
/// measurement that is refused.
#[pyfunction]
pub fn reconstruct_file<'py>(
    py: Python<'py>,
    path: PathBuf,
    source: &Bound<'py, PyDict>,
    options: &Bound<'py, PyDict>,
) -> PyResult<Option<OfFile<'py>>> {
    let source = source.extract::<measurement::Options>()?.checked()?;
    let options: Options<'_> = options.extract()?;
    if options.warm_start || source.index != Some(Index::All) {
        return Ok(None);
    }
    let (method, settings) = (options.method()?, options.settings()?);
    let (first, sampling) = (options.first()?, options.sampling()?);
    settings.check(method).map_err(of_method)?;
    if !method.prepare(&settings).map_err(of_method)?.is_of_each() {
        // What is the same for all measurements is found out before their images are made.
        return Ok(None);
    }
    let Some(mut several) = long(py, |_| Several::of(&path, &source).map_err(of_source))? else {
        return Ok(None);
    };
    let Some(stack) = long(py, |_| several.stack().map_err(of_source))? else {
        return Ok(None);
    };
    let (side, count) = (stack.side(), stack.count());
    let taken = said(&stack.taken().clone().from_file(&path))?;
    let noise = stack.noise(0);
    if (1..count).any(|index| stack.noise(index) != noise) {
        // While it is read, a measurement does not know its index.
        return Ok(None);
    }
    let noise = Noise(noise.map(|said| said.map(|sigma| vec![sigma])));
    let pixels = room::<f32>(py, count * side.area())?;
    let mut place = pixels.readwrite();
    let places = fill(&mut place)?;
    let account = long(py, |stop| {
        let ready = Ready::new(method, &settings, stack.rows().clone(), first, sampling, noise)?;
        let one = |d: &[f64], place: &mut [f32]| match stop.load(Ordering::Relaxed) {
            true => None,
            false => ready.image(0, d, place).ok(),
        };
        let made = stack.map_into(places, one).map_err(|error| of_source(error.into()))?;
        made.map(|made| Account::of(made, method, places)).transpose()
    })?;
    drop(place);
    Ok(account.map(|account| (side.pixels(), count, pixels, account.into_python(py), taken)))
}

/// The images of readings by patterns of one's own, and a report of each as JSON.
#[pyfunction]
pub fn reconstruct_matrix<'py>(
    py: Python<'py>,
    size: (usize, usize),
    weights: PyReadonlyArray1<'py, f64>,
    y: PyReadonlyArray1<'py, f64>,
    options: &Bound<'py, PyDict>,
) -> PyResult<(Bound<'py, PyArray1<f32>>, Vec<String>)> {
    let mut options: Options<'_> = options.extract()?;
    let noise = Noise([options.noise.take(), None]);
    let method = options.method()?;
    let settings = options.settings()?;
    settings.check(method).map_err(of_method)?;
    let Some(how) = method.with_matrix() else {
        let methods = Method::listed(|method| method.with_matrix().is_some());
        return Err(refused(format!("{method} needs Hadamard rows; with a matrix, use {methods}")));
    };
    let settings = MatrixSettings {
        basis: settings.basis,
        atoms: settings.dictionary.map(|atoms| atoms.values.to_vec()),
        strength: options.strength,
        sparsity: options.sparsity,
        non_negative: settings.non_negative,
        dark: options.dark,
        ..MatrixSettings::new(how)
    };
    let size = Size::new(size.0, size.1).map_err(refusal)?;
    let (weights, y) = (slice(&weights)?, slice(&y)?);
    let (pixels, reports) = long(py, |stop| {
        let matrix = OwnMatrix::new(size, weights).map_err(refusal)?;
        of_matrix(&matrix, (y, &noise), method, &settings, stop)
    })?;
    Ok((array(py, pixels), reports))
}

/// Measurements between two looks whether the program is to stop.
const TOGETHER: usize = 32;

fn of_matrix(
    matrix: &OwnMatrix,
    (y, noise): (&[f64], &Noise),
    method: Method,
    settings: &MatrixSettings,
    stop: &AtomicBool,
) -> PyResult<(Vec<f32>, Vec<String>)> {
    whole("y", y.len(), matrix.patterns())?;
    let (mut pixels, mut reports) = (Vec::new(), Vec::new());
    let all: Vec<&[f64]> = y.chunks_exact(matrix.patterns()).collect();
    noise.check(all.len())?;
    let weighs = matrix.weighs_noise(settings);
    let is_stated = (0..all.len()).any(|index| noise.of(index)[0].is_some());
    let found = if weighs && !is_stated { matrix.known_noise(&all) } else { None };
    let known = |index: usize| {
        let stated = noise.of(index)[0].filter(|_| weighs);
        stated.map(|sigma| KnownNoise { sigma, from: NoiseFrom::Stated }).or(found)
    };
    let mut next = 0;
    while next < all.len() {
        let (first, of_some) = (next, known(next));
        while next < all.len().min(first + TOGETHER) && known(next) == of_some {
            next += 1;
        }
        let (some, sigma) = (&all[first..next], of_some.map(|known| known.sigma));
        let most_noise = (first..next).map(|index| noise.of(index)[1]).collect();
        let settings = &MatrixSettings { noise: sigma, most_noise, ..settings.clone() };
        if stop.load(Ordering::Relaxed) {
            return Err(stopped());
        }
        for made in matrix.reconstruct_all(some, settings).map_err(refusal)? {
            pixels.extend_from_slice(made.image.pixels());
            let (atoms, why) = made.atoms.map(|(atoms, stop)| (atoms, format!("{stop:?}"))).unzip();
            let method = Method::of_matrix(made.method).unwrap_or(method);
            let used = of_some.filter(|_| made.method == MatrixMethod::Penalty(Penalty::Tikhonov));
            let report = serde_json::json!({
                "method": method.argument(), "used": matrix.patterns(), "order": "as given", "warm": false,
                "rank": matrix.rank(), "unseen_pixels": matrix.unseen_pixels(),
                "strength": made.strength, "sparsity": atoms, "stop": why,
                "dark_level": settings.dark.then_some(made.dark.value()), "note": made.dark.note(),
                "noise_of_a_reading": used.map(|known| known.sigma),
                "noise_from": used.map(|known| known.from.name()),
                "relative_residual": made.residual,
                "words": format!("{}, {} patterns of one's own, dark level {:.4}, relative residual {:.3}",
                                 method.name(), matrix.patterns(), made.dark.value(), made.residual),
            });
            reports.push(report.to_string());
        }
    }
    Ok((pixels, reports))
}
