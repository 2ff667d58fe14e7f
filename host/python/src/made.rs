//! A Python program in the provenance of what it writes.

use nirspi::provenance::Made;
use pyo3::prelude::*;

/// The running program: `sys.argv`, without secrets.
pub fn made(py: Python<'_>) -> PyResult<Made> {
    let arguments: Vec<String> = py.import("sys")?.getattr("argv")?.extract()?;
    let program = concat!("nirspi for Python ", env!("CARGO_PKG_VERSION"));
    Ok(Made::now(program, None, arguments))
}
