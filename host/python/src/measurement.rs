//! Measurements from readings, and how a file of measurements is read.

use crate::arrays::{array, rows, side, slice};
use crate::errors::{refusal, refused};
use crate::orders::named;
use crate::work::heavy;
use nirspi::calibration;
use nirspi::files::measurement::{Form, Remedy, Selection};
use nirspi::source::{Index, OutlierReport, Part, SourceOptions};
use nirspi_recon::law::{self, Doubt};
use nirspi_recon::{Dropout, Image, Outlier, Rows, Side};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use std::str::FromStr;

/// The flat field of a camera, kept with a measurement of that camera.
#[pyclass(frozen, module = "nirspi._nirspi")]
pub struct FlatField(pub calibration::FlatField);

#[pymethods]
impl FlatField {
    /// The flat field of a text of [`FlatField::json`].
    #[new]
    fn new(json: &str) -> PyResult<Self> {
        let flat = serde_json::from_str(json).map_err(|error| refused(error.to_string()))?;
        Ok(Self(flat))
    }

    /// The flat field as a text.
    fn json(&self) -> PyResult<String> {
        serde_json::to_string(&self.0).map_err(|error| refused(error.to_string()))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((slf.get_type().into_any(), (slf.get().json()?,)))
    }

    /// Corrects images, 32 x 32 values each, one after another.
    pub fn correct<'py>(
        &self,
        py: Python<'py>,
        pixels: PyReadonlyArray1<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let side = Side::INSTRUMENT;
        let values = slice(&pixels)?;
        crate::arrays::whole("the array", values.len(), side.area())?;
        let of = |image: &[f32]| self.0.correct(&Image::new(side, image.to_vec()));
        let made = values.chunks_exact(side.area()).flat_map(|image| of(image).pixels().to_vec());
        Ok(array(py, made.collect()))
    }
}

/// Options that say what a file does not.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Options {
    index: Option<String>,
    shown: Option<String>,
    side: Option<u64>,
    field: Option<String>,
    readings: Option<String>,
    patterns_first: bool,
    transpose: bool,
    decimal_comma: bool,
    complements_first: bool,
    inverted: bool,
    shift: i32,
    sweeps: Option<u32>,
    divide_by_lamp: bool,
    part: String,
    keep_leak: bool,
    no_flat_field: bool,
}

/// A word of a list, or a refusal that names the option.
pub(crate) fn word<T: FromStr<Err = String>>(option: &str, text: &str) -> PyResult<T> {
    text.parse().map_err(|error| refused(format!("{option} is {text:?}, {error}")))
}

impl Options {
    pub(crate) fn checked(self) -> PyResult<SourceOptions> {
        let file = Selection {
            index: None,
            form: self
                .readings
                .as_deref()
                .map(|form| word::<Form>("readings", form))
                .transpose()?,
            field: self.field,
            patterns_first: self.patterns_first,
            side: self.side.map(side).transpose()?,
            shown: self.shown.as_deref().map(named).transpose()?,
            transpose: self.transpose,
            decimal_comma: self.decimal_comma,
            remedy: Remedy {
                complements_first: self.complements_first,
                inverted: self.inverted,
                shift: self.shift,
                sweeps: self.sweeps.unwrap_or(0),
                divide_by_lamp: self.divide_by_lamp,
            },
        };
        Ok(SourceOptions {
            index: self.index.as_deref().map(|index| word::<Index>("index", index)).transpose()?,
            file,
            part: word::<Part>("part", &self.part)?,
            keep_leak: self.keep_leak,
            no_flat_field: self.no_flat_field,
        })
    }
}

pub(crate) fn numbers(rows: &Rows) -> Vec<i64> {
    rows.iter().map(|&row| i64::from(row)).collect()
}

/// First reading, number of readings and rows of a drop-out.
pub(crate) type Lost = (usize, usize, Vec<u32>);

pub(crate) fn lost(dropouts: Vec<Dropout>) -> Vec<Lost> {
    dropouts.into_iter().map(|d| (d.start, d.length, d.rows)).collect()
}

/// Rows, differences, what their noise is at most, drop-outs and notes.
type Readings<'py> =
    (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<f64>>, Option<f64>, Vec<Lost>, Vec<String>);

/// The differences of readings in a form, one measurement.
#[pyfunction]
pub fn readings<'py>(
    py: Python<'py>,
    n: u64,
    shown: PyReadonlyArray1<'py, i64>,
    y: PyReadonlyArray1<'py, f64>,
    form: &str,
) -> PyResult<Readings<'py>> {
    let form = word::<Form>("readings", form)?;
    let rows = rows(side(n)?, &shown)?;
    let y = slice(&y)?;
    let read = heavy(py, || law::read(&rows, y, form.into()).map_err(refusal))?;
    let mut notes: Vec<String> = read
        .dark_level
        .map(|level| format!("a dark level of {level:.4} was found in `y` and removed"))
        .into_iter()
        .collect();
    notes.extend(warnings(&read.outliers, read.doubts.iter().map(Doubt::to_string)));
    let rows = array(py, numbers(read.measurements.rows()));
    let most_noise = read.measurements.most_noise();
    let d = array(py, read.measurements.into_values());
    Ok((rows, d, most_noise, lost(read.dropouts), notes))
}

/// Outliers and what contradicts the readings, in words.
pub(crate) fn warnings(outliers: &[Outlier], doubts: impl Iterator<Item = String>) -> Vec<String> {
    let outliers = outliers.iter().map(|outlier| OutlierReport::of(outlier).to_string());
    outliers.chain(doubts.map(|doubt| format!("warning: {doubt}"))).collect()
}
