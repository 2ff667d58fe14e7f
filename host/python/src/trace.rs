//! Readings of a trace of samples.

use crate::arrays::array;
use crate::errors::of_file;
use crate::made::said;
use crate::measurement::word;
use crate::work::heavy;
use nirspi::files::trace::{Cut, read};
use numpy::PyArray1;
use pyo3::prelude::*;
use std::path::PathBuf;

/// Which samples make readings.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Options {
    samples: Option<usize>,
    trigger: Option<String>,
    skip: usize,
    settle: usize,
    count: Option<usize>,
    field: Option<String>,
    raw: Option<String>,
    decimal_comma: bool,
}

impl Options {
    fn checked(self) -> PyResult<Cut> {
        let Self { samples, trigger, skip, settle, count, field, raw, decimal_comma } = self;
        let raw = raw.as_deref().map(|kind| word("raw", kind)).transpose()?;
        Ok(Cut { field, trigger, samples, skip, settle, count, raw, decimal_comma })
    }
}

/// The readings of a trace; what was found, what is not to be trusted, and what was left out, in words; where the readings
/// come from, as JSON.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "a tuple is what Python takes apart")]
pub fn trace<'py>(
    py: Python<'py>,
    path: PathBuf,
    options: Options,
) -> PyResult<(Bound<'py, PyArray1<f64>>, Vec<String>, Vec<String>, Option<String>, String)> {
    let cut = options.checked()?;
    let found = heavy(py, || read(&path, &cut).map_err(of_file))?;
    let (words, warnings) = (found.words(), found.warnings());
    let taken = said(&found.taken)?;
    Ok((array(py, found.readings), words, warnings, found.skipped, taken))
}
