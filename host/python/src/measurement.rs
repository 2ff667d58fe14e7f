//! Measurements from readings, and how a file of measurements is read.

use crate::arrays::{array, rows, side, slice};
use crate::errors::{refusal, refused};
use crate::orders::named;
use crate::work::heavy;
use nirspi::calibration;
use nirspi::files::measurement::{Form, Selection};
use nirspi::source::{Index, Part, SourceOptions};
use nirspi_recon::{Dropout, Image, Measurements, Rows, Side};
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
    detector: Option<String>,
    shown: Option<String>,
    side: Option<u64>,
    field: Option<String>,
    readings: Option<String>,
    patterns_first: bool,
    transpose: bool,
    decimal_comma: bool,
    part: String,
    keep_leak: bool,
    no_flat_field: bool,
}

/// A word of a list, or a refusal that names the option.
fn word<T: FromStr<Err = String>>(option: &str, text: &str) -> PyResult<T> {
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
        };
        Ok(SourceOptions {
            index: self.index.as_deref().map(|index| word::<Index>("index", index)).transpose()?,
            detector: self
                .detector
                .as_deref()
                .map(|at| word::<Index>("detector", at))
                .transpose()?,
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

/// The differences of readings in a form, one measurement: `(rows, d, dropouts, notes)`.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "a tuple for Python")]
pub fn readings<'py>(
    py: Python<'py>,
    n: u64,
    shown: PyReadonlyArray1<'py, i64>,
    y: PyReadonlyArray1<'py, f64>,
    form: &str,
) -> PyResult<(Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<f64>>, Vec<Lost>, Vec<String>)> {
    let form = word::<Form>("readings", form)?;
    let rows = rows(side(n)?, &shown)?;
    let y = slice(&y)?;
    let (measured, dropouts, notes) = heavy(py, || {
        let mut notes = Vec::new();
        let (mut measured, mut dropouts) = (None, Vec::new());
        match form {
            Form::Pairs => {
                let (found, lost) = Measurements::from_pairs(&rows, y).map_err(refusal)?;
                (measured, dropouts) = (Some(found), lost);
            }
            Form::Halves => {
                let (plus, minus) = y.split_at(y.len() / 2);
                let pairs: Vec<f64> = plus.iter().zip(minus).flat_map(|(&p, &m)| [p, m]).collect();
                let (found, lost) = Measurements::from_pairs(&rows, &pairs).map_err(refusal)?;
                (measured, dropouts) = (Some(found), lost);
            }
            Form::Single => {
                let mut found = Measurements::from_single(&rows, y).map_err(refusal)?;
                if let Some(level) = found.remove_dark_level() {
                    notes.push(format!("a dark level of {level:.4} was found in `y` and removed"));
                }
                measured = Some(found);
            }
            Form::Differences => {}
        }
        let measured = match measured {
            Some(measured) => measured,
            None => Measurements::from_differential(&rows, y).map_err(refusal)?,
        };
        Ok((measured, dropouts, notes))
    })?;
    let rows = array(py, numbers(measured.rows()));
    Ok((rows, array(py, measured.into_values()), lost(dropouts), notes))
}
