//! Reconstruction of one measurement or of many.
//!
//! # Invariant
//! An image is that of `nirspi reconstruct` on the same measurement, to the bit (`test_cli.py`).

use crate::arrays::{array, fill, room, rows, side, slice, whole};
use crate::errors::{refusal, refused};
use crate::orders::named;
use crate::work::{backend, long};
use nirspi::imaging::MethodReport;
use nirspi::reconstruct::Recipe;
use nirspi::source::FirstPatterns;
use nirspi_recon::reconstruct::{
    MatrixSettings, Method, MethodSettings, OwnAtoms, OwnMatrix, ReconstructError, Reconstruction,
    Report, Setting, Sparsity, Strength,
};
use nirspi_recon::{Basis, Measurements, Rows, Sampling, SamplingError, Side};
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
    order: Option<String>,
    basis: Option<String>,
    dictionary: Option<PyReadonlyArray1<'py, f32>>,
    sparsity: Option<usize>,
    residual: Option<f64>,
    stop_at_noise: bool,
    strength: Option<f64>,
    as_printed: bool,
    non_negative: bool,
    keep: Option<String>,
    warm_start: bool,
    device: String,
}

impl Options<'_> {
    /// These options, with atoms of a file.
    pub(crate) fn recipe(&self, dictionary: Option<PathBuf>) -> PyResult<Recipe> {
        if self.warm_start {
            return Err(refused("warm_start belongs to the frames of one file, not to a table"));
        }
        let sampling = self.sampling.parse().map_err(|error| self.of_sampling(&error))?;
        Ok(Recipe {
            method: self.method()?,
            settings: self.settings()?,
            dictionary,
            first: self.first()?,
            sampling,
        })
    }

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
        Ok(match self.order.as_deref() {
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
            completion: self.keep.as_ref().map(|keep| keep.parse().map_err(refusal)).transpose()?,
            network: Some(nirspi_nets::prior::shipped()),
            backend: backend(&self.device)?.0,
        })
    }
}

/// The measurements of a frame without the patterns that were not read (NaN).
fn frame(rows: &Rows, d: &[f64]) -> PyResult<Measurements> {
    // Without an early end, so that the compiler uses vectors.
    if !d.iter().fold(false, |nan, value| nan | value.is_nan()) {
        return Measurements::from_differential(rows, d).map_err(refusal);
    }
    let read = || rows.iter().zip(d).filter(|(_, value)| !value.is_nan());
    let kept = Rows::new(rows.side(), read().map(|(&row, _)| row));
    let kept =
        kept.map_err(|_| refused("d has no pattern that was read, expected at least one"))?;
    let values: Vec<f64> = read().map(|(_, &value)| value).collect();
    Measurements::from_differential(&kept, &values).map_err(refusal)
}

fn stopped() -> PyErr {
    refused("stopped")
}

/// The text of a refusal, without the words of the command line.
fn of_method(error: ReconstructError) -> PyErr {
    refusal(error)
}

/// What an image was made of.
struct Made {
    report: Report,
    used: Rows,
    order: String,
}

impl Made {
    /// Writes an image to its place. Refuses an image that 32-bit floats cannot hold.
    fn new(
        made: Reconstruction,
        used: &Measurements,
        order: String,
        place: &mut [f32],
    ) -> PyResult<Self> {
        // Without an early end, so that the compiler uses vectors.
        if !made.image.pixels().iter().fold(true, |finite, pixel| finite & pixel.is_finite()) {
            return Err(refused("the readings are too large for an image of 32-bit floats"));
        }
        place.copy_from_slice(made.image.pixels());
        Ok(Self { report: made.report, used: used.rows().clone(), order })
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

/// The images of frames of differences; reports as JSON, each with the number of images in a row that it is of; and the
/// rows used: of each image, or those of all if they are the same.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "a tuple for Python")]
pub fn reconstruct<'py>(
    py: Python<'py>,
    n: u64,
    shown: PyReadonlyArray1<'py, i64>,
    d: PyReadonlyArray1<'py, f64>,
    options: &Bound<'py, PyDict>,
) -> PyResult<(Bound<'py, PyArray1<f32>>, Vec<(String, usize)>, Vec<Bound<'py, PyArray1<i64>>>)> {
    let options: Options<'_> = options.extract()?;
    let (method, settings) = (options.method()?, options.settings()?);
    let (first, sampling) = (options.first()?, options.sampling()?);
    let warm = options.warm_start;
    if warm && !method.takes(Setting::WarmStart) {
        let methods = Method::listed(|method| method.takes(Setting::WarmStart));
        return Err(refused(format!("warm-start belongs to {methods}, not to {method}")));
    }
    settings.check(method).map_err(of_method)?;
    let rows = rows(side(n)?, &shown)?;
    let d = slice(&d)?;
    let area = rows.side().area();
    let pixels = room::<f32>(py, whole("d", d.len(), rows.len())? * area)?;
    let mut place = pixels.readwrite();
    let places = fill(&mut place)?;
    let (reports, mut shown) = long(py, |stop| {
        let ready = method.prepare(&settings).map_err(of_method)?;
        // Worked out once, for all frames without a pattern that was not read.
        let (whole, name) = first.among(&rows, sampling).map_err(refusal)?;
        let taken = |d: &[f64]| {
            let frame = frame(&rows, d)?;
            if *frame.rows() == rows {
                return Ok((whole.of(&frame), name.clone()));
            }
            first.take(&frame, sampling).map_err(refusal)
        };
        let frames = d.par_chunks_exact(rows.len());
        let made: Vec<Made> = if warm {
            let (used, orders): (Vec<Measurements>, Vec<String>) =
                frames.map(taken).collect::<PyResult<Vec<_>>>()?.into_iter().unzip();
            let made = ready.reconstruct_video(&used).map_err(of_method)?;
            let parts = made.into_iter().zip(used.iter().zip(orders));
            parts
                .zip(places.chunks_exact_mut(area))
                .map(|((made, (used, order)), place)| Made::new(made, used, order, place))
                .collect::<PyResult<_>>()?
        } else {
            let one = |(d, place): (&[f64], &mut [f32])| match stop.load(Ordering::Relaxed) {
                true => Err(stopped()),
                false => {
                    let (used, order) = taken(d)?;
                    let made = ready.reconstruct(&used).map_err(of_method)?;
                    Made::new(made, &used, order, place)
                }
            };
            frames.zip(places.par_chunks_exact_mut(area)).map(one).collect::<PyResult<_>>()?
        };
        // The reports of a simple method are all the same.
        let alike = made.chunk_by(|one, next| next.has_report_of(one));
        let reports = alike.map(|alike| Ok((alike[0].report(method)?, alike.len())));
        let reports = reports.collect::<PyResult<Vec<_>>>()?;
        let shown: Vec<Rows> = made.into_iter().map(|one| one.used).collect();
        Ok((reports, shown))
    })?;
    drop(place);
    if shown.windows(2).all(|two| two[0] == two[1]) {
        shown.truncate(1);
    }
    let numbers = |rows: &Rows| array(py, rows.iter().map(|&row| i64::from(row)).collect());
    Ok((pixels, reports, shown.iter().map(numbers).collect()))
}

/// The images of readings by patterns of one's own, and a report of each as JSON.
#[pyfunction]
pub fn reconstruct_matrix<'py>(
    py: Python<'py>,
    n: u64,
    weights: PyReadonlyArray1<'py, f64>,
    y: PyReadonlyArray1<'py, f64>,
    options: &Bound<'py, PyDict>,
) -> PyResult<(Bound<'py, PyArray1<f32>>, Vec<String>)> {
    let options: Options<'_> = options.extract()?;
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
        ..MatrixSettings::new(how)
    };
    let (side, weights, y) = (side(n)?, slice(&weights)?, slice(&y)?);
    let (pixels, reports) = long(py, |stop| of_matrix(side, weights, y, method, &settings, stop))?;
    Ok((array(py, pixels), reports))
}

fn of_matrix(
    side: Side,
    weights: &[f64],
    y: &[f64],
    method: Method,
    settings: &MatrixSettings,
    stop: &AtomicBool,
) -> PyResult<(Vec<f32>, Vec<String>)> {
    let matrix = OwnMatrix::new(side, weights).map_err(refusal)?;
    whole("y", y.len(), matrix.patterns())?;
    let (mut pixels, mut reports) = (Vec::new(), Vec::new());
    for y in y.chunks_exact(matrix.patterns()) {
        if stop.load(Ordering::Relaxed) {
            return Err(stopped());
        }
        let made = matrix.reconstruct(y, settings).map_err(refusal)?;
        pixels.extend_from_slice(made.image.pixels());
        let (atoms, why) = made.atoms.map(|(atoms, stop)| (atoms, format!("{stop:?}"))).unzip();
        let report = serde_json::json!({
            "method": method.argument(), "used": matrix.patterns(), "order": "as given", "warm": false,
            "rank": matrix.rank(), "unseen_pixels": matrix.unseen_pixels(),
            "strength": made.strength, "sparsity": atoms, "stop": why,
            "relative_residual": made.residual,
            "words": format!("{}, {} patterns of one's own, relative residual {:.3}",
                             method.name(), matrix.patterns(), made.residual),
        });
        reports.push(report.to_string());
    }
    Ok((pixels, reports))
}
