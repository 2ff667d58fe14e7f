//! Arrays of NumPy as slices, and checks that every function of this crate shares. The Python files bring arrays into
//! the type and memory order that these functions take.

use crate::errors::{refusal, refused};
use nirspi_recon::{Rows, Side};
use numpy::{Element, PyArray1, PyReadonlyArray1, PyReadwriteArray1};
use pyo3::prelude::*;

/// A contiguous array that is only read.
pub fn slice<'a, T: Element>(array: &'a PyReadonlyArray1<'_, T>) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|error| refused(error.to_string()))
}

/// An array that owns its numbers.
pub fn array<T: Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyArray1<T>> {
    PyArray1::from_vec(py, values)
}

/// An array with room for so many numbers, which are not set. NumPy takes large ones in large pages, which a `Vec` does
/// not.
pub fn room<'py, T: Element>(py: Python<'py>, count: usize) -> PyResult<Bound<'py, PyArray1<T>>> {
    let made = py.import("numpy")?.call_method1("empty", (count, T::get_dtype(py)))?;
    made.cast_into().map_err(|error| refused(error.to_string()))
}

/// The numbers of an array that this call has made.
pub fn fill<'a, T: Element>(array: &'a mut PyReadwriteArray1<'_, T>) -> PyResult<&'a mut [T]> {
    array.as_slice_mut().map_err(|error| refused(error.to_string()))
}

/// The checked side of an image.
pub fn side(n: u64) -> PyResult<Side> {
    Side::new(n).map_err(refusal)
}

/// The checked rows.
pub fn rows(side: Side, rows: &PyReadonlyArray1<'_, i64>) -> PyResult<Rows> {
    Rows::new(side, slice(rows)?.iter().copied()).map_err(refusal)
}

/// Refuses a number of values that is no whole number of parts.
pub fn whole(what: &str, found: usize, part: usize) -> PyResult<usize> {
    if part > 0 && found.is_multiple_of(part) {
        Ok(found / part)
    } else {
        Err(refused(format!("{what} holds {found} values, expected a multiple of {part}")))
    }
}
