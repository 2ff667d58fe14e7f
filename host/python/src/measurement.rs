//! Measurements from files and from readings.

use crate::arrays::{array, fill, room, rows, side, slice};
use crate::errors::{of_source, refusal, refused};
use crate::orders::named;
use crate::work::{heavy, long};
use nirspi::calibration;
use nirspi::files::measurement::{Form, Selection};
use nirspi::source::{Index, Part, Several, Source, SourceOptions};
use nirspi_recon::{Dropout, Image, Measurements, Rows, Side};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
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

fn numbers(rows: &Rows) -> Vec<i64> {
    rows.iter().map(|&row| i64::from(row)).collect()
}

type Lost = (usize, usize, Vec<u32>);

fn lost(dropouts: Vec<Dropout>) -> Vec<Lost> {
    dropouts.into_iter().map(|d| (d.start, d.length, d.rows)).collect()
}

/// A measurement with the rows `shown`, which measurements of one file share.
fn as_dict<'py>(
    py: Python<'py>,
    source: Source,
    shown: &Bound<'py, PyArray1<i64>>,
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("n", source.measurements.side().pixels())?;
    dict.set_item("rows", shown)?;
    dict.set_item("d", array(py, source.measurements.into_values()))?;
    let imaginary = source.imaginary.map(|part| array(py, part.into_values()));
    dict.set_item("imaginary", imaginary)?;
    dict.set_item("dropouts", lost(source.dropouts))?;
    dict.set_item("not_read", source.not_read)?;
    let reference = source.reference.as_ref().map(|image| array(py, image.pixels().to_vec()));
    dict.set_item("reference", reference)?;
    let frames = source.frames.map(|c| (c.received, c.lost, c.corrupt, c.late));
    dict.set_item("frames", frames)?;
    dict.set_item("notes", source.notes)?;
    let flat = source.flat_field.map(|flat| Py::new(py, FlatField(flat))).transpose()?;
    dict.set_item("flat_field", flat)?;
    Ok(dict)
}

/// The measurements of a file as one block of differences, NaN where a pattern was not read; `None` for a file whose
/// measurements differ in their patterns or are no differences.
fn block<'py>(py: Python<'py>, several: &mut Several<'_>) -> PyResult<Option<Bound<'py, PyDict>>> {
    let Some(stack) = long(py, |_| several.stack().map_err(of_source))? else {
        return Ok(None);
    };
    let d = room::<f64>(py, stack.count() * stack.rows().len())?;
    {
        let mut place = d.readwrite();
        let values = fill(&mut place)?;
        let read = long(py, |_| stack.read_into(values).map_err(|error| of_source(error.into())))?;
        if !read {
            return Ok(None);
        }
    }
    let dict = PyDict::new(py);
    dict.set_item("n", stack.side().pixels())?;
    dict.set_item("rows", array(py, numbers(stack.rows())))?;
    dict.set_item("count", stack.count())?;
    dict.set_item("d", d)?;
    dict.set_item("references", stack.references().map(|images| array(py, images)))?;
    dict.set_item("notes", stack.notes())?;
    Ok(Some(dict))
}

/// The measurements of a file or recording: one, or all with `index` or `detector` "all". The first part of the pair
/// is all measurements in one block, if the file has them so; the second is then empty.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "a tuple for Python")]
pub fn load<'py>(
    py: Python<'py>,
    path: PathBuf,
    options: &Bound<'py, PyDict>,
) -> PyResult<(Option<Bound<'py, PyDict>>, Vec<Bound<'py, PyDict>>)> {
    let options = options.extract::<Options>()?.checked()?;
    let all = [options.index, options.detector].contains(&Some(Index::All));
    let several = long(py, |_| match all {
        true => Several::of(&path, &options).map_err(of_source),
        false => Ok(None),
    })?;
    let sources = match several {
        Some(mut several) => {
            if let Some(block) = block(py, &mut several)? {
                return Ok((Some(block), Vec::new()));
            }
            long(py, |_| several.each().map_err(of_source))?
        }
        None => long(py, |_| {
            let read = match all {
                true => Source::read_all(&path, &options),
                false => Source::read(&path, &options).map(|source| vec![source]),
            };
            read.map_err(of_source)
        })?,
    };
    let mut found = Vec::with_capacity(sources.len());
    let mut known: Option<(Rows, Bound<'py, PyArray1<i64>>)> = None;
    for source in sources {
        let rows = source.measurements.rows();
        let shown = match known.take() {
            Some((before, shown)) if before == *rows => shown,
            _ => array(py, numbers(rows)),
        };
        known = Some((rows.clone(), shown.clone()));
        found.push(as_dict(py, source, &shown)?);
    }
    Ok((None, found))
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
